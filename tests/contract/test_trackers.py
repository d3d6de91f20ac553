"""Learning through each kind of tracker that a mock can be seen by: what is learned from is what the twin did."""

from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.runs.log import read_run
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.process import MockProcess


@pytest.mark.flaky(reruns=2)  # in real time
@pytest.mark.parametrize("kind", ["stream", "qtm", "natnet"])
def test_a_mock_seen_through_a_tracker_is_learned_with(kind: str, tmp_path: Path) -> None:
    with MockProcess("qik", tmp_path / "port", "--robot", "spatial", "--tracker", kind) as mock:
        asked = ["--trials", "3", "--duration", "1", "--no-recording", "--out", str(tmp_path / "run")]
        assert main(["learn", "--robot", mock.greeting.robot_file, *asked]) == 0

    made = [logged.trial for logged in read_run(tmp_path / "run").trials]  # again, if a busy computer spoils one
    completed = [trial for trial in made if trial.outcome is Outcome.COMPLETED]
    assert len(completed) == 3
    for trial in completed:
        times_s = [pose.t_s for pose in trial.poses]
        assert times_s == sorted(times_s)
        assert len(set(times_s)) > 20
        assert abs(trial.conditions.tracker_offset_s or 1.0) < 0.1  # the mock's clock is this computer's
        assert 0.0 < (trial.conditions.tracker_jitter_s or 1.0) < 0.05
        assert (trial.poses[0].uncertainty_m is None) == (kind == "stream")
        assert all(0.0 < pose.position_m[2] < 0.3 for pose in trial.poses)  # upright, and in metres


@pytest.mark.flaky(reruns=2)
@pytest.mark.parametrize("kind", ["qtm", "natnet"])
def test_a_lost_robot_ends_the_trial_which_is_done_again(kind: str, tmp_path: Path) -> None:
    with MockProcess("qik", tmp_path / "port", "--tracker", kind) as mock:
        mock.inject(Fault(kind=Kind.BLIND, after_motion_s=0.4, duration_s=0.6))
        asked = ["--trials", "1", "--duration", "1", "--no-recording", "--out", str(tmp_path / "run")]
        assert main(["learn", "--robot", mock.greeting.robot_file, *asked]) == 0

    *before, completed = (logged.trial for logged in read_run(tmp_path / "run").trials)
    lost = [trial.reason for trial in before if trial.outcome is Outcome.TRACKING_LOST]
    assert any("the tracker does not see the robot" in reason for reason in lost)
    assert completed.outcome is Outcome.COMPLETED
