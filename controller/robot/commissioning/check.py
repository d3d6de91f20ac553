"""The health of a robot, point by point: links, watchdogs, tracker, motors and their directions."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass

from vvvaltr.controller.core.errors import DeviceError, DeviceFault, TrackingLost, UserError
from vvvaltr.controller.core.values import Gait
from vvvaltr.controller.robot.commissioning.track import look, problems, sight
from vvvaltr.controller.robot.commissioning.vibration import find_peak, measure_spectrum, record_poses, record_states
from vvvaltr.controller.robot.hardware import JoinedMotors, open_motors
from vvvaltr.controller.robot.robot_file import RobotFile
from vvvaltr.drivers.motor_line import WATCHDOG, HeldMotors, MotorLine
from vvvaltr.drivers.registry import open_line
from vvvaltr.drivers.table import LineTable
from vvvaltr.drivers.trackers.registry import PoseTracker, open_tracker

_TEST_SHARE, _TEST_HZ = 0.75, 15.0  # of the greatest frequency, but no faster than any tracker can see
_SETTLE_S, _LOOK_S = 0.6, 1.0
_TOLERANCE = 0.15
_CLEAR = 1.6
_LOOK_AT_REST_S = 2.0
_ROTATION_S, _RUN_DOWN_S, _AT_REST_HZ = 0.4, 0.5, 1.0


@dataclass(frozen=True, slots=True)
class Finding:
    """What one test of a robot showed; ``cure`` is empty where it passed."""

    name: str
    passed: bool
    detail: str
    cure: str = ""


def check(robot: RobotFile) -> Iterator[Finding]:
    """Test everything, one after the other; the motors rotate. A device that fails ends the tests that need it."""
    opened = True
    for number, line in enumerate(robot.line, start=1):
        finding = _check_link(f"line {number} link", line)
        opened = opened and finding.passed
        yield finding
        if finding.passed:
            yield _check_watchdog(f"line {number} watchdog", line)
    with ExitStack() as stack:
        tracker = _open_tracker(robot, stack)
        finding = tracker if isinstance(tracker, Finding) else _check_tracker(tracker)
        yield finding
        if opened:
            seeing = tracker if finding.passed and not isinstance(tracker, Finding) else None
            yield from _check_motors(robot, seeing)


def _open_tracker(robot: RobotFile, stack: ExitStack) -> PoseTracker | Finding:
    try:
        tracker = open_tracker(robot.tracker)
    except (ValueError, UserError, DeviceError) as error:
        return Finding("tracker", False, str(error), "end the other program that uses it, or correct [tracker]")
    stack.callback(tracker.close)
    return tracker


def _check_link(name: str, line: LineTable) -> Finding:
    try:
        opened = open_line(line)
    except (DeviceError, UserError) as error:
        return Finding(
            name, False, str(error), "check port and power first, then the keys of the line in the robot's file"
        )
    described = f"{opened.name}: {opened.motor_count} motors answer"
    opened.close()
    return Finding(name, True, described)


def _check_watchdog(name: str, line: LineTable) -> Finding:
    """Start the motors, fall silent, and observe whether the device stops them by itself."""
    try:
        opened = open_line(line)
    except DeviceError as error:
        return Finding(name, False, str(error), "make the link work first")
    try:
        return _watchdog_finding(name, opened, Gait(tuple(0.5 * motor.max_hz for motor in line.motor)))
    except DeviceError as error:
        return Finding(
            name, False, str(error), "clear the device's fault, with its maker's tool if need be, and check again"
        )
    finally:
        with suppress(DeviceError):
            opened.rest()
        opened.close()


def _watchdog_finding(name: str, line: MotorLine, gait: Gait) -> Finding:
    line.send(gait)
    stopped_early = _hears_watchdog(line, _ROTATION_S, gait)  # as happens where this computer is held up
    time.sleep(line.watchdog_s + 0.1)
    has_stopped = _hears_watchdog(line, _RUN_DOWN_S) or stopped_early
    state = line.state()
    turning = [n for n, hz in enumerate(state.frequency_hz, start=1) if state.measured and abs(hz) > _AT_REST_HZ]
    if has_stopped and not turning:
        return Finding(name, True, f"stops the motors within {line.watchdog_s:g} s of silence")
    motors = f"motor {turning[0]} of the line" if has_stopped else "its motors"
    return Finding(
        name,
        False,
        f"{line.watchdog_s:g} s after the last command the device had not stopped {motors}",
        "switch on the watchdog in the device's configuration, for 0.25 s",
    )


def _hears_watchdog(line: MotorLine, duration_s: float, gait: Gait | None = None) -> bool:
    """Listen, repeating ``gait``, and return whether the device reported that its watchdog stopped the motors."""
    has_stopped = False
    end_s = time.monotonic() + duration_s
    while (now_s := time.monotonic()) < end_s:
        try:
            if gait is not None:
                line.repeat(gait)
            line.listen(now_s + line.period_s)
        except DeviceFault as fault:
            if fault.code != WATCHDOG:
                raise
            has_stopped = True
    return has_stopped


def _check_tracker(tracker: PoseTracker) -> Finding:
    seen = sight(list(look(tracker, _LOOK_AT_REST_S)), tracker)
    detail = f"{seen.rate_hz:.0f} poses/s, at rest within {1000.0 * seen.noise_m:.1f} mm"
    for problem in problems(seen):
        return Finding("tracker", False, problem.what if seen.poses < 2 else f"{problem.what} ({detail})", problem.cure)
    return Finding("tracker", True, detail)


def _check_motors(robot: RobotFile, tracker: PoseTracker | None) -> Iterator[Finding]:
    with ExitStack() as stack:
        lines: list[HeldMotors] = []
        try:
            for line in robot.line:
                lines.append(open_motors(line))
                stack.callback(lines[-1].close)
        except DeviceError as error:
            yield Finding("motors", False, str(error), "make the link work first")
            return
        motors = JoinedMotors(lines)
        for number, motor in enumerate(robot.motors, start=1):
            test = _RotationTest(motors, tracker, number - 1, min(_TEST_SHARE * motor.max_hz, _TEST_HZ))
            yield from test.findings(f"motor {number}")


@dataclass(frozen=True, slots=True)
class _RotationTest:
    """Rotates one motor both ways."""

    motors: JoinedMotors
    tracker: PoseTracker | None
    motor: int
    frequency_hz: float

    def findings(self, name: str) -> Iterator[Finding]:
        cure = "check its wiring and supply, and run vvvaltr calibrate"
        try:
            if not self.motors.state().measured:
                yield from self._tracked(name, cure)
                return
            forward_hz, reverse_hz = self._measured_hz(1.0), self._measured_hz(-1.0)
        except (DeviceError, TrackingLost) as error:
            yield Finding(name, False, str(error), cure)
            return
        detail = f"set to {self.frequency_hz:.1f} Hz, turns at {forward_hz:.1f} Hz"
        passed = self._is_right(abs(forward_hz))
        yield Finding(name, passed, detail, "" if passed else cure)
        detail = f"turns at {forward_hz:+.1f} and {reverse_hz:+.1f} Hz"
        passed = forward_hz > 0.0 > reverse_hz
        yield Finding(f"{name} direction", passed, detail, "" if passed else "swap the motor's or its encoder's wires")

    def _tracked(self, name: str, cure: str) -> Iterator[Finding]:
        """Yield what the tracker shows of a motor that has no sensor."""
        if self.tracker is None:
            yield Finding(
                name, False, "it has no sensor, and no working tracker to measure it", "make the tracker work first"
            )
            return
        for title, sign in ((name, 1.0), (f"{name} direction", -1.0)):
            poses = record_poses(self.motors, self.tracker, self._gait(sign), _SETTLE_S, _LOOK_S)
            peak = find_peak(measure_spectrum(poses), 0.6 * self.frequency_hz, 1.4 * self.frequency_hz)
            passed = peak.clarity > _CLEAR and self._is_right(peak.frequency_hz)
            detail = f"set to {sign * self.frequency_hz:.1f} Hz, the robot shakes at {peak.frequency_hz:.1f} Hz"
            if peak.clarity <= _CLEAR:
                detail = f"set to {sign * self.frequency_hz:.1f} Hz, the robot does not shake"
            elif sign < 0.0:
                detail += "; without a sensor the direction is unknown: look at the motor"
            yield Finding(title, passed, detail, "" if passed else cure)

    def _measured_hz(self, sign: float) -> float:
        states = record_states(self.motors, self._gait(sign), _SETTLE_S, 0.3)
        return sum(state.frequency_hz[self.motor] for state in states) / len(states)

    def _gait(self, sign: float) -> Gait:
        frequency_hz = [0.0] * self.motors.motor_count
        frequency_hz[self.motor] = sign * self.frequency_hz
        return Gait(tuple(frequency_hz))

    def _is_right(self, frequency_hz: float) -> bool:
        return math.isclose(frequency_hz, self.frequency_hz, rel_tol=_TOLERANCE)
