"""Calibration: the frequency of each motor at several commands, measured by the device or by the tracker."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from vvvaltr.controller.core.document import to_toml
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.values import Gait
from vvvaltr.controller.robot.commissioning.vibration import (
    Peak,
    find_peak,
    measure_spectrum,
    record_poses,
    record_states,
)
from vvvaltr.controller.robot.hardware import HardwareRobot
from vvvaltr.controller.robot.robot_file import RobotFile, convert_robot_file
from vvvaltr.drivers.links.curve import Curve
from vvvaltr.drivers.table import Points

_SETTLE_S = 0.7  # for a motor to reach its speed
_CLEAR, _CLEAR_IN_SHAPE = 1.6, 4.0  # above what noise reaches
_SLOWEST_SEEN, _SLOWEST_MEASURED = 0.2, 0.12  # of the greatest command
_OFF_HZ = 0.1


@dataclass(frozen=True, slots=True)
class Reading:
    """Frequency of a motor (counted from 0) at a command; NaN where it could not be measured."""

    motor: int
    command: float
    frequency_hz: float


def remove_curves(robot: RobotFile) -> RobotFile:
    """Return the robot without curves, so that a motor's frequency is its command."""
    return msgspec.structs.replace(robot, line=tuple(line.remove_curves() for line in robot.line), search=None)


def measure_motors(
    robot: HardwareRobot,
    greatest: Sequence[float],
    points: int,
    seconds: float,
    ask: Callable[[], float] | None = None,
) -> Iterator[Reading]:
    """Drive each motor alone, from its greatest command down, and yield its frequency at each.

    Args:
        robot: opened without curves.
        greatest: (motors,) the greatest commands.
        points: commands per motor, two or more.
        seconds: how long to look at each.
        ask: returns the frequency that a person measured by other means; None to measure it here.

    Raises:
        DeviceError: a device failed.
        TrackingLost: the tracker lost the robot.
    """
    slowest = _SLOWEST_MEASURED if robot.motors.state().measured else _SLOWEST_SEEN
    for motor, top in enumerate(greatest):
        measurement = _Measurement(robot, motor, seconds, ask)
        for step in range(points):
            command = top * (1.0 - (1.0 - slowest) * step / (points - 1))
            # A board's own speeds are whole numbers, and large; frequencies are neither.
            command = float(round(command)) if top > 100.0 else round(command, 2)
            yield Reading(motor, command, measurement.frequency_hz(command))


class _Measurement:
    """Measures one motor, and remembers the shape in which the robot shakes with it."""

    def __init__(self, robot: HardwareRobot, motor: int, seconds: float, ask: Callable[[], float] | None) -> None:
        self._robot = robot
        self._motor = motor
        self._seconds = seconds
        self._ask = ask
        self._shape: Peak | None = None
        self._last: tuple[float, float] | None = None

    def frequency_hz(self, command: float) -> float:
        commands = [0.0] * self._robot.motors.motor_count
        commands[self._motor] = command
        gait, motors = Gait(tuple(commands)), self._robot.motors
        if self._ask is not None:
            record_states(motors, gait, _SETTLE_S, self._seconds)
            return self._ask()
        if motors.state().measured:
            states = record_states(motors, gait, _SETTLE_S, self._seconds / 3.0)
            mean_hz = sum(abs(state.frequency_hz[self._motor]) for state in states) / len(states)
            return mean_hz if mean_hz > _OFF_HZ else math.nan
        return self._seen_hz(command, gait)

    def _seen_hz(self, command: float, gait: Gait) -> float:
        seen = measure_spectrum(record_poses(self._robot.motors, self._robot.tracker, gait, _SETTLE_S, self._seconds))
        low_hz, high_hz = 2.0, math.inf
        if self._last is not None:  # slower than before, but not much slower than in proportion
            high_hz = 1.02 * self._last[1]
            low_hz = 0.6 * self._last[1] * command / self._last[0]
        peak = find_peak(seen, low_hz, high_hz, self._shape)
        if peak.clarity < (_CLEAR_IN_SHAPE if self._shape else _CLEAR):
            return math.nan
        self._shape = self._shape or peak
        self._last = (command, peak.frequency_hz)
        return peak.frequency_hz


