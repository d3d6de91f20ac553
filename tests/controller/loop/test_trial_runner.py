import gc
import math

import pytest
from scripted import ScriptedRobot, raising

from vvvaltr.controller.core.errors import DeviceFault, DeviceTimeout, LinkLost, TrackingLost
from vvvaltr.controller.core.values import Gait, Outcome, Pose
from vvvaltr.controller.loop.safety import Arena, GuardedRobot, Limits
from vvvaltr.controller.loop.trial_runner import TrialCrashed, TrialSettings, run_trial

GAIT = Gait((10.0, 8.0, 6.0))
NO_RAMP = TrialSettings(duration_s=2.0, ramp_s=0.0)


def test_a_trial_settles_drives_for_its_time_and_stops() -> None:
    robot = ScriptedRobot()

    trial = run_trial(robot, GAIT, NO_RAMP, number=7)

    assert (trial.number, trial.gait, trial.outcome, trial.reason) == (7, GAIT, Outcome.COMPLETED, "")
    assert robot.placed == [7]
    assert robot.t_s == pytest.approx(7000.0 + NO_RAMP.settle_s + 2.0)
    assert trial.duration_s == 2.0
    assert trial.poses[0].t_s == 0.0
    assert trial.poses[-1].t_s == 2.0
    assert trial.poses[-1].position_m[0] - trial.poses[0].position_m[0] == pytest.approx(0.2)
    assert not robot.is_running


def test_the_ramp_rises_to_the_gait_in_its_time() -> None:
    trial = run_trial(ScriptedRobot(), GAIT, TrialSettings(duration_s=1.0, ramp_s=0.2, period_s=0.05))

    shares = [command.gait.frequency_hz[0] / 10.0 for command in trial.commands]

    assert shares[:5] == pytest.approx([0.25, 0.5, 0.75, 1.0, 1.0])
    assert trial.commands[-1].gait == GAIT


def test_requests_and_what_is_applied_are_kept_apart() -> None:
    robot = ScriptedRobot(at_s=0.0, event=lambda: (9.5, 7.5, 5.5), where="state")

    trial = run_trial(robot, GAIT, NO_RAMP)

    assert {command.gait for command in trial.commands} == {GAIT}
    assert {state.frequency_hz for state in trial.states} == {(9.5, 7.5, 5.5)}
    assert [command.t_s for command in trial.commands][:3] == [0.0, 0.05, 0.1]
    assert [state.t_s for state in trial.states][:3] == [0.05, 0.1, 0.15]


def test_the_last_step_is_cut_to_the_duration() -> None:
    trial = run_trial(ScriptedRobot(), GAIT, TrialSettings(duration_s=0.12))

    assert [pose.t_s for pose in trial.poses] == [0.0, 0.05, 0.1, 0.12]


@pytest.mark.parametrize(
    ("where", "error", "outcome"),
    [
        ("pose", TrackingLost("the body is hidden"), Outcome.TRACKING_LOST),
        ("state", DeviceFault("stall", "motor 2 stalls"), Outcome.FAULTED),
        ("state", DeviceTimeout("no telemetry for 0.3 s"), Outcome.FAULTED),
        ("drive", LinkLost("unplugged"), Outcome.LINK_LOST),
        ("place", LinkLost("unplugged"), Outcome.LINK_LOST),
        ("sleep", KeyboardInterrupt("SIGTERM"), Outcome.INTERRUPTED),
    ],
)
def test_what_goes_wrong_becomes_the_outcome_with_its_reason(
    where: str, error: BaseException, outcome: Outcome
) -> None:
    robot = ScriptedRobot(at_s=1.0, event=raising(error), where=where)

    trial = run_trial(robot, GAIT, NO_RAMP)

    assert (trial.outcome, trial.reason) == (outcome, str(error))
    assert trial.duration_s == (0.0 if where == "place" else pytest.approx(1.0, abs=0.051))
    assert robot.stops == 1
    assert not robot.is_running


def test_a_defect_of_the_program_stops_the_motors_and_goes_on_with_the_record() -> None:
    robot = ScriptedRobot(at_s=1.0, event=raising(ZeroDivisionError("division by zero")))

    with pytest.raises(TrialCrashed) as crash:
        run_trial(robot, GAIT, NO_RAMP)

    assert crash.value.trial.outcome is Outcome.CRASHED
    assert crash.value.trial.reason == "ZeroDivisionError: division by zero"
    assert isinstance(crash.value.__cause__, ZeroDivisionError)
    assert not robot.is_running


