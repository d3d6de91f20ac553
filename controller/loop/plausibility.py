"""Whether a pose can be the robot's: what cannot be is dropped and counted, and ends the trial where it goes on."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import Pose

_WINDOW_S = 1.0  # in which the share of dropped poses is judged
_LARGEST_SHARE = 0.4
_FEWEST_DROPPED = 4  # one outlier among few poses is still one outlier
_FEWEST_FROZEN = 5  # poses with new time stamps and the same numbers, to the last digit
_FAR_M, _HIGH_M = 50.0, 5.0  # from the origin of the tracker's frame, and above its floor
_FULL_TURN_RAD = 6.5  # 2 pi and a little: no heading, pitch or roll is written with more
_BODY_LENGTH_M = 0.15  # of the published robots
_LENGTHS_PER_TURN = 0.1  # ten times what the fastest known gait does
_MAD_TO_SD = 1.4826
_MEDIAN_TO_MEAN = math.sqrt(math.pi / 2.0)  # the standard error of a median over that of a mean, normal noise


@dataclass(frozen=True, slots=True)
class Plausibility:
    """What a pose of the robot can be.

    Args:
        max_speed_m_s: greatest speed of the robot's centre along the ground, over a trial or a long gap.
        shake_m: how far the centre may move beside that from one pose to the next, by shaking.
        max_lift_m: how far the centre may rise or fall from where it was at the start.
        lost_s: how long poses may be implausible before the trial ends.
        frozen_s: how long every number of the pose may stay the same while motors turn.
    """

    max_speed_m_s: float = 1.0
    shake_m: float = 0.05
    max_lift_m: float = 0.15
    lost_s: float = 0.25
    frozen_s: float = 0.5


def plausible_speed_m_s(max_hz: float) -> float:
    """Return the speed that no robot of the published size exceeds with motors of ``max_hz``.

    A tenth of a body length of 0.15 m per turn of the motors: ten times the fastest gait that is known.
    """
    return _BODY_LENGTH_M * _LENGTHS_PER_TURN * max_hz


class PoseFilter:
    """Lets the plausible poses of one trial through, counts the others, and ends the trial where they persist."""

    def __init__(self, limits: Plausibility) -> None:
        self._limits = limits
        self._last: Pose | None = None
        self._start_z_m: float | None = None
        self._seen: deque[tuple[float, bool]] = deque()
        self._frozen_since_s = math.nan
        self._frozen = 0
        self.dropped = 0

    def begin_at(self, rest: RestingPose, t_s: float) -> None:
        """Take ``rest`` as the place where the robot lies at ``t_s``, before the drive."""
        self._last = Pose(t_s, rest.position_m, rest.yaw_rad, rest.pitch_rad, rest.roll_rad)
        self._start_z_m = rest.position_m[2]

    def accepts(self, pose: Pose, motors_turn: bool) -> bool:
        """Return whether ``pose`` can be the robot's.

        Raises:
            TrackingLost: implausible poses have gone on for too long, or the tracker repeats one pose.
        """
        if self._is_repeat(pose, motors_turn):
            return True
        problem = self._problem(pose)
        self._note(pose, problem)
        if problem:
            return False
        self._last = pose
        return True

    def _is_repeat(self, pose: Pose, motors_turn: bool) -> bool:
        """Return whether nothing in ``pose`` is new. Raises TrackingLost when its time alone is, for too long."""
        last = self._last
        if last is None or _numbers(pose) != _numbers(last):
            self._frozen, self._frozen_since_s = 0, pose.t_s
            return False
        if pose.t_s == last.t_s:
            return True  # read twice
        self._frozen += 1
        if not motors_turn:
            self._frozen, self._frozen_since_s = 0, pose.t_s
        frozen_s = pose.t_s - self._frozen_since_s
        if self._frozen >= _FEWEST_FROZEN and frozen_s > self._limits.frozen_s:
            raise TrackingLost(
                f"the tracker has repeated one position to the last digit for {frozen_s:.2f} s while motors turn: it "
                "does not see the robot any more; show it the robot"
            )
        return False

    def _problem(self, pose: Pose) -> str:
        """Return why ``pose`` cannot be the robot's; empty if it can."""
        limits, last = self._limits, self._last
        if not pose.is_finite:
            return "the pose is not a number"
        if max(map(abs, pose.position_m)) > _FAR_M or abs(pose.position_m[2]) > _HIGH_M:
            x_m, y_m, z_m = pose.position_m
            where = f"the position ({x_m:.3g}, {y_m:.3g}, {z_m:.3g}) m"
            return f'{where} is outside any laboratory; if it is millimetres, set unit = "mm"'
        for name, angle_rad in (("yaw", pose.yaw_rad), ("pitch", pose.pitch_rad), ("roll", pose.roll_rad)):
            if abs(angle_rad) > _FULL_TURN_RAD:
                return f'{name} is {angle_rad:.1f} rad, more than a full turn; if it is degrees, set yaw_unit = "deg"'
        if self._start_z_m is not None and abs(lift_m := pose.position_m[2] - self._start_z_m) > limits.max_lift_m:
            return f"the robot's centre is {lift_m:+.2f} m from its height at the start"
        if last is not None:
            gap_s = max(0.0, pose.t_s - last.t_s)
            moved_m = math.dist(pose.position_m[:2], last.position_m[:2])
            if moved_m > (allowed_m := limits.shake_m + limits.max_speed_m_s * gap_s):
                return f"the position jumped by {moved_m:.3g} m in {gap_s:.2f} s, where {allowed_m:.2g} m is plausible"
        return ""

    def _note(self, pose: Pose, problem: str) -> None:
        """Count a pose, and raise TrackingLost if too many were dropped."""
        self._seen.append((pose.t_s, bool(problem)))
        while self._seen[0][0] < pose.t_s - _WINDOW_S:
            self._seen.popleft()
        if not problem:
            return
        self.dropped += 1
        dropped = sum(bad for _, bad in self._seen)
        last = self._last
        is_long = last is not None and pose.t_s - last.t_s > self._limits.lost_s
        if dropped >= _FEWEST_DROPPED and (is_long or dropped > _LARGEST_SHARE * len(self._seen)):
            raise TrackingLost(f"{dropped} of the last {len(self._seen)} poses are implausible: {problem}")


