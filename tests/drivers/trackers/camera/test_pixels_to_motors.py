"""The whole loop: a mock device moves its twin, which is drawn, seen by the camera and driven by the controller."""

from contextlib import closing
from pathlib import Path
from threading import Timer

import msgspec
import pytest

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.hardware import open_hardware
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.process import MockProcess

FAST = Gait((12.0, 14.0, 16.0))


@pytest.fixture(scope="module")
def mock(tmp_path_factory):
    with MockProcess("qik", tmp_path_factory.mktemp("camera") / "port", "--tracker", "camera") as mock:
        yield mock


@pytest.fixture
def robot(mock):
    file = load_robot_file(Path(mock.greeting.robot_file))
    patient = msgspec.structs.replace(file.tracker, age_limit_s=0.5)  # three processes share what is left of a machine
    with closing(open_hardware(msgspec.structs.replace(file, tracker=patient))) as robot:
        yield robot


def test_a_trial_is_seen_from_pixels_to_motors_and_its_pictures_are_kept(robot):
    trial = run_trial(robot, FAST, TrialSettings(duration_s=3.0, heading_limit_rad=None))
    assert (trial.outcome, trial.reason) == (Outcome.COMPLETED, "")
    moved_m = trial.poses[-1].position_m[0] - trial.poses[0].position_m[0]
    assert 0.01 < abs(moved_m) < 0.2  # the twin makes 18 mm/s with this gait
    assert all(0.0 < pose.uncertainty_m < 0.001 for pose in trial.poses)
    assert len({pose.t_s for pose in trial.poses}) > 40
    assert 2 <= len(trial.photos) <= 4
    assert all(0.0 <= photo.t_s < 4.0 for photo in trial.photos)


def test_a_hand_over_the_robot_ends_the_trial_and_stops_the_motors(mock, robot):
    hand = Timer(1.5, mock.inject, [Fault(Kind.BLIND, at_s=0.0, duration_s=1.0)])
    hand.start()
    trial = run_trial(robot, FAST, TrialSettings(duration_s=3.0, heading_limit_rad=None))
    assert trial.outcome is Outcome.TRACKING_LOST
    assert "does not see tag 0" in trial.reason
    assert 0.3 < trial.duration_s < 2.5
    assert mock.wait_until(lambda status: status.is_at_rest, timeout_s=0.5)
    hand.join()
