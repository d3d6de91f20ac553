"""A robot of real motors, put together from its file: lines, tracker, wall clock."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from vvvaltr.controller.core.clock import WallClock
from vvvaltr.controller.core.errors import DeviceError, DeviceFault, TrackingLost, UserError
from vvvaltr.controller.core.values import Gait, MotorState, Pose, Quantity, Structure
from vvvaltr.controller.robot.robot_file import RobotFile
from vvvaltr.drivers.links.curve import Curve
from vvvaltr.drivers.motor_line import HeldMotors, MotorLine
from vvvaltr.drivers.node.table import NodeLineTable, NodeMotorTable
from vvvaltr.drivers.odrive.table import OdriveLineTable, OdriveMotorTable
from vvvaltr.drivers.qik.table import QikLineTable
from vvvaltr.drivers.table import LineTable
from vvvaltr.drivers.trackers.registry import PoseTracker, open_tracker

if TYPE_CHECKING:
    from vvvaltr.drivers.node.line import NodeLine

_GREETING_S, _LOOK_S = 2.0, 0.02
_PATIENCE_S = 10.0  # with a device that starts anew, or is being plugged in again
_SWITCH_S = 1e-4  # how long another thread may hold the interpreter before an I/O thread gets it


def open_hardware(robot: RobotFile) -> HardwareRobot:
    """Open all lines and the tracker of ``robot``.

    Raises:
        DeviceError: a device does not answer as it should.
        TrackingLost: no pose comes from the tracker.
        ValueError: the tracker's address cannot be used.
        UserError: a motor is not calibrated, or what the tracker needs is not installed.
    """
    # The I/O threads must never wait long: not for other threads, and not for the collection of what lives for ever.
    sys.setswitchinterval(_SWITCH_S)
    gc.freeze()
    with ExitStack() as opened:
        parts = []
        for line in robot.line:
            parts.append(open_motors(line))
            opened.callback(parts[-1].close)
        tracker = open_tracker(robot.tracker)
        opened.callback(tracker.close)
        hardware = HardwareRobot(JoinedMotors(parts), tracker, _structure(robot.body))
        hardware.find(_GREETING_S)
        opened.pop_all()
    return hardware


@dataclass(frozen=True, slots=True)
class Part:
    """The motors on one line, each with the curve by which its commands are corrected (None: as they are)."""

    motors: HeldMotors
    curves: tuple[Curve | None, ...]

    def corrected(self, frequency_hz: Sequence[float]) -> tuple[float, ...]:
        """Return what to ask of the motors to get ``frequency_hz``. Raises ValueError for what they do not reach."""
        return tuple(curve.command(hz) if curve else hz for curve, hz in zip(self.curves, frequency_hz, strict=True))

    def close(self) -> None:
        """Stop, then let go of the line."""
        self.motors.close()


def open_motors(line: LineTable) -> Part:
    """Open one line. Raises as ``open_hardware`` does."""
    motors = HeldMotors(line_opener(line), ramp_hz_s=tuple(motor.ramp_hz_s for motor in line.motor))
    # The qik's curves belong to its driver, whose commands are no frequencies.
    curves = tuple(
        Curve(motor.curve) if motor.curve and not isinstance(line, QikLineTable) else None for motor in line.motor
    )
    return Part(motors, curves)


def line_opener(line: LineTable) -> Callable[[], MotorLine]:
    """Return what opens a line. Raises UserError if a motor that needs a calibration has none."""
    match line:
        case QikLineTable():
            return _qik_opener(line)
        case OdriveLineTable():
            return _odrive_opener(line)
        case NodeLineTable():
            return partial(_open_node, line)
    raise UserError(f"there is no driver for {type(line).__name__}")


def _qik_opener(line: QikLineTable) -> Callable[[], MotorLine]:
    from vvvaltr.drivers.qik import line as qik

    for motor in line.motor:
        if not motor.curve:
            raise UserError(
                f"line {line.port}: the motor on board {motor.board}, output {motor.output} has no curve; "
                "run vvvaltr calibrate first"
            )
    motors = [qik.QikMotor(motor.board, motor.output, Curve(motor.curve), motor.max_hz) for motor in line.motor]
    settings = qik.QikSettings(line.eight_bit, line.crc, line.timeout, line.spin_up_s, line.spin_up_below)
    return partial(qik.open_line, line.port, line.baud, motors, settings)


def _odrive_opener(line: OdriveLineTable) -> Callable[[], MotorLine]:
    from vvvaltr.drivers.odrive import line as odrive

    motors = [odrive.OdriveMotor(motor.node, greatest_command(motor), motor.max_a or None) for motor in line.motor]
    return partial(
        odrive.open_line, line.interface, line.channel, line.bitrate, motors, line.firmware, dict(line.options)
    )


def _open_node(line: NodeLineTable) -> MotorLine:
    from vvvaltr.drivers.links.serial import SerialLink
    from vvvaltr.drivers.node.line import open_node

    node = open_node(SerialLink(line.port, line.baud))
    try:
        _check_node(node, line)
    except DeviceFault:
        node.close()
        raise
    return node


def _check_node(node: NodeLine, line: NodeLineTable) -> None:
    """Raise DeviceFault if the node is not what the robot's file says."""
    if node.motor_count != len(line.motor):
        raise DeviceFault(
            "motors", f"{line.port}: the node has {node.motor_count} motors, the robot's file {len(line.motor)}"
        )
    for number, motor in enumerate(line.motor, start=1):
        if (command := greatest_command(motor)) > node.welcome.max_hz + 1e-9:
            raise DeviceFault(
                "max_hz",
                f"{line.port}: motor {number} of the line: the robot's file allows {command:g} Hz, the node's firmware "
                f"{node.welcome.max_hz:g} Hz; lower max_hz in the file, or raise it in the firmware",
            )


