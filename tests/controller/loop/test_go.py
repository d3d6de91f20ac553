"""Going somewhere: reached, or given up with the reason; motors at rest after every ending."""

import math
import re
from dataclasses import replace

import pytest
from gliding import GAITS, SETTINGS, TABLE, GlidingRobot, tried

from vvvaltr.controller.core.errors import DeviceFault, TrackingLost
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Outcome, Pose
from vvvaltr.controller.loop.go import Ending, Journey
from vvvaltr.controller.loop.safety import Arena
from vvvaltr.controller.loop.steersman import Steersman
from vvvaltr.drivers.motor_line import LOW_SUPPLY
from vvvaltr.transfer.steering.planner import Border, Goal
from vvvaltr.transfer.steering.repertoire import Repertoire, learn_repertoire


@pytest.fixture(scope="module")
def repertoire() -> Repertoire:
    return learn_repertoire([tried(GlidingRobot(), 2)])


def sent(
    robot: GlidingRobot, repertoire: Repertoire, *goals: Goal, budget_s: float = 200.0, arena: Arena | None = None
) -> tuple[Ending, list[LoggedTrial]]:
    """Return how a robot that was sent somewhere ended, and what was recorded."""
    recorded: list[LoggedTrial] = []
    border = Border(arena.x_m, arena.y_m) if arena else None
    steersman = Steersman(repertoire, 1, border, SETTINGS.settle_s)
    journey = Journey(robot, steersman, goals, replace(SETTINGS, arena=arena), budget_s, recorded.append)
    yielded = list(journey.go())
    assert yielded == recorded
    assert not robot.is_running
    return journey.ending, recorded


@pytest.mark.parametrize("bearing_deg", range(0, 360, 60))
def test_a_goal_is_reached_from_wherever_it_lies(repertoire: Repertoire, bearing_deg: int) -> None:
    robot = GlidingRobot()
    goal = Goal(0.2 * math.cos(math.radians(bearing_deg)), 0.2 * math.sin(math.radians(bearing_deg)))

    ending, recorded = sent(robot, repertoire, goal)

    assert ending.reached
    assert ending.reason == ""
    assert ending.position_m == (robot.x_m, robot.y_m)
    assert ending.error_m == pytest.approx(math.hypot(robot.x_m - goal.x_m, robot.y_m - goal.y_m))
    assert ending.error_m <= 0.02
    assert ending.primitives == len(recorded)
    assert ending.duration_s == pytest.approx(sum(logged.trial.duration_s for logged in recorded))
    assert ending.duration_s < 60.0


def test_the_robot_is_never_put_back_on_its_way(repertoire: Repertoire) -> None:
    robot = GlidingRobot(x_m=0.3)

    ending, recorded = sent(robot, repertoire, Goal(0.45, 0.0))

    assert ending.reached
    assert recorded[0].trial.poses[0].position_m[0] == pytest.approx(0.3)
    assert robot.placed == [logged.trial.number for logged in recorded]


def test_a_goal_with_a_heading_is_reached_with_that_heading(repertoire: Repertoire) -> None:
    ending, _ = sent(GlidingRobot(), repertoire, Goal(0.1, 0.05, yaw_rad=-1.0))

    assert ending.reached
    assert ending.yaw_rad == pytest.approx(-1.0, abs=0.2)


def test_way_points_are_passed_in_their_order(repertoire: Repertoire) -> None:
    corners = (Goal(0.1, 0.0), Goal(0.1, 0.1), Goal(0.0, 0.1), Goal(0.0, 0.0))

    ending, recorded = sent(GlidingRobot(), repertoire, *corners)

    assert (ending.reached, ending.goals) == (True, 4)
    aims = [logged.steering.goal_m for logged in recorded if logged.steering]
    assert list(dict.fromkeys(aims)) == [(goal.x_m, goal.y_m) for goal in corners]


def test_a_robot_on_a_slope_gets_there_all_the_same(repertoire: Repertoire) -> None:
    assert sent(GlidingRobot(drift_m_s=(-0.008, 0.002)), repertoire, Goal(0.2, 0.1))[0].reached


def test_a_damaged_robot_finds_its_way_while_going(repertoire: Repertoire) -> None:
    damaged = {gait: (-v[1], 0.7 * v[0], -v[2]) for gait, v in TABLE.items()}

    assert sent(GlidingRobot(damaged), repertoire, Goal(0.2, 0.1))[0].reached


