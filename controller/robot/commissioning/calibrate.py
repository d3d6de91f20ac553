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
from vvvaltr.controller.core.errors import TrackingLost, UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.robot.commissioning.track import LEAST_RATE_HZ, look, sight
from vvvaltr.controller.robot.commissioning.vibration import (
    Peak,
    Spectrum,
    find_peak,
    followed_hz,
    measure_spectrum,
    needed_rate_hz,
    record_poses,
    record_states,
)
from vvvaltr.controller.robot.hardware import HardwareRobot
from vvvaltr.controller.robot.robot_file import RobotFile, convert_robot_file
from vvvaltr.drivers.links.curve import Curve
from vvvaltr.drivers.table import Points

_SETTLE_S = 1.2  # a motor is at 97 % of its speed by then
_CLEAR_IN_SHAPE = 4.0  # above what noise reaches
_SLOWEST_SEEN, _SLOWEST_MEASURED = 0.2, 0.12  # of the greatest command
_OFF_HZ = 0.1
_LOOK_S, _LOOK_POSES = 1.5, 75.0
_SLOWER = 0.85  # of a command: a motor that is seen for what it is turns slower there
_LEAST_SLOWER = 0.5  # of the frequency there: what is below is no motor, but the robot's walk
_NEAR_LIMIT = 0.95  # a motor may be a little faster than its former curve tells
_ATTEMPTS = 3  # a motor may stand still now and then


@dataclass(frozen=True, slots=True)
class Reading:
    """Frequency of a motor (counted from 0) at a command; NaN where it could not be measured."""

    motor: int
    command: float
    frequency_hz: float


def remove_curves(robot: RobotFile) -> RobotFile:
    """Return the robot without curves, so that a motor's frequency is its command."""
    return msgspec.structs.replace(robot, line=tuple(line.remove_curves() for line in robot.line), search=None)


@dataclass(frozen=True, slots=True)
class Reach:
    """How fast a motor may turn for its frequency to be measured. ``rate_hz`` is the tracker's pose rate."""

    rate_hz: float = math.inf

    @property
    def limit_hz(self) -> float:
        """The greatest frequency."""
        return followed_hz(self.rate_hz)

    @property
    def look_s(self) -> float:
        """How long to look at a motor, at least."""
        return _LOOK_POSES / self.rate_hz

    def greatest_commands(self, robot: RobotFile) -> list[float]:
        """Return the greatest command of each motor by which it turns no faster, as far as its former curve tells.

        Raises:
            UserError: the tracker is too slow to measure anything.
        """
        if self.rate_hz < LEAST_RATE_HZ:
            raise UserError(
                f"the tracker sends {self.rate_hz:.0f} poses/s, too few to measure a motor; let it send "
                f"{needed_rate_hz(max(robot.limits.max_hz)):.0f} poses/s, or measure by other means (--ask)"
            )
        curves = [motor.calibration for motor in robot.motors]
        return [
            top if curve.frequency_hz(top) <= self.limit_hz else min(top, curve.command(self.limit_hz))
            for top, curve in zip(remove_curves(robot).limits.max_hz, curves, strict=True)
        ]

    def explain(self, robot: RobotFile) -> str:
        """Return what is left out, in a sentence; empty if nothing is."""
        tops = zip(robot.motors, remove_curves(robot).limits.max_hz, strict=True)
        if (greatest_hz := max(motor.calibration.frequency_hz(top) for motor, top in tops)) <= self.limit_hz:
            return ""
        return (
            f"{self.rate_hz:.0f} poses/s show up to {self.limit_hz:.1f} Hz: motors are measured and searched up to "
            f"there; for {greatest_hz:.1f} Hz let the tracker send {needed_rate_hz(greatest_hz):.0f} poses/s"
        )


def find_reach(robot: HardwareRobot) -> Reach:
    """Return how fast the motors may turn to be measured: any, where they have sensors. Raises TrackingLost."""
    if robot.motors.state().measured:
        return Reach()
    seen = sight(list(look(robot.tracker, _LOOK_S)), robot.tracker)
    if math.isnan(seen.rate_hz):
        raise TrackingLost(seen.reason or "the tracker sends no poses", seen.cure or "start the tracker")
    return Reach(seen.rate_hz)


