import math
from dataclasses import replace

import pytest
from scripted import ScriptedRobot, raising

from vvvaltr.controller.core.errors import LinkLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import MotorState, Outcome, Pose, Trial
from vvvaltr.controller.loop.movement import measure_applied, measure_movement
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial

TRIAL = Trial(1, Gait((10.0, -8.0)), Outcome.COMPLETED, "", 0.0, 1.0)


def drive(*poses: Pose) -> Trial:
    return replace(TRIAL, poses=poses)


def test_a_robot_that_faces_north_and_walks_north_west_moves_forward_and_to_the_left() -> None:
    north = math.pi / 2

    movement = measure_movement(drive(Pose(0.0, (1.0, 1.0, 0.1), north), Pose(1.0, (0.9, 1.3, 0.1), north + 0.2)))

    assert movement is not None
    displacement = movement.displacement
    assert (displacement.forward_m, displacement.left_m) == pytest.approx((0.3, 0.1))
    assert displacement.turn_rad == pytest.approx(0.2)
    assert movement.start.position_m == (1.0, 1.0, 0.1)
    assert movement.end.yaw_rad == north + 0.2


@pytest.mark.parametrize(("distance_m", "sd_m", "is_within"), [(0.0005, 0.0003, True), (0.001, 0.0003, False)])
def test_a_distance_below_two_standard_errors_says_so(distance_m: float, sd_m: float, is_within: bool) -> None:
    start = RestingPose((0.1, 0.2, 0.06), position_sd_m=sd_m)
    end = RestingPose((0.1, 0.2 + distance_m, 0.06), position_sd_m=sd_m)

    movement = measure_movement(replace(TRIAL, start=start, end=end))

    assert movement is not None
    assert movement.error_m == pytest.approx(math.sqrt(2.0) * sd_m)
    assert movement.is_within_error is is_within


def test_a_distance_whose_error_is_not_known_is_not_within_it() -> None:
    movement = measure_movement(drive(Pose(0.0, (0.0, 0.0, 0.1)), Pose(1.0, (0.0, 0.0, 0.1))))

    assert movement is not None
    assert (movement.error_m, movement.is_within_error) == (None, False)


@pytest.mark.parametrize("turns", [-1.3, 0.7, 2.25])
def test_turns_of_more_than_half_a_circle_are_counted_whole(turns: float) -> None:
    angles_rad = [math.remainder(math.tau * turns * step / 20, math.tau) for step in range(21)]

    movement = measure_movement(drive(*(Pose(0.05 * i, (0.0, 0.0, 0.0), yaw) for i, yaw in enumerate(angles_rad))))

    assert movement is not None
    assert movement.displacement.turn_rad == pytest.approx(math.tau * turns)


def test_a_trial_with_one_pose_or_with_one_that_is_not_a_number_has_no_movement() -> None:
    here = Pose(0.0, (0.0, 0.0, 0.0))
    assert measure_movement(drive(here)) is None
    assert measure_movement(drive(here, Pose(0.5, (math.nan, 0.0, 0.0)), here)) is None


def test_applied_frequencies_are_the_means_of_what_the_motors_told() -> None:
    states = (MotorState(0.1, (4.0, -4.0)), MotorState(0.2, (10.0, -8.0), measured=False))

    applied = measure_applied(replace(TRIAL, states=states))

    assert applied is not None
    assert applied.mean_hz == (7.0, -6.0)
    assert not applied.measured


def test_motors_that_told_nothing_have_no_applied_frequencies() -> None:
    assert measure_applied(TRIAL) is None
    assert measure_applied(replace(TRIAL, states=(MotorState(0.1, (math.nan, 1.0)),))) is None


def test_a_trial_that_lost_its_link_still_tells_what_it_saw() -> None:
    robot = ScriptedRobot(at_s=0.5, event=raising(LinkLost("unplugged")), where="drive")

    trial = run_trial(robot, Gait((10.0, 0.0, 0.0)), TrialSettings(duration_s=1.0))

    movement, applied = measure_movement(trial), measure_applied(trial)
    assert trial.outcome is Outcome.LINK_LOST
    assert movement is not None and movement.displacement.forward_m > 0.0
    assert applied is not None and applied.mean_hz[0] > 0.0