def greatest_command(motor: NodeMotorTable | OdriveMotorTable) -> float:
    """Return what a motor is asked for so that it turns at its ``max_hz``."""
    return Curve(motor.curve).command(motor.max_hz) if motor.curve else motor.max_hz


class JoinedMotors:
    """The motors of several lines in one order: satisfies ``MotorDriver``."""

    def __init__(self, parts: Sequence[Part]) -> None:
        self._parts = tuple(parts)

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return sum(part.motors.motor_count for part in self._parts)

    @property
    def quantities(self) -> frozenset[Quantity]:
        """What all lines can apply."""
        return frozenset.intersection(*(part.motors.quantities for part in self._parts))

    def drive(self, gait: Gait, hold_s: float) -> None:
        """Send each line its share, once all lines can apply theirs. Raises as ``MotorDriver.drive`` does."""
        if gait.motor_count != self.motor_count:
            raise ValueError(f"a gait for {gait.motor_count} motors, but the robot has {self.motor_count}")
        shares = self._shares(gait)
        for part, share in zip(self._parts, shares, strict=True):
            part.motors.check(share)
        for part, share in zip(self._parts, shares, strict=True):
            part.motors.drive(share, hold_s)

    def state(self) -> MotorState:
        """Return what all devices apply, with the time of the oldest news."""
        states = [part.motors.state() for part in self._parts]
        return MotorState(
            min(state.t_s for state in states),
            tuple(hz for state in states for hz in state.frequency_hz),
            all(state.measured for state in states),
            tuple(a for state in states for a in state.current_a) if all(s.current_a for s in states) else (),
            tuple(c for state in states for c in state.temperature_c) if all(s.temperature_c for s in states) else (),
        )

    def stop(self) -> None:
        """Stop all motors, also where one line cannot be told. Raises DeviceError for the first such line."""
        # No line's motors turn on while another one's device is waited for.
        problems = []
        for act in (HeldMotors.tell_to_stop, HeldMotors.await_word):
            for part in self._parts:
                try:
                    act(part.motors)
                except DeviceError as error:
                    problems.append(error)
        if problems:
            raise problems[0]

    def ready(self, patience_s: float) -> None:
        """Open afresh what had a fault. For use between trials only. Raises DeviceError."""
        for part in self._parts:
            part.motors.ready(patience_s)

    def close(self) -> None:
        """Stop, then let go of all lines."""
        for part in self._parts:
            with suppress(DeviceError):
                part.motors.tell_to_stop()
        for part in self._parts:
            part.close()

    def _shares(self, gait: Gait) -> list[Gait]:
        shares, first = [], 0
        for part in self._parts:
            span = slice(first, first := first + part.motors.motor_count)
            shares.append(Gait(part.corrected(gait.frequency_hz[span]), gait.phase_rad[span], gait.amplitude[span]))
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
        self.motors.ready(_PATIENCE_S)
        self.find(_PATIENCE_S)

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
        """Stop the motors and let go of everything. Idempotent."""
        self.motors.close()
        self.tracker.close()


def _structure(body: str) -> Structure | None:
    if not body:
        return None
    from vvvaltr.twin.bodies import make_body
    from vvvaltr.twin.presets import PLANAR_PARTS

    return make_body(body, PLANAR_PARTS).structure()