def measure_motors(
    robot: HardwareRobot,
    greatest: Sequence[float],
    points: int,
    seconds: float,
    reach: Reach,
    ask: Callable[[], float] | None = None,
) -> Iterator[Reading]:
    """Drive each motor alone, from its greatest command down, and yield its frequency at each.

    Args:
        robot: opened without curves.
        greatest: (motors,) the greatest commands.
        points: commands per motor, two or more.
        seconds: how long to look at each.
        reach: how fast the motors may turn to be measured.
        ask: returns the frequency that a person measured by other means; None to measure it here.

    Raises:
        DeviceError: a device failed.
        TrackingLost: the tracker lost the robot.
        UserError: a motor turns faster than the tracker can follow, so that it would be taken for a slower one.
    """
    slowest = _SLOWEST_MEASURED if robot.motors.state().measured else _SLOWEST_SEEN
    for motor, top in enumerate(greatest):
        measurement = _Measurement(robot, motor, seconds, ask)
        commands = [_round(top * (1.0 - (1.0 - slowest) * step / (points - 1))) for step in range(points)]
        if ask is None and not robot.motors.state().measured:
            measurement.find(commands[0], reach)
        for command in commands:
            yield Reading(motor, command, measurement.frequency_hz(command))


def _round(command: float) -> float:
    """Return a command without needless digits: a board's own speeds are whole, and large; frequencies are neither."""
    return float(round(command)) if command > 100.0 else round(command, 2)


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
        gait, motors = self._gait(command), self._robot.motors
        if self._ask is not None:
            record_states(motors, gait, _SETTLE_S, self._seconds)
            return self._ask()
        if motors.state().measured:
            settle_s = max(_SETTLE_S, motors.settle_s)
            states = record_states(motors, gait, settle_s, self._seconds / 3.0)
            mean_hz = sum(abs(state.frequency_hz[self._motor]) for state in states) / len(states)
            return mean_hz if mean_hz > _OFF_HZ else math.nan
        return self._seen_hz(command)

    def find(self, top: float, reach: Reach) -> None:
        """Find the motor at its greatest command, where a smaller one shows that it turns slower, as it must.

        Raises:
            UserError: the motor does not seem to turn slower at the smaller command, or is not seen there. A frequency
                f above half the pose rate r shows as r - f, which rises where f falls.
        """
        was_seen = were_both_seen = False
        for _ in range(_ATTEMPTS):
            fast, slow = self._look(top), self._look(_SLOWER * top)
            was_seen = was_seen or fast is not None
            were_both_seen = were_both_seen or not (fast is None or slow is None)
            if fast is None or slow is None or fast.frequency_hz > reach.limit_hz / _NEAR_LIMIT:
                continue
            if _LEAST_SLOWER * fast.frequency_hz < slow.frequency_hz <= fast.frequency_hz:
                self._shape, self._last = fast, (top, fast.frequency_hz)
                return
        if was_seen and not were_both_seen:
            raise UserError(
                f"motor {self._motor + 1} is seen to shake the robot at one of two commands alone, so its speed is not "
                "sure; see whether it turns, and calibrate again with a longer look (--seconds 10)"
            )
        if was_seen:
            raise UserError(
                f"motor {self._motor + 1} seems to turn faster than {reach.rate_hz:.0f} poses/s can show; let the "
                "tracker send more, give the motor a smaller max_hz, or measure by other means (--ask)"
            )

    def _look(self, command: float) -> Peak | None:
        """Return the vibration at a command, wherever it is; None if none is clear."""
        peak = find_peak(self._record(command), 2.0, math.inf)
        return peak if peak.is_clear else None

    def _record(self, command: float) -> Spectrum:
        motors, tracker = self._robot.motors, self._robot.tracker
        return measure_spectrum(record_poses(motors, tracker, self._gait(command), _SETTLE_S, self._seconds))

    def _gait(self, command: float) -> Gait:
        commands = [0.0] * self._robot.motors.motor_count
        commands[self._motor] = command
        return Gait(tuple(commands))

    def _seen_hz(self, command: float) -> float:
        if self._last is not None and self._last[0] == command:
            return self._last[1]  # it was found there
        low_hz, high_hz = 2.0, math.inf
        if self._last is not None:  # slower than before, but not much slower than in proportion
            high_hz = 1.02 * self._last[1]
            low_hz = 0.6 * self._last[1] * command / self._last[0]
        peak = find_peak(self._record(command), low_hz, high_hz, self._shape)
        if not (peak.clarity >= _CLEAR_IN_SHAPE if self._shape else peak.is_clear):
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
            f"motor {seen[0].motor + 1} could be measured at fewer than two commands; look at it: if it stands still, "
            "check its wiring; if it turns, look for longer (--seconds), or measure by other means (--ask)"
        )
    return tuple(points)


def replace_curves(robot: RobotFile, curves: Sequence[Points], limit_hz: float = math.inf) -> RobotFile:
    """Return the robot with these curves, and with its limits and search reduced to what they and the limit reach."""
    fresh, lines = iter(curves), []
    for line in robot.line:
        motors = []
        for motor in line.motor:
            curve = next(fresh)
            motors.append(msgspec.structs.replace(motor, curve=curve, max_hz=min(motor.max_hz, curve[-1][1], limit_hz)))
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
