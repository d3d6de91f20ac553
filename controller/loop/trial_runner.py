"""One trial: settle, ramp, drive, watch, stop. The same for a robot, a mock device and a twin."""

from __future__ import annotations

import gc
import logging
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace

from vvvaltr.controller.core.conditions import Conditions
from vvvaltr.controller.core.errors import DeviceError, DeviceTimeout, LinkLost, SafetyStop, TrackingLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Photographer, Robot, Tracker
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import Command, MotorState, Outcome, Photo, Pose, Trial
from vvvaltr.controller.loop.at_rest import average_at_rest
from vvvaltr.controller.loop.plausibility import Plausibility, PoseFilter
from vvvaltr.controller.loop.safety import Arena, Guard, HeadingGuard, make_arena_guard
from vvvaltr.controller.loop.scoring import implausibility
from vvvaltr.drivers.links.remote_clock import RemoteClock

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class TrialSettings:
    """Settings of a trial.

    Args:
        duration_s: time the motors are driven.
        settle_s: time the robot rests before the drive.
        ramp_s: time in which the frequencies rise to those of the gait; part of ``duration_s``.
        period_s: time between two commands, and between two readings of tracker and motors.
        hold_s: time a command stays in force; the motors stop by themselves if the next one is later.
        arena: rectangle that the robot may not leave; None for no limit.
        heading_limit_rad: greatest change of heading; None or infinite for no limit.
        rest_s: time the robot takes to come to rest after the drive; its end is measured then.
        rest_poses: number of poses that start and end are averages of; 0 for the first and the last pose of the drive.
        plausibility: limits of a plausible pose; None for any pose that is a number.
    """

    duration_s: float = 5.0
    settle_s: float = 0.3
    ramp_s: float = 0.2
    period_s: float = 0.05
    hold_s: float = 0.25
    arena: Arena | None = None
    heading_limit_rad: float | None = None
    rest_s: float = 0.25
    rest_poses: int = 5
    plausibility: Plausibility | None = field(default_factory=Plausibility)

    def guards(self) -> list[Guard]:
        """Return fresh guards for one trial."""
        guards: list[Guard] = []
        if self.arena is not None:
            guards.append(make_arena_guard(self.arena))
        if self.heading_limit_rad is not None and self.heading_limit_rad < math.inf:
            guards.append(HeadingGuard(self.heading_limit_rad))
        return guards


class TrialCrashed(Exception):
    """The program itself failed during a trial. ``trial`` is the record of it, ``__cause__`` the error."""

    def __init__(self, trial: Trial) -> None:
        super().__init__(trial.reason)
        self.trial = trial


def run_trial(robot: Robot, gait: Gait, settings: TrialSettings, number: int = 1) -> Trial:
    """Drive ``gait`` once and return what happened. The motors are stopped when this returns or raises.

    A failure of robot, link or tracker is an outcome of the trial. So is an interrupt by the operator,
    ``Outcome.INTERRUPTED``, after which the caller ends the run.

    Raises:
        TrialCrashed: the program failed; the exception holds the trial, which the caller records.
    """
    _LOG.debug("trial %d: %s for %g s", number, gait, settings.duration_s)
    watch = _Watch(robot, settings)
    started_unix_s = time.time()
    problem: Exception | KeyboardInterrupt | None = None
    try:
        with _no_garbage_collection(), _motors_stopped_after(robot):
            robot.place(number)
            watch.settle()
            problem = _drive(robot, gait, settings, watch)
        watch.come_to_rest()
    except (Exception, KeyboardInterrupt) as error:
        problem = error
    trial = Trial(
        number,
        gait,
        *_describe_ending(problem),
        started_unix_s,
        duration_s=watch.driven_s,
        poses=tuple(watch.poses),
        commands=tuple(watch.commands),
        states=tuple(watch.states),
        conditions=_describe_conditions(robot, watch.dropped_poses),
        start=watch.start,
        end=watch.end,
        photos=watch.take_photos(),
    )
    if reason := implausibility(trial):
        trial = replace(trial, outcome=Outcome.TRACKING_LOST, reason=reason)
    _LOG.info("trial %d: %s after %.2f s %s", number, trial.outcome, trial.duration_s, trial.reason)
    if trial.outcome is Outcome.CRASHED:
        raise TrialCrashed(trial) from problem
    return trial


