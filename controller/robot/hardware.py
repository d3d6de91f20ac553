"""A robot of real motors, put together from its file: lines, tracker, wall clock."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from functools import partial

from vvvaltr.controller.core.clock import WallClock
from vvvaltr.controller.core.errors import DeviceError, TrackingLost
from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState, Pose, Structure
from vvvaltr.controller.robot.robot_file import RobotFile
from vvvaltr.drivers.held_motors import HeldMotors
from vvvaltr.drivers.registry import open_line
from vvvaltr.drivers.table import LineTable
from vvvaltr.drivers.trackers.registry import PoseTracker, open_tracker

_GREETING_S, _LOOK_S = 2.0, 0.02
_RETURN_S = 10.0  # time for a device to restart, or for a person to plug it in again
_SWITCH_S = 1e-4  # how long another thread may hold the interpreter before an I/O thread gets it


def open_hardware(robot: RobotFile) -> HardwareRobot:
    """Open all lines and the tracker of ``robot``.

    Raises:
        DeviceError: a device does not answer as it should.
        TrackingLost: no pose comes from the tracker.
        ValueError: the tracker's address cannot be used.
        UserError: a motor is not calibrated, or what the tracker needs is not installed.
    """
    # The I/O threads must never wait long: neither for other threads nor for garbage collection of permanent objects.
    sys.setswitchinterval(_SWITCH_S)
    gc.freeze()
    with ExitStack() as opened:
        lines = []
        for line in robot.line:
            lines.append(open_motors(line))
            opened.callback(lines[-1].close)
        tracker = open_tracker(robot.tracker)
        opened.callback(tracker.close)
        hardware = HardwareRobot(JoinedMotors(lines), tracker, _structure(robot.body))
        hardware.find(_GREETING_S)
        opened.pop_all()
    return hardware


def open_motors(line: LineTable) -> HeldMotors:
    """Open one line. Raises as ``open_hardware`` does."""
    return HeldMotors(partial(open_line, line), ramp_hz_s=tuple(motor.ramp_hz_s for motor in line.motor))


class JoinedMotors:
    """The motors of several lines in one order: satisfies ``MotorDriver``."""

    def __init__(self, lines: Sequence[HeldMotors]) -> None:
        self._lines = tuple(lines)

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return sum(line.motor_count for line in self._lines)

    @property
    def quantities(self) -> frozenset[Quantity]:
        """What all lines can apply."""
        return frozenset.intersection(*(line.quantities for line in self._lines))

    @property
    def settle_s(self) -> float:
        """How long a motor takes, on the slowest line, until its measured frequency is that of the set-point."""
        return max(line.settle_s for line in self._lines)

    def ramp_s(self, gait: Gait) -> float:
        """Return how long the set-points take from rest to ``gait``, on the slowest line."""
        return max(line.ramp_s(share) for line, share in zip(self._lines, self._shares(gait), strict=True))

    def drive(self, gait: Gait, hold_s: float) -> None:
        """Send each line its part, once all lines can apply theirs. Raises as ``MotorDriver.drive`` does."""
        shares = self._shares(gait)
        for line, share in zip(self._lines, shares, strict=True):
            line.check(share)
        for line, share in zip(self._lines, shares, strict=True):
            line.drive(share, hold_s)

    def state(self) -> MotorState:
        """Return what all devices apply, with the time of the oldest news."""
        states = [line.state() for line in self._lines]
        return MotorState(
            min(state.t_s for state in states),
            tuple(hz for state in states for hz in state.frequency_hz),
            all(state.measured for state in states),
            tuple(a for state in states for a in state.current_a) if all(s.current_a for s in states) else (),
            tuple(c for state in states for c in state.temperature_c) if all(s.temperature_c for s in states) else (),
        )

    def stop(self) -> None:
        """Stop the motors of all lines, even if one line is lost. Raises the first DeviceError afterwards."""
        # All lines are sent the stop before any device's answer is awaited.
        problems = []
        for act in (HeldMotors.send_stop, HeldMotors.await_message):
            for line in self._lines:
                try:
                    act(line)
                except DeviceError as error:
                    problems.append(error)
        if problems:
            raise problems[0]

    def ready(self, patience_s: float) -> None:
        """Open every line again that had a fault. For use between trials only. Raises DeviceError."""
        for line in self._lines:
            line.ready(patience_s)

    def park(self) -> None:
        """Stop the motors and release all lines, until ``ready`` opens them again."""
        for line in self._lines:
            line.park()

    def close(self) -> None:
        """Stop, then release all lines."""
        for line in self._lines:
            with suppress(DeviceError):
                line.send_stop()
        for line in self._lines:
            line.close()

    def _shares(self, gait: Gait) -> list[Gait]:
        shares, first = [], 0
        for line in self._lines:
            span = slice(first, first := first + line.motor_count)
            shares.append(Gait(gait.frequency_hz[span], gait.phase_rad[span], gait.amplitude[span]))
        return shares


class HardwareRobot:
    """Real motors and a real tracker: satisfies ``Robot``."""

    def __init__(self, motors: JoinedMotors, tracker: PoseTracker, structure: Structure | None) -> None:
        self.motors = motors
        self.tracker = tracker
        self.clock = WallClock()
        self.structure = structure

    def place(self, trial: int) -> None:
        """Open a lost line again, clear faults and find the robot, which is where the last trial left it.

        Raises:
            DeviceError: a device does not come back.
            TrackingLost: the tracker does not see the robot again.
        """
        self.motors.ready(_RETURN_S)
        self.find(_RETURN_S)

    def carry_on(self, trial: int) -> None:
        """Do as ``place`` does: nobody moves the robot between trials."""
        self.place(trial)

    def park(self) -> None:
        """Stop the motors and release their lines, until ``place`` opens them again."""
        self.motors.park()

    def find(self, patience_s: float) -> Pose:
        """Return where the robot is, after waiting for the tracker to see it. Raises TrackingLost."""
        deadline_s = time.monotonic() + patience_s
        while True:
            try:
                return self.tracker.pose()
            except TrackingLost:
                if time.monotonic() > deadline_s:
                    raise
            time.sleep(_LOOK_S)

    def close(self) -> None:
        """Stop the motors and release everything. Idempotent."""
        self.motors.close()
        self.tracker.close()


def _structure(body: str) -> Structure | None:
    if not body:
        return None
    from vvvaltr.twin.bodies import make_body
    from vvvaltr.twin.presets import PLANAR_PARTS

    return make_body(body, PLANAR_PARTS).structure()
