"""Random faults of poses while a robot learns, in short; `python -m benchmarks.faults` is the long campaign."""

import pytest

from benchmarks.faults import count_events
from vvvaltr.drivers.mocking.faults import POSE_KINDS, RADIO_KINDS, Kind


@pytest.mark.flaky(reruns=2)  # in real time
@pytest.mark.parametrize("device", ["qik", "node"])
def test_no_trial_is_learned_from_that_is_not_what_the_robot_did(device: str) -> None:
    counts = count_events(device, faults=5, seed=1, kinds=POSE_KINDS)

    assert counts["trials_completed"] + counts["trials_cut_short"] >= 5
    assert counts["spoilt_trials_learned_from"] == counts["motors_left_running"] == counts["crashed"] == 0


@pytest.mark.flaky(reruns=2)  # in real time
def test_a_bad_radio_leaves_no_strut_on_and_spoils_no_trial_that_is_learned_from() -> None:
    counts = count_events("struts", faults=3, seed=1, kinds=RADIO_KINDS | {Kind.UNPLUG, Kind.DELAY})

    assert counts["trials_completed"] + counts["trials_cut_short"] >= 3
    assert counts["spoilt_trials_learned_from"] == counts["motors_left_running"] == counts["crashed"] == 0