def fit_curve(seen: Sequence[Reading], former: Points) -> Points:
    """Return the curve of one motor.

    Where a slow motor could not be measured, the former curve is kept, scaled to the slowest measurement.

    Raises:
        UserError: the motor was measured at fewer than two commands.
    """
    points: list[tuple[float, float]] = []
    for reading in sorted(seen, key=lambda reading: -reading.command):
        frequency_hz = round(reading.frequency_hz, 3)
        if frequency_hz > 0.0 and (not points or frequency_hz < points[0][1]):
            points.insert(0, (reading.command, frequency_hz))
    if points and former:
        lowest, lowest_hz = points[0]
        share = lowest_hz / (Curve(former).frequency_hz(lowest) or math.inf)
        points = [(c, round(hz * share, 3)) for c, hz in former if c < lowest and hz * share > 0.0] + points
    if len(points) < 2:
        raise UserError(
            f"motor {seen[0].motor + 1} could be measured at fewer than two commands; check its wiring and the "
            "tracker, or measure by other means (--ask)"
        )
    return tuple(points)


def replace_curves(robot: RobotFile, curves: Sequence[Points]) -> RobotFile:
    """Return the robot with these curves, and with its limits and search reduced to what they reach."""
    fresh, lines = iter(curves), []
    for line in robot.line:
        motors = []
        for motor in line.motor:
            curve = next(fresh)
            motors.append(msgspec.structs.replace(motor, curve=curve, max_hz=min(motor.max_hz, curve[-1][1])))
        lines.append(msgspec.structs.replace(line, motor=tuple(motors)))
    robot = msgspec.structs.replace(robot, line=tuple(lines))
    if robot.search is not None:
        limit_hz = min(robot.limits.max_hz)
        low_hz, high_hz = (max(-limit_hz, min(limit_hz, hz)) for hz in robot.range_hz)
        robot = msgspec.structs.replace(
            robot, search=msgspec.structs.replace(robot.search, low_hz=low_hz, high_hz=high_hz)
        )
    return robot


def rewrite_robot_file(text: str, robot: RobotFile) -> str:
    """Return the file ``text`` with the numbers of ``robot``. Comments and order are kept where that is possible."""
    if (written := _plain(text)) is not None:  # whose tracker's paths are as the user wrote them
        robot = msgspec.structs.replace(robot, tracker=written.tracker)
    blocks = re.split(r"(?m)^(?=[ \t]*\[+[\w. ]+\]+[ \t]*(?:#.*)?$)", text)
    motors = iter(robot.motors)
    for number, block in enumerate(blocks):
        values: dict[str, Any] = {}
        if re.match(r"\s*\[\[\s*line\.motor\s*\]\]", block) and (motor := next(motors, None)):
            values = {"max_hz": motor.max_hz, "curve": [list(point) for point in motor.curve]}
        elif re.match(r"\s*\[\s*search\s*\]", block) and robot.search:
            values = msgspec.to_builtins(robot.search)
        for key, value in values.items():
            blocks[number] = _with_value(blocks[number], key, value)
    edited = "".join(blocks)
    if _plain(edited) == _plain(complete := to_toml(msgspec.to_builtins(robot))):
        return edited
    return complete


def _with_value(block: str, key: str, value: Any) -> str:
    """Return the table ``block`` with ``key`` set, in its place or else after the table's header."""
    line = f"{key} = {value}"
    set_block, count = re.subn(
        rf"(?m)^[ \t]*{key}\s*=\s*(\[(?:[^\[\]]|\[[^\[\]]*\])*\]|[^\s\[#]+)", line, block, count=1
    )
    return set_block if count else re.sub(r"\A(\s*\[.*\n?)", rf"\g<1>{line}\n", block, count=1)


def _plain(text: str) -> RobotFile | None:
    try:
        return convert_robot_file(tomllib.loads(text), "")
    except (tomllib.TOMLDecodeError, UserError):
        return None
