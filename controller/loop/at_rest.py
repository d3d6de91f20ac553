"""Where a robot at rest lies, averaged so that an outlier has no say, and whether a tracker sees it there."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import Pose

_MAD_TO_SD = 1.4826
_MOST_REPEATS = 2  # of the poses at rest, all of which would differ if the tracker saw the robot
_FROZEN_M = 1e-7  # what a place may differ by that was sent again: the last digits of single precision
_YAW_SCATTER_RAD = 0.04  # at rest, as a standard deviation: five times that of a tag in a blurred picture
_MEDIAN_TO_MEAN = math.sqrt(math.pi / 2.0)  # the standard error of a median over that of a mean, normal noise

SHOW = "show the robot to the tracker"
UNSEEN = f"it does not see the robot any more; {SHOW}"
DEGREES = 'if it is degrees, set yaw_unit = "deg"'


def average_at_rest(poses: Sequence[Pose]) -> RestingPose:
    """Return where the robot lay during one or more finite poses, and how certain that is.

    Medians, so that an outlier has no say; their standard error from the median absolute deviation, for normal noise.
    """
    x_m, y_m, z_m = (float(np.median(each)) for each in zip(*(pose.position_m for pose in poses), strict=True))
    yaws_rad = _unwrap([pose.yaw_rad for pose in poses])
    pitch_rad = float(np.median(_unwrap([pose.pitch_rad for pose in poses])))
    roll_rad = float(np.median(_unwrap([pose.roll_rad for pose in poses])))
    errors_m = [_standard_error([pose.position_m[axis] for pose in poses]) for axis in (0, 1)]
    return RestingPose(
        (x_m, y_m, z_m),
        float(np.median(yaws_rad)),
        pitch_rad,
        roll_rad,
        None if errors_m[0] is None or errors_m[1] is None else math.hypot(errors_m[0], errors_m[1]) / math.sqrt(2.0),
        _standard_error(yaws_rad),
    )


def _unwrap(angles_rad: Sequence[float]) -> list[float]:
    """Return the angles, each within half a turn of the last one."""
    last_rad = angles_rad[-1]
    return [last_rad + math.remainder(angle_rad - last_rad, math.tau) for angle_rad in angles_rad]


def _standard_error(values: Sequence[float]) -> float | None:
    """Return the standard error of the median of ``values``; None for a single one."""
    if len(values) < 2:
        return None
    deviation = float(np.median(np.abs(np.array(values) - np.median(values))))
    return _MEDIAN_TO_MEAN * _MAD_TO_SD * deviation / math.sqrt(len(values))


def most_central(poses: Sequence[Pose]) -> Pose:
    """Return the pose that is nearest to the others by the median: of two bodies one, never a place between them."""
    return min(poses, key=lambda pose: float(np.median([math.dist(pose.position_m, it.position_m) for it in poses])))


def is_same_place(pose: Pose, other: Pose) -> bool:
    """Whether two positions are one, whatever the angles: they may come from a gyroscope while nothing is seen."""
    return all(abs(x_m - other_m) <= _FROZEN_M for x_m, other_m in zip(pose.position_m, other.position_m, strict=True))


def check_repeats(start: Sequence[Pose], end: Sequence[Pose]) -> None:
    """Raise TrackingLost if the tracker repeats one position at rest before the drive or after it, but not both times.

    A tracker that rounds may tell one position of a robot at rest again and again. One whose numbers always differ does
    so only of a robot that it does not see, and that may have lain elsewhere.
    """
    for rest, other, when in ((start, end, "before"), (end, start, "after")):
        if _repeats(rest) and _never_repeats(other):
            raise TrackingLost(f"the tracker has repeated one position to the last digit {when} the drive: {UNSEEN}")


def _repeats(poses: Sequence[Pose]) -> bool:
    """Return whether poses of several times show one position: more than two of them, or all."""
    times = len({pose.t_s for pose in poses})
    most = max((len({it.t_s for it in poses if is_same_place(it, pose)}) for pose in poses), default=0)
    return most > 1 and most >= min(times, _MOST_REPEATS + 1)


def _never_repeats(poses: Sequence[Pose]) -> bool:
    """Return whether no coordinate along the ground comes twice among poses of several times."""
    seen = {pose.t_s: pose.position_m for pose in poses}.values()
    return len(seen) > 1 and all(len({place_m[axis] for place_m in seen}) == len(seen) for axis in (0, 1))


def check_yaws(*rests: Sequence[Pose]) -> None:
    """Raise TrackingLost if the yaw of a robot at rest, once or several times, scatters as only another unit can."""
    yaws_rad = [_unwrap([pose.yaw_rad for pose in rest]) for rest in rests if rest]
    apart_rad = [yaw_rad - float(np.median(rest_rad)) for rest_rad in yaws_rad for yaw_rad in rest_rad]
    scatter_rad = (_standard_error(apart_rad) or 0.0) * math.sqrt(len(apart_rad)) / _MEDIAN_TO_MEAN
    if scatter_rad > _YAW_SCATTER_RAD:
        raise TrackingLost(f"the yaw of the robot at rest scatters by {scatter_rad:.2f} rad; {DEGREES}")