def _describe_conditions(robot: Robot, dropped_poses: int) -> Conditions:
    """Return what can be told of a trial's conditions; trackers with a clock of their own know how late they are."""
    clock = getattr(robot.tracker, "clock", None)
    # The jitter first: the tracker's thread sets it last, and may have begun a new clock just now.
    if not isinstance(clock, RemoteClock) or math.isnan(jitter_s := clock.jitter_s):
        return Conditions(dropped_poses=dropped_poses)
    return Conditions(dropped_poses=dropped_poses, tracker_offset_s=clock.offset_s, tracker_jitter_s=jitter_s)


def _describe_ending(problem: Exception | KeyboardInterrupt | None) -> tuple[Outcome, str]:
    """Return the outcome that an error stands for, and the reason in words."""
    match problem:
        case None:
            return Outcome.COMPLETED, ""
        case SafetyStop(outcome=outcome, reason=reason):
            return outcome, reason
        case TrackingLost():
            return Outcome.TRACKING_LOST, str(problem)
        case LinkLost():
            return Outcome.LINK_LOST, str(problem)
        case DeviceError():
            return Outcome.FAULTED, str(problem)
        case KeyboardInterrupt():
            return Outcome.INTERRUPTED, str(problem) or "keyboard"
        case _:
            return Outcome.CRASHED, f"{type(problem).__name__}: {problem}"


def _drive(robot: Robot, gait: Gait, settings: TrialSettings, watch: _Watch) -> SafetyStop | None:
    """Drive for as long as asked; return the stop that cut the drive short but leaves it a measurement."""
    try:
        watch.begin()
        while (left_s := settings.duration_s - watch.elapsed_s()) > 1e-6:
            step_s = min(settings.period_s, left_s)
            ramp = (watch.elapsed_s() + step_s) / settings.ramp_s if settings.ramp_s > 0 else 1.0
            watch.command(gait.scaled(min(1.0, ramp)), settings.hold_s)
            robot.clock.sleep(step_s)
            watch.look()
    except SafetyStop as stop:
        if not stop.outcome.is_valid:
            raise
        return stop
    return None


