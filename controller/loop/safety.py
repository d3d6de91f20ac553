"""Bounds for motors, robot and measurement: limits on every command, guards on every pose."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from vvvaltr.controller.core.errors import DeviceError, SafetyStop
from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.protocols import Clock, MotorDriver, Parkable, Robot, Tracker
from vvvaltr.controller.core.values import MotorState, Outcome, Pose, Structure

_RUNAWAY = 1.25  # applied over allowed frequency, above which a motor has run away
_SOON_S = 0.7  # a trial that ends earlier has measured only the tracker's noise


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a command to the motors.

    Args:
        max_hz: (motors,) greatest frequency of each motor, in both senses of rotation.
        max_hold_s: longest time that one command may stay in force.
    """

    max_hz: tuple[float, ...]
    max_hold_s: float = 1.0

    def check(self, gait: Gait) -> None:
        """Raise ValueError, naming the motor and the limit, if ``gait`` is outside."""
        if gait.motor_count != len(self.max_hz):
            raise ValueError(f"{gait.motor_count} frequencies given, but the robot has {len(self.max_hz)} motors")
        for motor, (frequency, limit) in enumerate(zip(gait.frequency_hz, self.max_hz, strict=True), start=1):
            if abs(frequency) > limit + 1e-9:
                raise ValueError(f"motor {motor}: {frequency:g} Hz is outside its limits of -{limit:g} to {limit:g} Hz")


class GuardedMotors:
    """A motor driver that refuses what is outside its limits, and never changes a command silently.

    Number of motors, frequencies, quantities and hold are checked here alone. What is below takes them as checked, and
    refuses only what its device cannot encode.
    """

    def __init__(self, driver: MotorDriver, limits: Limits) -> None:
        self._driver = driver
        self._limits = limits

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return self._driver.motor_count

    @property
    def quantities(self) -> frozenset[Quantity]:
        """What of a gait the device can apply."""
        return self._driver.quantities

    def drive(self, gait: Gait, hold_s: float) -> None:
        """Pass the command on. Raises ValueError, with nothing sent, if it is outside the limits."""
        self._limits.check(gait)
        self._check_quantities(gait)
        if not 0.0 < hold_s <= self._limits.max_hold_s:
            raise ValueError(f"hold_s {hold_s:g} is outside 0 to {self._limits.max_hold_s:g} s")
        self._driver.drive(gait, hold_s)

    def _check_quantities(self, gait: Gait) -> None:
        if Quantity.PHASE not in self.quantities and any(gait.phase_rad):
            raise ValueError("the motors cannot set phases; search frequencies only")
        if Quantity.AMPLITUDE not in self.quantities and any(share != 1.0 for share in gait.amplitude):
            raise ValueError("the motors cannot set amplitudes; search frequencies only")

    def state(self) -> MotorState:
        """Return what the device applies. Raises SafetyStop if that is not a number or a motor has run away."""
        state = self._driver.state()
        for motor, (applied, limit) in enumerate(zip(state.frequency_hz, self._limits.max_hz, strict=True), start=1):
            if not abs(applied) <= _RUNAWAY * limit:
                raise SafetyStop(Outcome.FAULTED, f"motor {motor} reports {applied:g} Hz with a limit of {limit:g} Hz")
        return state

    def stop(self) -> None:
        """Stop all motors."""
        self._driver.stop()

    def close(self) -> None:
        """Stop, then close the line."""
        self._driver.close()


class GuardedRobot:
    """A robot whose motors are accessible only through their guard."""

    def __init__(self, robot: Robot, limits: Limits) -> None:
        self._robot = robot
        self.limits = limits
        self.motors: MotorDriver = GuardedMotors(robot.motors, limits)

    @property
    def tracker(self) -> Tracker:
        """The tracker."""
        return self._robot.tracker

    @property
    def clock(self) -> Clock:
        """The clock."""
        return self._robot.clock

    @property
    def structure(self) -> Structure | None:
        """How to draw the robot."""
        return self._robot.structure

    def place(self, trial: int) -> None:
        """Make the robot ready for a trial."""
        self._robot.place(trial)

    def carry_on(self, trial: int) -> None:
        """Make the robot ready for a trial that begins where it is."""
        self._robot.carry_on(trial)

    def park(self) -> None:
        """Stop the motors, and let go of their lines where the robot has any.

        A device that has failed, which may be what the pause is for, is opened again by ``place``.
        """
        with suppress(DeviceError):
            self._robot.motors.stop()
        if isinstance(self._robot, Parkable):
            self._robot.park()

    def close(self) -> None:
        """Stop the motors and close all devices."""
        self._robot.close()


@dataclass(frozen=True, slots=True)
class Arena:
    """The rectangle on the ground that the robot may not leave."""

    x_m: tuple[float, float]
    y_m: tuple[float, float]


Guard = Callable[[Pose], None]
"""Checks every pose of a trial, and raises SafetyStop to end it."""


def make_arena_guard(arena: Arena) -> Guard:
    """Return a guard that ends the trial when the robot leaves the arena."""

    def check(pose: Pose) -> None:
        for axis, value, (low, high) in zip("xy", pose.position_m, (arena.x_m, arena.y_m), strict=False):
            if not low <= value <= high:
                place = f"{axis} = {value:.3f} m is outside {low:g} to {high:g} m"
                cure = "put the robot in the middle"
                if pose.t_s <= 0.0:
                    raise SafetyStop(Outcome.FAULTED, f"the robot is not in its arena: {place}; {cure}")
                if pose.t_s < _SOON_S:
                    raise SafetyStop(Outcome.FAULTED, f"left the arena: {place} after {pose.t_s:.2f} s; {cure}")
                raise SafetyStop(Outcome.CUT_SHORT, f"left the arena: {place}")

    return check


class HeadingGuard:
    """Ends a trial in which the robot turns too far, by the rule of the published experiments.

    The trial ends when the heading is more than ``limit_rad`` from where it began in ``checks`` checks in a row, one
    check every ``period_s`` (1 rad, 3 checks, 0.1 s).
    """

    def __init__(self, limit_rad: float = 1.0, checks: int = 3, period_s: float = 0.1) -> None:
        self._limit_rad = limit_rad
        self._checks = checks
        self._period_s = period_s
        self._start_rad: float | None = None
        self._next_s = -math.inf
        self._turned = 0

    def __call__(self, pose: Pose) -> None:
        """Look at one pose. Raises SafetyStop."""
        if self._start_rad is None:
            self._start_rad = pose.yaw_rad
        if pose.t_s < self._next_s - 1e-6:
            return
        self._next_s = pose.t_s + self._period_s
        turn_rad = math.remainder(pose.yaw_rad - self._start_rad, math.tau)
        self._turned = self._turned + 1 if abs(turn_rad) > self._limit_rad else 0
        if self._turned >= self._checks:
            limit = f"further than the heading limit of {self._limit_rad:g} rad"
            raise SafetyStop(Outcome.CUT_SHORT, f"turned by {turn_rad:+.2f} rad, {limit}")
