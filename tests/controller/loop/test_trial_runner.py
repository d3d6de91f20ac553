import gc
import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from scripted import ScriptedRobot, raising

from vvvaltr.controller.core.errors import DeviceFault, DeviceTimeout, LinkLost, TrackingLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Outcome, Pose
from vvvaltr.controller.loop.safety import Arena, GuardedRobot, Limits
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialCrashed, TrialSettings, run_trial
from vvvaltr.drivers.links.remote_clock import RemoteClock

GAIT = Gait((10.0, 8.0, 6.0))
NO_RAMP = TrialSettings(duration_s=2.0, ramp_s=0.0)


def test_a_trial_settles_drives_for_its_time_and_stops() -> None:
    robot = ScriptedRobot()

    trial = run_trial(robot, GAIT, NO_RAMP, number=7)

    assert (trial.number, trial.gait, trial.outcome, trial.reason) == (7, GAIT, Outcome.COMPLETED, "")
    assert robot.placed == [7]
    rest_s = NO_RAMP.rest_s + NO_RAMP.rest_poses * NO_RAMP.period_s
    assert robot.t_s == pytest.approx(7000.0 + NO_RAMP.settle_s + 2.0 + rest_s)
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


def test_a_speed_that_no_robot_has_is_a_lost_tracker_whatever_the_filter() -> None:
    robot = ScriptedRobot(at_s=1.0, event=lambda: (100.0, 0.0, 0.0))

    trial = run_trial(robot, GAIT, replace(NO_RAMP, plausibility=None))

    assert trial.outcome is Outcome.TRACKING_LOST
    assert "a speed of 50 m/s is not plausible" in trial.reason


def test_an_applied_frequency_that_is_not_a_number_faults_the_trial() -> None:
    robot = ScriptedRobot(at_s=1.0, event=lambda: (math.nan, 0.0, 0.0), where="state")

    trial = run_trial(GuardedRobot(robot, Limits((16.7,) * 3)), GAIT, NO_RAMP)

    assert trial.outcome is Outcome.FAULTED
    assert not robot.is_running


def test_circling_cuts_the_trial_short_and_it_counts_over_the_time_it_ran() -> None:
    robot = ScriptedRobot(at_s=1.0)
    robot.event = lambda: Pose(robot.t_s, (robot.x_m, 0.0, 0.0), yaw_rad=5.0 * (robot.t_s - robot.begin_s - 1.0))

    trial = run_trial(robot, GAIT, replace(NO_RAMP, heading_limit_rad=1.0))

    assert trial.outcome is Outcome.CUT_SHORT
    assert 1.2 < trial.duration_s < 1.6


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
    assert trial.reason.startswith("before the drive began: the robot is not in its arena: x = ")
    assert trial.reason.endswith(" m is outside 1 to 2 m; put the robot in the middle")
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

    robot = ScriptedRobot(at_s=0.0, event=lambda: seen.append(gc.isenabled()) if robot.is_running else None)
    run_trial(robot, GAIT, NO_RAMP)

    assert set(seen) == {False}
    assert gc.isenabled()


def test_start_and_end_are_averages_at_rest_and_say_how_sure_they_are() -> None:
    noise = itertools.cycle((0.0002, -0.0001, 0.0, 0.0001, -0.0002))
    robot = ScriptedRobot(at_s=-1e9, event=lambda: (robot.x_m + next(noise), 0.0, 0.0))

    trial = run_trial(robot, GAIT, NO_RAMP)

    assert trial.start is not None and trial.end is not None
    assert trial.start.position_m[0] == pytest.approx(0.0, abs=1e-4)
    assert trial.end.position_m[0] == pytest.approx(0.2, abs=1e-4)
    assert all(0.0 < (rest.position_sd_m or 0.0) < 2e-4 for rest in (trial.start, trial.end))


class AnotherClock(ScriptedRobot):
    """A robot whose tracker has a clock of its own."""

    def __init__(self, clock: RemoteClock) -> None:
        super().__init__()
        self._tracker = SimpleNamespace(pose=self.pose, clock=clock)

    @property
    def tracker(self) -> SimpleNamespace:  # type: ignore[override]
        return self._tracker


def test_a_trial_tells_how_the_trackers_clock_differs() -> None:
    clock = RemoteClock()
    for sent_s, received_s in ((0.0, 7.0), (1.0, 8.2)):
        clock.here_s(sent_s, received_s)

    conditions = run_trial(AnotherClock(clock), GAIT, NO_RAMP).conditions

    assert conditions.tracker_offset_s == pytest.approx(-7.0, abs=0.001)
    assert conditions.tracker_jitter_s == pytest.approx(0.1, abs=0.001)


def test_a_trackers_clock_that_begins_anew_as_a_trial_ends_does_not_cost_the_trial() -> None:
    class BeginsAnew(RemoteClock):
        """Its first time has come in, and is not among the delays yet."""

        offset_s = -7.0

    trial = run_trial(AnotherClock(BeginsAnew()), GAIT, NO_RAMP)

    assert (trial.outcome, trial.conditions.tracker_offset_s) == (Outcome.COMPLETED, None)


@pytest.mark.parametrize("x_m", [100.0, 0.4, 1e308, math.inf, math.nan])
def test_a_single_impossible_pose_is_dropped_and_counted(x_m: float) -> None:
    poses = itertools.count()
    robot = ScriptedRobot(at_s=0.5, event=lambda: (x_m, 0.0, 0.0) if next(poses) == 3 else None)

    trial = run_trial(robot, GAIT, NO_RAMP)

    assert trial.outcome is Outcome.COMPLETED
    assert trial.conditions.dropped_poses == 1
    assert score(trial) == pytest.approx(0.1)


@pytest.mark.parametrize("x_m", [100.0, 0.4, 1e308, math.inf, math.nan])
def test_impossible_poses_that_go_on_lose_the_tracker(x_m: float) -> None:
    robot = ScriptedRobot(at_s=0.5, event=lambda: (x_m, 0.0, 0.0))

    trial = run_trial(robot, GAIT, NO_RAMP)

    assert trial.outcome is Outcome.TRACKING_LOST
    assert "implausible" in trial.reason
    assert trial.duration_s < 1.0
    with pytest.raises(ValueError, match="no score"):
        score(trial)


def test_a_tracker_that_repeats_one_pose_while_motors_turn_is_lost() -> None:
    robot = ScriptedRobot(at_s=0.5, event=lambda: (0.05, 0.0, 0.0))

    trial = run_trial(robot, GAIT, NO_RAMP)

    assert trial.outcome is Outcome.TRACKING_LOST
    assert "to the last digit" in trial.reason


def test_a_robot_that_creeps_away_faster_than_any_robot_has_no_score() -> None:
    trial = run_trial(ScriptedRobot(speed_m_s_per_hz=1.0), GAIT, replace(NO_RAMP, plausibility=None))

    assert trial.outcome is Outcome.TRACKING_LOST
    assert "not plausible" in trial.reason
