"""A run whose `run.toml` was changed by hand, and what is asked wrongly of a run: one line with the cure."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.controller.runs.run import RunDirectory

ROBOT = """
[tracker]
kind = "stream"
port = 9763
[[line]]
driver = "node"
port = "/dev/none"
motor = [{ max_hz = 15.0 }]
[trial]
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.mktemp("runs") / "made"
    assert main(["learn", "--trials", "2", "--duration", "0.2", "--no-recording", "--out", str(run)]) == 0
    return run


def refusal(arguments: list[str], capsys: pytest.CaptureFixture[str], status: int = 1) -> str:
    """Return the one line by which a command is refused."""
    capsys.readouterr()
    assert main(arguments) == status
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert "unexpected" not in err
    return err.strip()


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('score = "net"', 'score = "x"', "score is 'x'; allowed: net"),
        ('name = "planar"', 'name = "foo"', "unknown robot 'foo'"),
        ('method = "drive"', 'method = "magic"', "'magic'"),
        ('world = "flat"', 'world = "moon"', "'moon'"),
        ("    16.7,\n", "    99.0,\n", "range_hz: motor 1: 99 Hz"),
        ("    16.7,\n", "    nan,\n", "range_hz"),
        ("    16.7,\n", "    -5.0,\n", "range_hz 4 -5 is empty: give the lower"),
        ("duration_s = 0.2", "duration_s = -1.0", "duration_s is -1; allowed: 0.1 to 3600"),
        ("duration_s = 0.2", "duration_s = nan", "duration_s is nan"),
        ("duration_s = 0.2", "duration_s = inf", "duration_s is inf"),
        ("seed = 0", "seed = -1", "seed is -1; allowed: "),
        ('"frequency"', '"foo"', "optimise: 'foo' is unknown; allowed: frequency"),
        ("trials = 2", "trials = -1", "trials is -1; allowed: "),
        ("stop_below_m_s = 0.0", "stop_below_m_s = nan", "stop_below_m_s is nan"),
        ("stop_below_m_s = 0.0", "stop_below_m_s = -1.0", "stop_below_m_s is -1"),
        ("stop_below_m_s = 0.0", "stop_below_m_s = inf", "stop_below_m_s is inf"),
        ("format = 2\n", "", "format is missing; restore"),
        ("format = 2\n", "format = 3\n", "format 3 is not 1 or 2"),
        ("trials = 2\n", "", "trials is missing"),
    ],
)
def test_a_bad_value_of_the_run_is_named_with_its_file(
    made: Path, tmp_path: Path, old: str, new: str, key: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    shutil.copytree(made, run)
    text = (run / "run.toml").read_text()
    assert text.count(old) == 1
    (run / "run.toml").write_text(text.replace(old, new))
    log = (run / "trials.mcap").read_bytes()

    said = refusal(["learn", "--resume", str(run), "--trials", "5", "--no-recording"], capsys)

    assert said.startswith(f"vvvaltr: {run / 'run.toml'}: ")
    assert key in said
    assert (run / "trials.mcap").read_bytes() == log


def test_an_empty_run_file_is_to_be_restored(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = tmp_path / "run"
    shutil.copytree(made, run)
    (run / "run.toml").write_text("")

    assert refusal(["learn", "--resume", str(run)], capsys).endswith(
        "format is missing; restore the file as the run wrote it"
    )


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--robot", "spatial"), "--robot: the run has planar, but spatial was asked for"),
        (("--source", "elsewhere"), "--source: the run has none, but elsewhere was asked for"),
        (("--duration", "3"), "--duration: the run has 0.2, but 3.0 was asked for"),
        (("--range", "5", "6"), "--range: the run has 4.0 16.7, but 5.0 6.0 was asked for"),
        (("--stop-when", "2"), "--stop-when: the run has 0, but 2 was asked for"),
        (("--confirm", "1x1"), "--confirm: the run has 0x0, but 1x1 was asked for"),
        (("--optimise", "frequency,phase"), "--optimise: the run has frequency, but frequency,phase was asked for"),
        (("--gravity", "5"), "--gravity: the run has 9.81, but 5.0 was asked for"),
    ],
)
def test_a_difference_is_named_by_the_option_that_was_typed(
    made: Path, more: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert refusal(["learn", "--resume", str(made), *more], capsys).startswith(f"vvvaltr: {said}; leave it out, or")


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (("--range", "5", "4"), 2, "--range 5 4 is empty: give the lower frequency first"),
        (("--range", "4", "99"), 2, "--range: motor 1: 99 Hz is outside"),
        (("--out", ""), 2, "--out names no new directory: give it a name, as in runs/mine, or leave it out"),
    ],
)
def test_what_no_run_can_have_is_refused_before_anything_is_written(
    arguments: tuple[str, ...],
    status: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    assert refusal(["learn", *arguments], capsys, status).startswith(f"vvvaltr: {said}")
    assert list(tmp_path.iterdir()) == []


def test_of_two_runs_begun_in_one_place_at_once_the_second_is_told_that_it_exists(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, rename = tmp_path / "run", Path.rename

    def rename_later(fresh: Path, target: Path) -> Path:
        target.mkdir()
        (target / "run.toml").write_text("the other's")
        return rename(fresh, target)

    monkeypatch.setattr(Path, "rename", rename_later)
    with pytest.raises(
        UserError, match=f"^{place} exists: choose another --out, or continue it with --resume {place}$"
    ):
        RunDirectory.create(place, {})

    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    assert (place / "run.toml").read_text() == "the other's"


@pytest.mark.parametrize("line", ["settle_s = inf", "ramp_s = inf", "duration_s = inf", "duration_s = 0.05"])
def test_a_trial_that_never_ends_or_is_no_time_is_refused_in_the_robot_file(line: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT)
    load_robot_file(path)
    path.write_text(ROBOT + line)

    with pytest.raises(UserError, match=rf"robot\.toml: trial\.{line.split()[0]} is "):
        load_robot_file(path)


def test_a_twin_whose_engine_is_not_installed_is_said_before_a_campaign_begins(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['mujoco'] = None\n")
    out = tmp_path / "campaign"
    paths = [str(tmp_path), str(Path(__file__).parents[3]), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]

    ended = subprocess.run(
        [sys.executable, "-c", "from vvvaltr.entry import main; main()",
         "experiment", "1", "--robot", "spatial", "--repeats", "1", "--out", str(out)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}, capture_output=True, text=True,
    )  # fmt: skip

    assert ended.returncode == 1
    assert "pip install" in ended.stderr and "unexpected" not in ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    assert not out.exists()