def test_every_primitive_says_where_it_was_to_lead(repertoire: Repertoire) -> None:
    _, recorded = sent(GlidingRobot(), repertoire, Goal(0.15, 0.0))

    step = recorded[0].steering
    assert step is not None
    assert step.goal_m == (0.15, 0.0)
    assert step.plan[0] == recorded[0].trial.gait
    assert 0.02 < step.predicted.forward_m < 0.2
    assert recorded[0].movement is not None


def test_a_robot_that_does_not_move_is_stuck(repertoire: Repertoire) -> None:
    ending, _ = sent(GlidingRobot(dict.fromkeys(GAITS, (1e-4, 0.0, 0.0))), repertoire, Goal(0.2, 0.0))

    assert not ending.reached
    assert ending.reason.startswith("stuck")
    assert ending.duration_s < 90.0


def test_the_time_is_kept(repertoire: Repertoire) -> None:
    slowed = {gait: (0.5 * forward, 0.5 * left, turn) for gait, (forward, left, turn) in TABLE.items()}

    ending, _ = sent(GlidingRobot(slowed), repertoire, Goal(0.35, 0.0), budget_s=20.0)

    assert not ending.reached
    assert ending.reason.startswith("not there after 20 s")
    assert 20.0 <= ending.duration_s < 21.1


@pytest.mark.parametrize("goals", [[Goal(9.0, 0.0)], [Goal(0.1, 0.0), Goal(0.1, 9.0)]])
def test_a_goal_too_far_for_the_time_is_told_before_a_motor_turns(repertoire: Repertoire, goals: list[Goal]) -> None:
    ending, recorded = sent(GlidingRobot(), repertoire, *goals)

    assert not ending.reached
    assert recorded == []
    assert re.fullmatch(
        r"\S+ \S+ is 9 m away, 4\d\d s of driving at the [12]\d mm/s of the fastest movement, and 200 s are allowed; "
        "allow more by --time",
        ending.reason,
    )


def test_movements_that_lead_nowhere_but_away_are_given_up_before_they_have_led_far() -> None:
    away = {gait: (-0.02 + 0.001 * number, 0.0, 0.0) for number, gait in enumerate(GAITS)}

    ending, _ = sent(GlidingRobot(away), learn_repertoire([tried(GlidingRobot(away), 2)]), Goal(0.3, 0.0))

    assert ending.reason.startswith("no movement of the repertoire brings the robot nearer")
    assert ending.error_m < 0.3 + 4.0 * 3.3 * 0.02


def test_a_robot_that_can_only_leave_the_arena_gives_up(repertoire: Repertoire) -> None:
    tiny = Arena((-0.001, 0.001), (-0.001, 0.001))

    ending, recorded = sent(GlidingRobot(), repertoire, Goal(0.0009, 0.0009, 0.0001), arena=tiny)

    assert ending.reason.startswith("no movement")
    assert recorded == []


def test_the_arenas_guard_holds_on_the_way(repertoire: Repertoire) -> None:
    arena = Arena((-0.1, 0.1), (-0.1, 0.1))
    pushed = GlidingRobot(drift_m_s=(0.12, 0.0))  # off to where no plan expected it

    ending, recorded = sent(pushed, repertoire, Goal(-0.08, 0.0), arena=arena, budget_s=60.0)

    assert not ending.reached
    assert any("left the arena" in logged.trial.reason for logged in recorded)


@pytest.mark.parametrize(
    ("error", "outcome"),
    [
        (TrackingLost("no pose for 0.3 s"), Outcome.TRACKING_LOST),
        (DeviceFault("7", "motor 2 stalled"), Outcome.FAULTED),
    ],
)
def test_what_keeps_failing_ends_the_way_with_its_reason(
    repertoire: Repertoire, error: Exception, outcome: Outcome
) -> None:
    def fail(robot: GlidingRobot) -> None:
        if robot.t_s > 4.0 and robot.is_running:
            raise error

    ending, recorded = sent(GlidingRobot(watch=fail), repertoire, Goal(0.3, 0.2))

    assert not ending.reached
    assert str(error) in ending.reason
    assert [logged.trial.outcome for logged in recorded[-3:]] == [outcome] * 3