def test_a_pose_that_is_not_a_number_is_a_lost_tracker() -> None:
    trial = run_trial(ScriptedRobot(at_s=1.0, event=lambda: (math.nan, 0.0, 0.0)), GAIT, NO_RAMP)

    assert trial.outcome is Outcome.TRACKING_LOST
    assert all(pose.is_finite for pose in trial.poses)


def test_an_applied_frequency_that_is_not_a_number_faults_the_trial() -> None:
    robot = ScriptedRobot(at_s=1.0, event=lambda: (math.nan, 0.0, 0.0), where="state")

    trial = run_trial(GuardedRobot(robot, Limits((16.7,) * 3)), GAIT, NO_RAMP)

    assert trial.outcome is Outcome.FAULTED
    assert not robot.is_running


def test_circling_cuts_the_trial_short_and_it_counts_over_the_time_it_ran() -> None:
    robot = ScriptedRobot(at_s=1.0)
    robot.event = lambda: Pose(robot.t_s, (robot.x_m, 0.0, 0.0), yaw_rad=1.5)

    trial = run_trial(robot, GAIT, NO_RAMP)

    assert trial.outcome is Outcome.CUT_SHORT
    assert trial.duration_s == pytest.approx(1.2)


def test_leaving_the_arena_keeps_the_pose_that_left_it() -> None:
    settings = TrialSettings(duration_s=2.0, ramp_s=0.0, arena=Arena((-0.1, 0.1), (-0.1, 0.1)))

    trial = run_trial(ScriptedRobot(), GAIT, settings)

    assert trial.outcome is Outcome.CUT_SHORT
    assert trial.poses[-1].position_m[0] > 0.1
    assert trial.duration_s == trial.poses[-1].t_s < 2.0


def test_starting_outside_the_arena_measures_nothing() -> None:
    settings = TrialSettings(arena=Arena((1.0, 2.0), (-0.1, 0.1)))

    trial = run_trial(ScriptedRobot(), GAIT, settings)

    assert trial.outcome is Outcome.FAULTED
    assert "before the drive began" in trial.reason
    assert trial.commands == ()


def test_a_link_that_is_dead_at_the_stop_does_not_hide_the_interrupt() -> None:
    robot = ScriptedRobot(at_s=1.0, event=raising(KeyboardInterrupt("SIGINT")), stop_error=LinkLost("unplugged"))

    assert run_trial(robot, GAIT, NO_RAMP).outcome is Outcome.INTERRUPTED


def test_a_trial_whose_motors_could_not_be_stopped_is_not_completed() -> None:
    trial = run_trial(ScriptedRobot(stop_error=LinkLost("unplugged")), GAIT, NO_RAMP)

    assert (trial.outcome, trial.reason) == (Outcome.LINK_LOST, "unplugged")


def test_a_hung_runner_lets_the_command_expire() -> None:
    robot = ScriptedRobot()
    robot.where, robot.at_s = "pose", 1.0
    robot.event = lambda: robot.sleep(NO_RAMP.hold_s + 0.01) or raising(TrackingLost(f"running: {robot.is_running}"))()

    assert run_trial(robot, GAIT, NO_RAMP).reason == "running: False"


@pytest.mark.parametrize("where", ["sleep", "pose"])
def test_a_trial_in_which_a_command_ran_out_measured_nothing(where: str) -> None:
    robot = ScriptedRobot(at_s=1.0, where=where)

    def hang() -> None:
        robot.event = lambda: None
        robot.sleep(NO_RAMP.hold_s + 0.01)

    robot.event = hang
    trial = run_trial(robot, GAIT, NO_RAMP)

    assert trial.outcome is Outcome.FAULTED
    assert "so the motors stopped" in trial.reason


def test_no_garbage_is_collected_while_motors_turn() -> None:
    seen: list[bool] = []

    run_trial(ScriptedRobot(at_s=0.0, event=lambda: seen.append(gc.isenabled())), GAIT, NO_RAMP)

    assert set(seen) == {False}
    assert gc.isenabled()