def _numbers(pose: Pose) -> tuple[object, ...]:
    return pose.position_m, pose.yaw_rad, pose.pitch_rad, pose.roll_rad, pose.markers_m


def average_at_rest(poses: Sequence[Pose]) -> RestingPose:
    """Return where the robot lay during one or more finite poses, and how certain that is.

    Medians, so that an outlier has no say; their standard error from the median absolute deviation, for normal noise.
    """
    x_m, y_m, z_m = (float(np.median(each)) for each in zip(*(pose.position_m for pose in poses), strict=True))
    yaws_rad = _unwrapped([pose.yaw_rad for pose in poses])
    pitch_rad = float(np.median(_unwrapped([pose.pitch_rad for pose in poses])))
    roll_rad = float(np.median(_unwrapped([pose.roll_rad for pose in poses])))
    errors_m = [_standard_error([pose.position_m[axis] for pose in poses]) for axis in (0, 1)]
    return RestingPose(
        (x_m, y_m, z_m),
        float(np.median(yaws_rad)),
        pitch_rad,
        roll_rad,
        None if errors_m[0] is None or errors_m[1] is None else math.hypot(errors_m[0], errors_m[1]) / math.sqrt(2.0),
        _standard_error(yaws_rad),
    )


def _unwrapped(angles_rad: Sequence[float]) -> list[float]:
    """Return the angles, each within half a turn of the last one."""
    last_rad = angles_rad[-1]
    return [last_rad + math.remainder(angle_rad - last_rad, math.tau) for angle_rad in angles_rad]


def _standard_error(values: Sequence[float]) -> float | None:
    """Return the standard error of the median of ``values``; None for a single one."""
    if len(values) < 2:
        return None
    deviation = float(np.median(np.abs(np.array(values) - np.median(values))))
    return _MEDIAN_TO_MEAN * _MAD_TO_SD * deviation / math.sqrt(len(values))
