"""`init`: a first robot's file, and one line where that cannot be."""

import json
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.robot.commissioning import plugged_in
from vvvaltr.controller.robot.commissioning.plugged_in import Candidate
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.mocking.process import MockProcess

QIK = Candidate("/dev/ttyUSB0", "qik", "FTDI serial adapter: qik boards, or a motor node?", "serial")
NODE = Candidate("/dev/ttyACM0", "node", "a motor node?", "serial")
STRUTS = [Candidate(f"VVVALTR{n}", "struts", "Bluetooth LE", "bluetooth") for n in (1, 2, 3)]


@pytest.fixture
def plugged(monkeypatch: pytest.MonkeyPatch) -> list[Candidate]:
    found: list[Candidate] = []
    monkeypatch.setattr(plugged_in, "look_around", lambda with_bluetooth=True: (found, "no Bluetooth"))
    return found


def test_what_is_plugged_in_is_written_down(plugged: list[Candidate], tmp_path: Path) -> None:
    plugged.append(NODE)

    assert main(["init", str(tmp_path / "robot.toml"), "--no-probe", "--motors", "2"]) == 0

    robot = load_robot_file(tmp_path / "robot.toml")
    assert getattr(robot.line[0], "port") == NODE.address  # noqa: B009
    assert len(robot.motors) == 2


def test_struts_in_the_air_are_named(plugged: list[Candidate], tmp_path: Path) -> None:
    plugged += STRUTS

    assert main(["init", str(tmp_path / "robot.toml"), "--no-probe"]) == 0

    assert [motor.place for motor in load_robot_file(tmp_path / "robot.toml").motors] == [it.address for it in STRUTS]


def test_the_device_is_asked_whether_it_is_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "robot.toml"
    with MockProcess("node", tmp_path / "port") as mock:
        assert main(["init", str(file), "--driver", "node", "--port", mock.greeting.port, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["answers"]
        assert not any(any(status.applied_hz) for status in mock.statuses)
    file.unlink()

    assert main(["init", str(file), "--driver", "node", "--port", str(tmp_path / "port"), "--json"]) == 0

    told = json.loads(capsys.readouterr().out)
    assert not told["answers"]
    assert told["problem"]
    assert file.exists()


def test_of_a_device_that_was_not_asked_no_answer_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--driver", "qik", "--port", str(tmp_path / "nothing"), "--motors", "1", "--no-probe"]

    assert main(["init", str(tmp_path / "robot.toml"), *asked, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["answers"] is None

    assert main(["init", str(tmp_path / "other.toml"), *asked]) == 0
    assert "other.toml: 1 motor on qik" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("found", "arguments", "words"),
    [
        ([], [], "no device was found that motors hang on: plug it in, or name it by --driver and --port"),
        ([QIK, NODE], [], "--driver qik --port /dev/ttyUSB0, --driver node --port /dev/ttyACM0"),
        ([QIK], ["--driver", "qick", "--port", "x"], "did you mean qik?"),
        ([QIK], ["--tracker", "camara"], "did you mean camera?"),
    ],
)
def test_what_cannot_be_is_one_line(
    found: list[Candidate],
    arguments: list[str],
    words: str,
    plugged: list[Candidate],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    plugged += found

    assert main(["init", str(tmp_path / "robot.toml"), "--no-probe", "--quiet", *arguments]) in (1, 2)

    told = capsys.readouterr().err
    assert words in told
    assert told.count("\n") == 1
    assert not (tmp_path / "robot.toml").exists()


def test_a_file_is_never_overwritten(plugged: list[Candidate], tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text("mine")

    assert main(["init", str(tmp_path / "robot.toml")]) == 1

    assert (tmp_path / "robot.toml").read_text() == "mine"


def test_check_without_a_file_shows_the_same_list(plugged: list[Candidate], capsys: pytest.CaptureFixture[str]) -> None:
    plugged += [QIK, *STRUTS]

    assert main(["check", "--json"]) == 0

    told = json.loads(capsys.readouterr().out)
    assert told["serial_ports"] == [{"port": QIK.address, "description": QIK.what, "driver": "qik"}]
    assert told["struts"] == [it.address for it in STRUTS]
