"""One trial: settle, ramp, drive, watch, stop. The same for a robot, a mock device and a twin."""

from __future__ import annotations

import gc
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace

from vvvaltr.controller.core.errors import DeviceError, DeviceTimeout, LinkLost, SafetyStop, TrackingLost
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.values import Command, Gait, MotorState, Outcome, Pose, Trial
from vvvaltr.controller.loop.safety import Arena, Guard, HeadingGuard, make_arena_guard

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
        heading_limit_rad: greatest change of heading; None for no limit.
    """

    duration_s: float = 5.0
    settle_s: float = 0.3
    ramp_s: float = 0.2
    period_s: float = 0.05
    hold_s: float = 0.25
    arena: Arena | None = None
    heading_limit_rad: float | None = 1.0

    def guards(self) -> list[Guard]:
        """Return fresh guards for one trial."""
        guards: list[Guard] = []
        if self.arena is not None:
            guards.append(make_arena_guard(self.arena))
        if self.heading_limit_rad is not None:
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
    watch = _Watch(robot, settings.guards())
    started_unix_s = time.time()
    problem: Exception | KeyboardInterrupt | None = None
    try:
        with _no_garbage_collection(), _motors_stopped_after(robot):
            robot.place(number)
            robot.clock.sleep(settings.settle_s)
            _drive(robot, gait, settings, watch)
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
    )
    _LOG.info("trial %d: %s after %.2f s %s", number, trial.outcome, trial.duration_s, trial.reason)
    if trial.outcome is Outcome.CRASHED:
        raise TrialCrashed(trial) from problem
    return trial


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


def _drive(robot: Robot, gait: Gait, settings: TrialSettings, watch: _Watch) -> None:
    watch.begin()
    while (left_s := settings.duration_s - watch.elapsed_s()) > 1e-6:
        step_s = min(settings.period_s, left_s)
        ramp = (watch.elapsed_s() + step_s) / settings.ramp_s if settings.ramp_s > 0 else 1.0
        watch.command(gait.scaled(min(1.0, ramp)), settings.hold_s)
        robot.clock.sleep(step_s)
        watch.look()


@dataclass(slots=True)
class _Watch:
    """Sends commands, reads the robot, and keeps both, with times in seconds since the drive began."""

    robot: Robot
    guards: list[Guard]
    begin_s: float = 0.0
    driven_s: float = 0.0
    poses: list[Pose] = field(default_factory=list)
    commands: list[Command] = field(default_factory=list)
    states: list[MotorState] = field(default_factory=list)

    def begin(self) -> None:
        self.begin_s = self.robot.clock.now_s()
        try:
            self._look_at_pose()
        except SafetyStop as stop:
            raise SafetyStop(Outcome.FAULTED, f"before the drive began: {stop.reason}") from stop

    def elapsed_s(self) -> float:
        return self._since_begin(self.robot.clock.now_s())

    def command(self, gait: Gait, hold_s: float) -> None:
        self._check_held()
        self.commands.append(Command(self.elapsed_s(), gait, hold_s))
        self.robot.motors.drive(gait, hold_s)

    def look(self) -> None:
        self._check_held()
        state = self.robot.motors.state()
        self.states.append(replace(state, t_s=self._since_begin(state.t_s)))
        self._look_at_pose()

    def _check_held(self) -> None:
        """Raise DeviceTimeout if the last command has run out: the motors stood still in the middle of the trial."""
        if self.commands and (late_s := self.elapsed_s() - self.commands[-1].t_s) > self.commands[-1].hold_s:
            raise DeviceTimeout(f"no command for {late_s:.2f} s, so the motors stopped; is the computer too busy?")

    def _look_at_pose(self) -> None:
        pose = self.robot.tracker.pose()
        if not pose.is_finite:
            raise TrackingLost("the tracker reports a pose that is not a number")
        pose = replace(pose, t_s=self._since_begin(pose.t_s))
        self.poses.append(pose)
        # By the runner's clock: a tracker's poses are a little old, at the start as at the end.
        self.driven_s = self.elapsed_s()
        for guard in self.guards:
            guard(pose)

    def _since_begin(self, t_s: float) -> float:
        # Whole microseconds: the clock's own start must not reach the score through rounding.
        return round(t_s - self.begin_s, 6)


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