def test_a_flat_battery_ends_the_way_at_once(repertoire: Repertoire) -> None:
    def run_down(robot: GlidingRobot) -> None:
        if robot.t_s > 4.0 and robot.is_running:
            raise DeviceFault("7", f"motor 2: {LOW_SUPPLY}; charge the battery")

    ending, recorded = sent(GlidingRobot(watch=run_down), repertoire, Goal(0.3, 0.2))

    assert ending.reason == f"battery: motor 2: {LOW_SUPPLY}; charge the battery"
    assert [logged.trial.outcome.is_valid for logged in recorded[-2:]] == [True, False]


def test_a_robot_that_has_become_weak_on_the_way_says_so(repertoire: Repertoire) -> None:
    def weaken(robot: GlidingRobot) -> None:
        share = 1.0 if robot.t_s < 60.0 else 0.3
        robot.table = {gait: (share * v[0], share * v[1], share * v[2]) for gait, v in TABLE.items()}

    ending, _ = sent(GlidingRobot(watch=weaken), repertoire, Goal(3.0, 0.0), budget_s=160.0)

    assert ending.reason.startswith("not there after 160 s")
    assert "the robot moves 0.3" in ending.reason
    assert "battery" in ending.reason


class WithoutHeading(GlidingRobot):
    """A robot whose tracker sees one point."""

    def pose(self) -> Pose:
        return replace(super().pose(), yaw_rad=0.0)


def test_a_tracker_without_a_heading_is_told_after_the_first_primitive(repertoire: Repertoire) -> None:
    ending, recorded = sent(WithoutHeading(), repertoire, Goal(0.3, 0.2))

    assert len(recorded) == 1
    assert ending.reason.startswith("the tracker tells no heading: ")


class Unseen(GlidingRobot):
    """A robot whose tracker shows zeros once it has stopped for the first time, as of a body that it does not see."""

    has_driven = False

    def pose(self) -> Pose:
        self.has_driven = self.has_driven or self.is_running
        return Pose(self.t_s, (0.0, 0.0, 0.0)) if self.has_driven and not self.is_running else super().pose()


def test_a_pose_to_which_the_robot_cannot_have_come_does_not_reach_a_goal(repertoire: Repertoire) -> None:
    ending, _ = sent(Unseen(x_m=0.3, y_m=0.1), repertoire, Goal(0.0, 0.0))

    assert not ending.reached
    assert ending.reason.startswith("the tracker has lost the robot")
    assert math.hypot(*ending.position_m) > 0.2


def test_a_heading_to_which_the_robot_cannot_have_turned_at_rest_is_not_taken(repertoire: Repertoire) -> None:
    robot = GlidingRobot(t_s=900.0, x_m=0.2)
    journey = Journey(robot, Steersman(repertoire, 1, None, 0.3), [Goal(0.0, 0.0)], SETTINGS, 9.0, lambda logged: None)
    driven = Pose(4.0, (0.2, 0.0, 0.0), 3.0)  # since the drive began

    with pytest.raises(TrackingLost, match="at rest it was shown 0 m away, turned by 3 rad"):
        journey._pose_near(driven)
    assert journey._pose_near(replace(driven, yaw_rad=0.3)) == robot.pose()


def test_an_interrupt_is_recorded_and_ends_the_way(repertoire: Repertoire) -> None:
    def interrupt(robot: GlidingRobot) -> None:
        if robot.t_s > 2.0:
            raise KeyboardInterrupt("SIGINT")

    robot, recorded = GlidingRobot(watch=interrupt), []
    steersman = Steersman(repertoire, 1, None, SETTINGS.settle_s)
    journey = Journey(robot, steersman, [Goal(0.3, 0.2)], SETTINGS, 200.0, recorded.append)

    with pytest.raises(KeyboardInterrupt, match="SIGINT"):
        list(journey.go())

    assert recorded[-1].trial.outcome is Outcome.INTERRUPTED
    assert not robot.is_running


def test_gaits_of_the_repertoire_alone_are_driven(repertoire: Repertoire) -> None:
    _, recorded = sent(GlidingRobot(), repertoire, Goal(0.2, -0.1))

    assert {logged.trial.gait for logged in recorded} <= set(GAITS)


def test_a_floor_that_carries_the_robot_away_faster_than_it_walks_is_given_up(repertoire: Repertoire) -> None:
    ending, _ = sent(GlidingRobot(drift_m_s=(-0.06, 0.0)), repertoire, Goal(0.3, 0.0))

    assert not ending.reached
    assert ending.reason.startswith("no movement")
    assert ending.duration_s < 60.0
