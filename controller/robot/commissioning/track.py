"""What a tracker is worth: how often and how late poses come, how much they scatter, and what to do about it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vvvaltr.controller.core.errors import DeviceTimeout, TrackingLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Tracker
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.robot.commissioning.doubts import Problem, doubts_of, find_strays
from vvvaltr.drivers.links.remote_clock import RemoteClock

if TYPE_CHECKING:
    from vvvaltr.controller.robot.hardware import HardwareRobot

_LOOK_PERIOD_S = 0.001
LEAST_RATE_HZ, LONGEST_GAP_S, MOST_JITTER_S, MOST_NOISE_M = 20.0, 0.15, 0.03, 0.005
_STEEP_RAD = math.radians(80.0)
_PROMPT = "connect the tracker by cable, let it send each pose at once, and end other programs on this computer"
_BURSTS, _REST_S, _BURST_S = 5, 0.6, 2.0
_DRIVE_PERIOD_S, _HOLD_S = 0.04, 0.25
_CLEAR = 5.0  # of the scatter at rest: what counts as movement
_LEAST_MOVE = (1e-4, 1e-4, 1e-4, 5e-4, 5e-4, 5e-4)  # in m and rad, for a tracker that does not scatter


@dataclass(frozen=True, slots=True)
class Look:
    """What a tracker showed at a moment: a pose, or why there was none."""

    at_s: float
    pose: Pose | None
    reason: str = ""
    cure: str = ""


@dataclass(frozen=True, slots=True)
class Sight:
    """What a tracker showed over a while. What cannot be told is NaN.

    Args:
        poses: how many different ones were seen.
        rate_hz: how many there were a second, by their own times.
        longest_gap_s: between two of them.
        lost_share: of the time in which there was no pose, 0 to 1; ``reason`` is the last one for it, and ``cure`` what
            to do about it, where the tracker knows.
        position_m, yaw_rad: the means.
        noise_m: standard deviation of the position along the axis where it is greatest: at rest, the tracker's noise.
            Poses that jump away from the others are left out of both.
        noise_rad: standard deviation of the yaw.
        uncertainty_m: as the tracker tells it, on average.
        offset_s: the tracker's clock minus this computer's.
        jitter_s: standard deviation of the poses' age on arrival.
        has_heading: whether the angles mean anything.
        doubts: what the poses of a robot at rest look like that they should not be, and what the tracker remarks.
    """

    poses: int
    rate_hz: float
    longest_gap_s: float
    lost_share: float
    reason: str
    position_m: tuple[float, float, float]
    yaw_rad: float
    noise_m: float
    noise_rad: float
    uncertainty_m: float
    offset_s: float
    jitter_s: float
    has_heading: bool
    cure: str = ""
    doubts: tuple[Problem, ...] = ()


def look(tracker: Tracker, duration_s: float) -> Iterator[Look]:
    """Yield what the tracker shows, a thousand times a second, for ``duration_s``."""
    end_s = time.monotonic() + duration_s
    while (now_s := time.monotonic()) < end_s:
        try:
            yield Look(now_s, tracker.pose())
        except TrackingLost as lost:
            yield Look(now_s, None, lost.reason, lost.cure)
        time.sleep(_LOOK_PERIOD_S)


def sight(looks: Sequence[Look], tracker: Tracker) -> Sight:
    """Return what the ``looks`` at a tracker tell. Raises ValueError if there are none."""
    if not looks:
        raise ValueError("the tracker has not been read: sample it first")
    first = next((number for number, seen in enumerate(looks) if seen.pose is not None), 0)
    looks = looks[first:]  # a tracker that has just been opened has no pose yet
    first_seen = {(taken := seen.pose).t_s: (seen.at_s, taken) for seen in reversed(looks) if seen.pose is not None}
    seen_s = np.array([at_s for at_s, _ in first_seen.values()])[::-1]
    poses = [pose for _, pose in first_seen.values()][::-1]
    times_s = np.array([pose.t_s for pose in poses])
    places = np.array([pose.position_m for pose in poses]).reshape(-1, 3)
    steady_m = places[find_strays(places) == 0.0]
    yaws = np.unwrap([pose.yaw_rad for pose in poses])
    clock = getattr(tracker, "clock", None)
    delays_s = seen_s - times_s
    told = [pose.uncertainty_m for pose in poses if pose.uncertainty_m is not None]
    is_row = len(poses) > 1
    last_loss = next((seen for seen in reversed(looks) if seen.pose is None), Look(0.0, None))
    remarks = [Problem(remark, "correct the sender", is_warning=True) for remark in getattr(tracker, "remarks", ())]
    x_m, y_m, z_m = steady_m.mean(axis=0).tolist() if len(steady_m) else [math.nan] * 3
    return Sight(
        poses=len(poses),
        rate_hz=(len(poses) - 1) / float(times_s[-1] - times_s[0]) if is_row else math.nan,
        longest_gap_s=float(np.diff(times_s).max()) if is_row else math.nan,
        lost_share=sum(seen.pose is None for seen in looks) / len(looks),
        reason=last_loss.reason,
        position_m=(x_m, y_m, z_m),
        yaw_rad=float(yaws.mean()) if poses else math.nan,
        noise_m=float(steady_m.std(axis=0).max()) if is_row and len(steady_m) else math.nan,
        noise_rad=float(yaws.std()) if is_row else math.nan,
        uncertainty_m=float(np.mean(told)) if told else math.nan,
        offset_s=clock.offset_s if isinstance(clock, RemoteClock) else math.nan,
        jitter_s=clock.jitter_s if isinstance(clock, RemoteClock) else _jitter_s(delays_s),
        has_heading=_has_heading(poses, steady_m),
        cure=last_loss.cure,
        doubts=(*doubts_of(poses), *remarks),
    )


def _jitter_s(delays_s: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    return float(delays_s.std()) if len(delays_s) else math.nan


def _has_heading(poses: Sequence[Pose], places: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> bool:
    """Return whether the angles mean anything: a sender that leaves them out has zeros alone, however it moves."""
    is_flat = all(pose.yaw_rad == pose.pitch_rad == pose.roll_rad == 0.0 for pose in poses)
    scatters = len(poses) > 1 and bool((places.std(axis=0) > 0.0).any())
    return bool(poses) and not (is_flat and scatters) and not all(abs(pose.pitch_rad) > _STEEP_RAD for pose in poses)


def problems(seen: Sight) -> tuple[Problem, ...]:
    """Return what is wrong with a tracker that was looked at while the robot lay at rest, the worst first."""
    if seen.poses < 2:
        what = seen.reason or "the tracker sends one pose and no more"
        return (Problem(what, seen.cure or "start the tracker, let it send to this address, show it the robot"),)
    found = [doubt for doubt in seen.doubts if not doubt.is_warning]
    if seen.lost_share > 0.01:
        what = f"no pose for {100.0 * seen.lost_share:.0f} % of the time: {seen.reason}"
        found.append(Problem(what, seen.cure or "light the robot evenly, and clear the view of the cameras"))
    if seen.rate_hz < LEAST_RATE_HZ:
        found.append(Problem(f"{seen.rate_hz:.0f} poses/s", f"let it send {LEAST_RATE_HZ:g} poses/s or more"))
    if seen.longest_gap_s > max(LONGEST_GAP_S, 2.5 / seen.rate_hz):
        what = f"a gap of {seen.longest_gap_s:.2f} s between two poses"
        found.append(
            Problem(what, "connect the tracker by cable, not by Wi-Fi, and end other programs on both computers")
        )
    if seen.jitter_s > MOST_JITTER_S:
        what = f"the poses' age on arrival scatters by {1000.0 * seen.jitter_s:.0f} ms"
        found.append(Problem(what, _PROMPT))
    if seen.noise_m > MOST_NOISE_M:
        what = f"the position scatters by {1000.0 * seen.noise_m:.1f} mm"
        found.append(Problem(what, "put the robot down at rest, and calibrate the tracker"))
    if not seen.has_heading:
        what = "the poses have no heading: all angles are 0, or the robot's x axis points up or down"
        found.append(Problem(what, "send yaw_rad, or define the body's axes with x forward and z up"))
    return (*found, *(doubt for doubt in seen.doubts if doubt.is_warning))


def response_s(robot: HardwareRobot, gait: Gait) -> float:
    """Return how long after a set-point the robot is seen to move: the median of five starts of ``gait``.

    That is the time in which the motors start, and the tracker's latency, together. The motors turn.

    Raises:
        DeviceTimeout: the robot is not seen to move.
        DeviceError: a motor failed.
        TrackingLost: the tracker does not see the robot.
    """
    try:
        return float(np.median([_start_s(robot, gait) for _ in range(_BURSTS)]))
    finally:
        robot.motors.stop()


def _start_s(robot: HardwareRobot, gait: Gait) -> float:
    looks = list(look(robot.tracker, _REST_S))
    # The robot may have rolled on a little at first.
    at_rest = np.array([_coordinates(seen.pose) for seen in looks[len(looks) // 2 :] if seen.pose is not None])
    if not len(at_rest):
        raise TrackingLost(looks[-1].reason)
    middle, least = at_rest.mean(axis=0), np.maximum(_CLEAR * at_rest.std(axis=0), _LEAST_MOVE)
    began_s = next_drive_s = time.monotonic()
    while (now_s := time.monotonic()) < began_s + _BURST_S:
        if now_s >= next_drive_s:
            robot.motors.drive(gait, _HOLD_S)
            robot.motors.state()
            next_drive_s += _DRIVE_PERIOD_S
        if (np.abs(np.array(_coordinates(robot.tracker.pose())) - middle) > least).any():
            seen_s = time.monotonic()
            robot.motors.stop()
            return seen_s - began_s
        time.sleep(_LOOK_PERIOD_S)
    raise DeviceTimeout("the motors turn, but the tracker does not see the robot move; does it track this robot?")


def _coordinates(pose: Pose) -> tuple[float, ...]:
    return (*pose.position_m, pose.yaw_rad, pose.pitch_rad, pose.roll_rad)
