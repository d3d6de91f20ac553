"""What version 0.1 wrote is opened: a run, a robot's file, a campaign."""

import json
import shutil
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.conditions import Conditions
from vvvaltr.controller.core.records import Review
from vvvaltr.controller.core.values import Phase
from vvvaltr.controller.loop.movement import measure_applied, measure_movement
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.opening import open_rig
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.controller.runs.config import load_config
from vvvaltr.controller.runs.log import read_run

FIXTURES = Path(__file__).parents[2] / "fixtures" / "version_0_1"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return shutil.copytree(FIXTURES / "run", tmp_path / "run")


def test_what_its_log_lacks_is_absent_but_for_what_its_poses_and_states_tell() -> None:
    run = read_run(FIXTURES / "run")

    assert [logged.trial.number for logged in run.trials] == list(range(1, 10))
    assert [logged.suggestion.phase for logged in run.trials] == [Phase.SEARCH] * 8 + [Phase.CONFIRMATION]
    assert run.about == {}
    for logged in run.trials:
        assert logged.score is not None and logged.score > 0.0
        assert logged.movement == measure_movement(logged.trial) is not None
        assert logged.applied == measure_applied(logged.trial) is not None
        assert (logged.fit, logged.steering) == (None, None)
        assert (logged.review, logged.trial.conditions) == (Review(), Conditions())


def test_its_damage_counted_from_0_is_the_same_damage_counted_from_1() -> None:
    config = load_config(FIXTURES / "run")
    first = read_run(FIXTURES / "run").trials[0]

    robot = open_rig(config.robot, config.seed).robot
    again = run_trial(robot, first.trial.gait, TrialSettings(config.duration_s, rest_poses=0), first.trial.number)

    assert config.robot.damage == ("snap:4", "lighten:3:0.5")
    assert score(again) == pytest.approx(first.score, rel=1e-3)


def test_its_run_is_resumed_and_its_confirmation_finished(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = read_run(run)

    assert (
        main(["learn", "--resume", str(run), "--damage", "snap:4", "--damage", "lighten:3:0.5", "--no-recording"]) == 0
    )

    after = read_run(run)
    assert after.trials[:9] == before.trials
    assert len(after.trials) == 10
    assert after.trials[9].suggestion.phase is Phase.CONFIRMATION
    assert after.trials[9].trial.gait == before.trials[8].trial.gait
    assert after.trials[9].movement is not None


def test_damage_asked_for_on_resuming_is_counted_from_1(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["learn", "--resume", str(run), "--damage", "snap:3", "--damage", "lighten:2:0.5"]) == 1
    assert "--damage: the run has snap:4 lighten:3:0.5" in capsys.readouterr().err


def test_its_run_is_shown(tmp_path: Path) -> None:
    recording = tmp_path / "run.rrd"
    assert main(["view", str(FIXTURES / "run"), "--save", str(recording)]) == 0
    assert recording.stat().st_size > 10_000


def test_its_run_is_a_source(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "target"
    asked = ["--source", str(FIXTURES / "run"), "--trials", "2", "--duration", "0.5", "--no-recording", "--json"]

    assert main(["learn", *asked, "--out", str(out)]) == 0

    assert json.loads(capsys.readouterr().out.splitlines()[-1])["method"] == "guarded"
    assert len(read_run(out).sources[0].gaits) == 9


def test_its_robot_file_is_read() -> None:
    assert load_robot_file(FIXTURES / "robot.toml").limits.max_hz == (16.5,) * 3


def test_its_campaign_is_reported_and_complete(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    campaign = shutil.copytree(FIXTURES / "campaign", tmp_path / "campaign")
    files = sorted(campaign.rglob("*.jsonl"))
    written_s = [path.stat().st_mtime for path in files]
    asked = ["--repeats", "2", "--methods", "guarded", "--duration", "0.3", "--starts", "2", "--trials", "5"]

    assert main(["experiment", "1b", "--robot", "planar", *asked, "--out", str(campaign)]) == 0
    assert main(["report", str(campaign), "--markdown"]) == 0

    assert "gravity times one and a half" in capsys.readouterr().out
    assert sorted(campaign.rglob("*.jsonl")) == files
    assert [path.stat().st_mtime for path in files] == written_s