class _Watch:
    """Sends commands, reads the robot, and keeps both, with times in seconds since the drive began."""

    def __init__(self, robot: Robot, settings: TrialSettings) -> None:
        self.driven_s = 0.0
        self.poses: list[Pose] = []
        self.commands: list[Command] = []
        self.states: list[MotorState] = []
        self.start: RestingPose | None = None
        self.end: RestingPose | None = None
        self._robot = robot
        self._settings = settings
        self._guards = settings.guards()
        self._filter = _make_filter(robot.tracker, settings.plausibility)
        self._begin_s = 0.0
        self._is_driving = False

    @property
    def dropped_poses(self) -> int:
        return self._filter.dropped if self._filter else 0

    def settle(self) -> None:
        """Let the robot come to rest before the drive, and see where it lies."""
        settings, clock = self._settings, self._robot.clock
        count = min(settings.rest_poses, int(settings.settle_s / settings.period_s + 1e-9))
        clock.sleep(settings.settle_s - count * settings.period_s)
        if count:
            poses = [self._next_pose() for _ in range(count)]
            self.start = self._filter.rest(poses) if self._filter else average_at_rest(poses)

    def begin(self) -> None:
        self._begin_s = self._robot.clock.now_s()
        if self._filter and self.start:
            self._filter.begin_at(self.start, 0.0)
        self._is_driving = True
        try:
            self._look_at_pose()
        except SafetyStop as stop:
            raise SafetyStop(Outcome.FAULTED, f"before the drive began: {stop.reason}") from stop

    def come_to_rest(self) -> None:
        """Let the robot run down after the drive, and see where it has come to lie."""
        self._is_driving = False
        if self._settings.rest_poses:
            self._robot.clock.sleep(self._settings.rest_s)
            poses = self._poses_at_rest(self._settings.rest_poses)
            self.end = self._filter.rest_after(poses, self.poses) if self._filter else average_at_rest(poses)

    def elapsed_s(self) -> float:
        return self._since_begin(self._robot.clock.now_s())

    def command(self, gait: Gait, hold_s: float) -> None:
        self._check_held()
        self.commands.append(Command(self.elapsed_s(), gait, hold_s))
        self._robot.motors.drive(gait, hold_s)

    def look(self) -> None:
        self._check_held()
        state = self._robot.motors.state()
        self.states.append(replace(state, t_s=self._since_begin(state.t_s)))
        self._look_at_pose()

    def take_photos(self) -> tuple[Photo, ...]:
        """Return the pictures of the drive, where the tracker keeps any."""
        tracker = self._robot.tracker
        taken = tracker.take_photos() if isinstance(tracker, Photographer) else ()
        photos = (replace(photo, t_s=self._since_begin(photo.t_s)) for photo in taken)
        return tuple(photo for photo in photos if photo.t_s >= 0.0)

    def _check_held(self) -> None:
        """Raise DeviceTimeout if the last command has run out: the motors stood still in the middle of the trial."""
        if self.commands and (late_s := self.elapsed_s() - self.commands[-1].t_s) > self.commands[-1].hold_s:
            raise DeviceTimeout(
                f"no command for {late_s:.2f} s, so the motors stopped: end other programs on this computer"
            )

    def _look_at_pose(self) -> None:
        pose = self._plausible_pose()
        # By the runner's clock: a tracker's poses are a little old, at the start as at the end.
        self.driven_s = self.elapsed_s()
        if pose is None:
            return
        self.poses.append(pose)
        for guard in self._guards:
            guard(pose)

    def _poses_at_rest(self, count: int) -> list[Pose]:
        """Return the plausible ones of ``count`` poses, one a period. Raises TrackingLost if there is none."""
        seen = []
        for _ in range(count):
            self._robot.clock.sleep(self._settings.period_s)
            if (pose := self._plausible_pose()) is not None:
                seen.append(pose)
        if not seen:
            raise TrackingLost("the tracker shows no plausible pose of the robot at rest; check what it sees")
        return seen

    def _next_pose(self) -> Pose:
        self._robot.clock.sleep(self._settings.period_s)
        return self._pose()

    def _plausible_pose(self) -> Pose | None:
        """Return the present pose; None if it cannot be the robot's. Raises TrackingLost if that goes on."""
        pose = self._pose()
        if self._filter is None:
            return pose
        turns = self._is_driving and bool(self.states) and any(map(abs, self.states[-1].frequency_hz))
        return pose if self._filter.accepts(pose, turns) else None

    def _pose(self) -> Pose:
        pose = self._robot.tracker.pose()
        if self._filter is None and not pose.is_finite:
            raise TrackingLost("the tracker reports a pose that is not a number; check its set-up")
        return replace(pose, t_s=self._since_begin(pose.t_s)) if math.isfinite(pose.t_s) else pose

    def _since_begin(self, t_s: float) -> float:
        # Whole microseconds: the clock's own start must not reach the score through rounding.
        return round(t_s - self._begin_s, 6)


def _make_filter(tracker: Tracker, limits: Plausibility | None) -> PoseFilter | None:
    """Return what judges the poses; a twin's tracker without noise may repeat a place as often as it likes."""
    if limits is not None and getattr(tracker, "is_exact", False):
        limits = replace(limits, frozen_s=math.inf)
    return PoseFilter(limits) if limits else None


@contextmanager
def _motors_stopped_after(robot: Robot) -> Iterator[None]:
    try:
        yield
    except BaseException:
        # A dead link must not hide why the trial ended; the device's own watchdog stops the motors then.
        with suppress(DeviceError):
            robot.motors.stop()
        raise
    robot.motors.stop()


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """Keep the collector, which can halt the program for 0.1 s, away while motors turn."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
