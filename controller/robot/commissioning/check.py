"""The health of a robot, point by point: links, watchdogs, tracker, motors and their directions."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress

from vvvaltr.controller.core.errors import DeviceError, DeviceFault, TrackingLost, UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.loop.plausibility import Plausibility, PoseFilter
from vvvaltr.controller.robot.commissioning.finding import Finding
from vvvaltr.controller.robot.commissioning.rotation import SETTLE_S, RotationTest, Seeing, chosen_hz
from vvvaltr.controller.robot.commissioning.track import Sight, look, problems, sight
from vvvaltr.controller.robot.commissioning.vibration import record_poses
from vvvaltr.controller.robot.hardware import JoinedMotors, open_motors
from vvvaltr.controller.robot.robot_file import RobotFile
from vvvaltr.drivers.held_motors import HeldMotors
from vvvaltr.drivers.motor_line import WATCHDOG, MotorLine
from vvvaltr.drivers.registry import open_line
from vvvaltr.drivers.table import LineTable
from vvvaltr.drivers.trackers.registry import PoseTracker, open_tracker

_LOOK_AT_REST_S, _LOOK_IN_MOTION_S = 2.0, 1.0
_ROTATION_S, _RUN_DOWN_S, _AT_REST_HZ = 0.4, 0.5, 1.0


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
        if isinstance(tracker, Finding):
            yield tracker
            seeing = None
        else:
            seen = sight(list(look(tracker, _LOOK_AT_REST_S)), tracker)
            findings = list(_judge_tracker(seen))
            yield from findings
            seeing = Seeing(tracker, seen.rate_hz) if all(finding.passed for finding in findings) else None
        if opened:
            yield from _check_motors(robot, seeing)


def _open_tracker(robot: RobotFile, stack: ExitStack) -> PoseTracker | Finding:
    try:
        tracker = open_tracker(robot.tracker)
    except (ValueError, UserError, DeviceError) as error:
        what, _, cure = str(error).partition("; ")
        return Finding("tracker", False, what, cure or "end the other program that uses it, or correct [tracker]")
    stack.callback(tracker.close)
    return tracker


def _check_link(name: str, line: LineTable) -> Finding:
    try:
        opened = open_line(line)
    except (DeviceError, UserError) as error:
        what, _, cure = str(error).partition("; ")
        return Finding(
            name, False, what, cure or "check port and power first, then the keys of the line in the robot's file"
        )
    described = f"{opened.name}: {opened.motor_count} motors answer"
    opened.close()
    return Finding(name, True, described)


def _check_watchdog(name: str, line: LineTable) -> Finding:
    """Start the motors, fall silent, and observe whether the device stops them by itself."""
    try:
        opened = open_line(line)
    except (DeviceError, UserError) as error:
        return Finding(name, False, str(error), "make the link work first")
    try:
        if math.isinf(opened.watchdog_s):
            detail = "there is none: the motors run on when the link is lost or this program is killed"
            return Finding(name, True, detail, "keep a hand at their switch, or use boards with a watchdog")
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


def _judge_tracker(seen: Sight) -> Iterator[Finding]:
    detail = f"{seen.rate_hz:.0f} poses/s, at rest within {1000.0 * seen.noise_m:.1f} mm"
    found = problems(seen)
    worst = next((problem for problem in found if not problem.is_warning), None)
    if worst is not None:
        yield Finding("tracker", False, worst.what if seen.poses < 2 else f"{worst.what} ({detail})", worst.cure)
    else:
        yield Finding("tracker", True, detail)
    for problem in (problem for problem in found if problem.is_warning):
        yield Finding("poses", True, problem.what, problem.cure)


def _check_motors(robot: RobotFile, seeing: Seeing | None) -> Iterator[Finding]:
    with ExitStack() as stack:
        lines: list[HeldMotors] = []
        try:
            for line in robot.line:
                lines.append(open_motors(line))
                stack.callback(lines[-1].close)
        except (DeviceError, UserError) as error:
            yield Finding("motors", False, str(error), "make the link work first")
            return
        motors = JoinedMotors(lines)
        for number, motor in enumerate(robot.motors, start=1):
            test = RotationTest(motors, seeing, number - 1, motor.max_hz, robot.reverses)
            yield from test.findings(f"motor {number}")
        if seeing is not None:
            yield _check_motion(motors, seeing, robot)


def _check_motion(motors: JoinedMotors, seeing: Seeing, robot: RobotFile) -> Finding:
    """Judge the poses while all motors turn: whether they are those of the robot."""
    name, poses = "poses in motion", PoseFilter(robot.trial_settings.plausibility or Plausibility())
    try:
        gait = Gait(tuple(chosen_hz(motor.max_hz) for motor in robot.motors))
        seen = record_poses(motors, seeing.tracker, gait, SETTLE_S, _LOOK_IN_MOTION_S)
        for pose in seen:
            poses.accepts(pose, motors_turn=True)
    except TrackingLost as lost:
        what, _, cure = str(lost).rpartition("; ")
        return Finding(name, False, what or cure, cure if what else "show the robot to the tracker")
    except DeviceError as error:
        return Finding(name, False, str(error), "check the motors first")
    detail = f"{len(seen)} poses, {poses.dropped} of them implausible"
    return Finding(name, True, detail, "let the tracker see one body alone, the robot" if poses.dropped else "")
