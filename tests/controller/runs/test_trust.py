"""A run that came from elsewhere opens no address before the user names a robot's file."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from gliding import GlidingRobot, tried

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Estimate, Recommendation, Suggestion
from vvvaltr.controller.robot.choice import RobotChoice
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.controller.runs.config import RunConfig, load_config, resumed_config, save_config
from vvvaltr.controller.runs.log import LOG_NAME, RunLog

ROBOT = """
[tracker]
kind = "stream"
port = 9763
[[line]]
driver = "node"
port = "/dev/ttyACM70"
motor = [{ max_hz = 15.0 }, { max_hz = 15.0 }, { max_hz = 15.0 }]
"""


@pytest.fixture
def robot_file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT)
    return path


@pytest.fixture
def run(robot_file: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "run"
    folder.mkdir()
    choice = RobotChoice(name=str(robot_file), file=msgspec.to_builtins(load_robot_file(robot_file)))
    config = RunConfig(choice, "plain", (), 0, 4, 1.0, "net", ("frequency",), (-15.0, 15.0))
    save_config(config, folder / "run.toml")
    with RunLog.create(folder / LOG_NAME, None) as log:
        for trial in tried(GlidingRobot(), 2):
            best = Recommendation(trial.gait, Estimate(0.02, 0.01, 0.03))
            log.append(LoggedTrial(Suggestion(trial.gait, "tried"), trial, 0.02, best))
    return folder


def on_another_computer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "other state"))


def test_my_own_run_goes_on_with_the_ports_it_had(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["learn", "--resume", str(run)]) == 1

    assert "/dev/ttyACM70: there is no such port now" in capsys.readouterr().err


def test_a_run_of_another_computer_asks_for_the_robots_file(
    run: Path, robot_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    on_another_computer(monkeypatch, tmp_path)

    assert main(["learn", "--resume", str(run)]) == 1
    assert "name your robot's file, --robot FILE.toml" in capsys.readouterr().err

    assert main(["learn", "--resume", str(run), "--robot", str(robot_file)]) == 1
    assert "/dev/ttyACM70: there is no such port now" in capsys.readouterr().err


def test_to_compare_gaits_of_another_computers_run_on_its_robot_asks_too(
    run: Path, robot_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    on_another_computer(monkeypatch, tmp_path)

    assert main(["compare", str(run), "1,2,3"]) == 1
    assert "name your robot's file, --robot FILE.toml" in capsys.readouterr().err

    assert main(["compare", str(run), "1,2,3", "--robot", str(robot_file)]) == 1
    assert "/dev/ttyACM70: there is no such port now" in capsys.readouterr().err


def test_the_movements_of_another_computers_run_are_taken_and_its_addresses_are_not(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    on_another_computer(monkeypatch, tmp_path)
    mine = tmp_path / "mine"

    assert main(["repertoire", "--from", str(run), "--out", str(mine)]) == 0

    for command in (["learn", "--resume", str(mine)], ["compare", str(mine), "1,2,3", "--trials", "9"]):
        assert main(command) == 1
        assert "/dev/ttyACM70" not in capsys.readouterr().err


def test_a_run_whose_addresses_were_edited_asks_too(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (run / "run.toml").read_text()
    (run / "run.toml").write_text(text.replace("/dev/ttyACM70", "/dev/ttyS0"))

    assert main(["learn", "--resume", str(run)]) == 1

    assert "was not made by you on this computer" in capsys.readouterr().err


def test_where_no_key_can_be_kept_the_file_is_asked_for(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "other state").write_text("a file")
    on_another_computer(monkeypatch, tmp_path)
    config = load_config(run)
    save_config(config, run / "run.toml")

    assert load_config(run).seal == ""
    with pytest.raises(UserError, match="was not made by you"):
        resumed_config(run, load_config(run), None)


def test_a_renumbered_port_is_taken_over_from_the_file_that_is_named(run: Path, tmp_path: Path) -> None:
    moved = tmp_path / "moved.toml"
    moved.write_text(ROBOT.replace("ttyACM70", "ttyACM71").replace("9763", "9764"))

    config = resumed_config(run, load_config(run), str(moved))

    assert config.robot.file is not None
    assert config.robot.file["line"][0]["port"] == "/dev/ttyACM71"
    assert config.robot.file["tracker"]["port"] == 9764
    save_config(config, run / "run.toml")
    assert resumed_config(run, load_config(run), None).robot.name == str(moved)


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("max_hz = 15.0", "max_hz = 12.0", r"line\[1\]\.motor\[1\]\.max_hz"),
        ('kind = "stream"', 'kind = "stream"\nage_limit_s = 0.1', r"tracker\.age_limit_s"),
        ('driver = "node"', 'driver = "node"\nbaud = 9600', r"line\[1\]\.baud"),
        ("[[line]]", "[trial]\nhold_s = 0.2\n[[line]]", r"trial\.hold_s"),
    ],
)
def test_every_other_difference_is_refused(run: Path, tmp_path: Path, old: str, new: str, place: str) -> None:
    other = tmp_path / "other.toml"
    other.write_text(ROBOT.replace(old, new))

    with pytest.raises(UserError, match=f"{place} is not as in the run .* with other addresses only"):
        resumed_config(run, load_config(run), str(other))


def test_the_key_is_the_users_alone(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    on_another_computer(monkeypatch, tmp_path)
    save_config(load_config(run), run / "run.toml")

    assert (tmp_path / "other state" / "vvvaltr" / "key").stat().st_mode & 0o777 == 0o600
