"""Random faults of poses while a robot learns, in short; `python -m benchmarks.faults` is the long campaign."""

import pytest

from benchmarks.faults import count_events
from vvvaltr.drivers.mocking.faults import POSE_KINDS


@pytest.mark.flaky(reruns=2)  # in real time
@pytest.mark.parametrize("device", ["qik", "node"])
def test_no_trial_is_learned_from_that_is_not_what_the_robot_did(device: str) -> None:
    counts = count_events(device, faults=5, seed=1, kinds=POSE_KINDS)

    assert counts["trials_completed"] + counts["trials_cut_short"] >= 5
    assert counts["spoilt_trials_learned_from"] == counts["motors_left_running"] == counts["crashed"] == 0
