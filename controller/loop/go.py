"""Going somewhere: choose a movement, drive it, learn from it, choose again. Each primitive is a trial."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.records import Displacement, LoggedTrial, SteeringStep
from vvvaltr.controller.core.values import Outcome, Pose, Suggestion, Trial
from vvvaltr.controller.loop.causes import describe_loss, find_loss_in
from vvvaltr.controller.loop.movement import NO_HEADING, complete_record, lacks_heading
from vvvaltr.controller.loop.plausibility import PoseFilter
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.staying import Staying
from vvvaltr.controller.loop.steersman import Onward, Steersman, Watch, primitive_settings
from vvvaltr.controller.loop.thinking import AtOnce, Thinking
from vvvaltr.controller.loop.trial_runner import TrialCrashed, TrialSettings, run_trial
from vvvaltr.drivers.motor_line import LOW_SUPPLY
from vvvaltr.transfer.steering.passage import rotation, where
from vvvaltr.transfer.steering.planner import Goal, Plan

ORIGIN = "going"
"""Origin of the suggestions that lead somewhere."""

_LONGEST_S, _SHORTEST_S = 12.0, 1.0  # of a primitive, of which the last one ends with the time that is allowed
_HOPELESS_S = 3.2  # of a primitive that is not expected to help: long enough to be learned from, and no long way off
_FAILURES_IN_A_ROW = 3  # failed primitives in a row after which somebody has to look at the robot
_USELESS_IN_A_ROW = 5  # plans, each with other hopes of what is not known
_GAIN = 0.1  # of the tolerance, by which a plan must bring the robot nearer
_STUCK_M, _STUCK_RAD, _STUCK_S = 0.008, 0.15, 40.0


@dataclass(frozen=True, slots=True)
class Ending:
    """How going somewhere ended.

    Args:
        reached: whether the robot rests near enough to the last goal.
        reason: why it was given up; empty where it was reached.
        position_m: x and y where it rests; NaN, as what follows from it, where it was never seen.
        yaw_rad: its heading there.
        error_m: distance from the last goal.
        duration_s: time the motors were driven.
        primitives: how many movements.
        goals: how many goals were reached.
    """

    reached: bool
    reason: str
    position_m: tuple[float, float]
    yaw_rad: float
    error_m: float
    duration_s: float
    primitives: int
    goals: int


class Journey:
    """A robot on its way along goals.

    Args:
        robot: with guarded motors.
        steersman: chooses the movements.
        goals: in their order.
        settings: how a primitive is run; its duration is the longest one.
        budget_s: driving time that each goal may take.
        record: keeps a primitive for good before the next begins.
        thinking: where plans are made while the motors turn; None for at once, as on a twin.
    """

    def __init__(
        self,
        robot: Robot,
        steersman: Steersman,
        goals: Sequence[Goal],
        settings: TrialSettings,
        budget_s: float,
        record: Callable[[LoggedTrial], None],
        thinking: Thinking[Onward] | None = None,
    ) -> None:
        self._robot: Robot = Staying(robot)
        self._thinking: Thinking[Onward] = thinking or AtOnce()
        self._steersman, self._goals, self._settings = steersman, tuple(goals), settings
        self._budget_s, self._record = budget_s, record
        self.trials: list[LoggedTrial] = []
        self._reached = 0
        self._spent_s = 0.0
        self._failures = self._useless = 0
        self._reason = ""
        self._last = Pose(0.0, (math.nan,) * 3, math.nan)

    def watch(self, put_around: Callable[[Robot], Robot]) -> None:
        """Put something around the robot that follows it during each primitive."""
        self._robot = put_around(self._robot)

    def go(self, first: int = 1) -> Iterator[LoggedTrial]:
        """Drive, from where the robot is; yields each primitive once it is recorded.

        Args:
            first: number of the first primitive.

        Raises:
            KeyboardInterrupt: the operator interrupted a primitive; it has been recorded.
            TrackingLost: the robot cannot be seen at the start.
            TrialCrashed: the program failed during a primitive; it has been recorded.
        """
        self._last = self._robot.tracker.pose()
        if not self.trials:
            self._reason = self._too_far()
        for number in count(first):
            if self._is_over():
                return
            logged = self._primitive(number)
            if logged is None:
                return
            yield logged

    def remember(self, trials: Sequence[LoggedTrial]) -> None:
        """Take in the primitives that the run already has."""
        for logged in trials:
            self.trials.append(logged)
            self._steersman.learn(logged.trial)
            self._spent_s += logged.trial.duration_s
            if logged.trial.poses:
                self._last = logged.trial.poses[-1]
            self._pass_goals()

    @property
    def ending(self) -> Ending:
        """How it ended."""
        goal = self._goals[min(self._reached, len(self._goals) - 1)]
        x_m, y_m, _ = self._last.position_m
        error_m = float(goal.distance_m(x_m, y_m))
        driven_s = sum(logged.trial.duration_s for logged in self.trials)
        reached = self._reached == len(self._goals)
        yaw = self._last.yaw_rad
        return Ending(reached, self._reason, (x_m, y_m), yaw, error_m, driven_s, len(self.trials), self._reached)

    def _pass_goals(self) -> None:
        while self._reached < len(self._goals) and self._goals[self._reached].is_reached(where(self._last)):
            self._reached += 1
            self._spent_s = 0.0

    def _is_over(self) -> bool:
        self._pass_goals()
        if self._reached == len(self._goals) or self._reason:
            return True
        if self._spent_s >= self._budget_s:
            self._give_up(f"not there after {self._budget_s:g} s of driving; allow more by --time")
        elif self._is_stuck():
            self._give_up(
                f"stuck: the robot has moved by less than {1000 * _STUCK_M:g} mm in {_STUCK_S:g} s of driving; "
                "see what holds it, and whether its motors turn"
            )
        return bool(self._reason)

    def _too_far(self) -> str:
        """Return which goal is too far for the time that is allowed, however well all goes; empty if none is."""
        fastest_m_s = self._steersman.fastest_m_s
        x_m, y_m, _ = self._last.position_m
        for goal in self._goals:
            needed_m = float(goal.distance_m(x_m, y_m)) - goal.within_m
            if fastest_m_s > 0.0 and needed_m > fastest_m_s * self._budget_s:
                needed_s = math.ceil(needed_m / fastest_m_s)
                return (
                    f"{goal.x_m:g} {goal.y_m:g} is {needed_m:.2g} m away, {needed_s} s of driving at "
                    f"the {1000.0 * fastest_m_s:.0f} mm/s of the fastest movement, and {self._budget_s:g} s are "
                    "allowed; allow more by --time"
                )
            x_m, y_m = goal.x_m, goal.y_m
        return ""

    def _give_up(self, reason: str) -> None:
        """End with a reason, and with what the trials say of a battery that ran down."""
        loss = find_loss_in(self.trials)
        self._reason = f"{reason}; {describe_loss(*loss)}" if loss else reason

    def _primitive(self, number: int) -> LoggedTrial | None:
        goal = self._goals[self._reached]
        self._steersman.begin(number)
        way = self._steersman.plan(where(self._last), goal)
        self._useless = 0 if self._helps(way, goal) else self._useless + 1
        if not way.steps or self._useless >= _USELESS_IN_A_ROW:
            self._give_up("no movement of the repertoire brings the robot nearer; try more gaits by vvvaltr repertoire")
            return None
        movement, _ = way.steps[0]
        gait = self._steersman.gaits[movement]
        watch = Watch(self._steersman, self._thinking, movement, goal, way, where(self._last))
        longest_s = _HOPELESS_S if self._useless else _LONGEST_S
        longest_s = min(longest_s, max(_SHORTEST_S, self._budget_s - self._spent_s))
        suggestion, step = Suggestion(gait, ORIGIN), self._step(goal, way)
        try:
            trial = run_trial(self._robot, gait, primitive_settings(self._settings, longest_s, watch), number)
        except TrialCrashed as crash:
            self._record(LoggedTrial(suggestion, crash.trial, None, None, steering=step))
            raise
        speed_m_s = score(trial) if trial.outcome.is_valid else None
        logged = replace(complete_record(suggestion, trial, speed_m_s), steering=step)
        self._record(logged)
        self._take(logged)
        return logged

    def _helps(self, way: Plan, goal: Goal) -> bool:
        """Whether a plan ends nearer to the goal, or nearer to its heading, than the robot is now."""
        if not way.steps:
            return False
        x_m, y_m, yaw_rad = way.poses[-1]
        now = where(self._last)
        gained_m = float(goal.distance_m(now[0], now[1]) - goal.distance_m(x_m, y_m))
        gained_rad = float(goal.turn_rad(now[2]) - goal.turn_rad(yaw_rad))
        return gained_m > _GAIN * goal.within_m or gained_rad > _GAIN * goal.within_rad

    def _step(self, goal: Goal, way: Plan) -> SteeringStep:
        """Return for the log why the first movement of a plan is driven."""
        moved = rotation(self._last.yaw_rad).T @ (way.poses[0, :2] - where(self._last)[:2])
        turn_rad = float(way.poses[0, 2]) - self._last.yaw_rad
        return SteeringStep(
            (goal.x_m, goal.y_m),
            goal.yaw_rad,
            Displacement(float(moved[0]), float(moved[1]), turn_rad),
            float(way.spreads_m[0]),
            plan=tuple(self._steersman.gaits[movement] for movement, _ in way.steps),
        )

    def _take(self, logged: LoggedTrial) -> None:
        trial = logged.trial
        self.trials.append(logged)
        self._spent_s += trial.duration_s
        if trial.outcome is Outcome.INTERRUPTED:
            raise KeyboardInterrupt(trial.reason)
        self._failures = 0 if trial.outcome.is_valid else self._failures + 1
        if trial.outcome is Outcome.FAULTED and LOW_SUPPLY in trial.reason:
            self._reason = f"battery: {trial.reason}"
        elif self._steersman.turns and lacks_heading(trial):
            self._reason = NO_HEADING
        elif self._failures >= _FAILURES_IN_A_ROW:
            self._reason = f"{self._failures} primitives in a row failed; the last one: {trial.ending}"
        self._steersman.learn(trial)
        try:
            self._see(trial)
        except TrackingLost as lost:
            self._last = trial.poses[-1] if trial.outcome.is_valid else self._last
            self._failures += 1
            if self._failures >= _FAILURES_IN_A_ROW:
                self._reason = f"the tracker has lost the robot: {lost}"

    def _see(self, trial: Trial) -> None:
        """See where a drive has led. Raises TrackingLost where nothing is seen that can be the robot."""
        if trial.poses:
            self._check_near(self._last, trial.poses[0])
        self._last = self._pose_near(trial.poses[-1] if trial.poses else self._last)
        if self._goals[self._reached].is_reached(where(self._last)):
            self._robot.clock.sleep(self._settings.rest_s)
            self._last = self._pose_near(self._last)

    def _pose_near(self, before: Pose) -> Pose:
        pose = self._robot.tracker.pose()
        self._check_near(before, pose)
        return pose

    def _check_near(self, before: Pose, pose: Pose) -> None:
        """Raise TrackingLost if a robot at rest cannot have come from one pose to the other.

        Their times do not count: those of a trial's poses begin with its drive.
        """
        if (limits := self._settings.plausibility) is not None:
            seen = PoseFilter(limits)
            seen.accepts(replace(before, t_s=pose.t_s - self._settings.rest_s), motors_turn=False)
            if not seen.accepts(pose, motors_turn=False):
                away_m = math.dist(pose.position_m, before.position_m)
                turned_rad = abs(math.remainder(pose.yaw_rad - before.yaw_rad, math.tau))
                raise TrackingLost(f"at rest it was shown {away_m:.2g} m away, turned by {turned_rad:.2g} rad")

    def _is_stuck(self) -> bool:
        recent, driven_s = [], 0.0
        for logged in reversed(self.trials):
            recent.append(logged.trial)
            driven_s += logged.trial.duration_s
            if driven_s >= _STUCK_S:
                break
        if driven_s < _STUCK_S:
            return False
        path = np.array([where(pose) for trial in recent for pose in trial.poses])
        return bool((np.ptp(path[:, :2], axis=0) < _STUCK_M).all() and np.ptp(path[:, 2]) < _STUCK_RAD)
