"""Where a robot at rest lies, averaged so that an outlier has no say."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import Pose

_MAD_TO_SD = 1.4826
MEDIAN_TO_MEAN = math.sqrt(math.pi / 2.0)
"""The standard error of a median over that of a mean, normal noise."""


def average_at_rest(poses: Sequence[Pose]) -> RestingPose:
    """Return where the robot lay during one or more finite poses, and how certain that is.

    Medians, so that an outlier has no say; their standard error from the median absolute deviation, for normal noise.
    """
    x_m, y_m, z_m = (float(np.median(each)) for each in zip(*(pose.position_m for pose in poses), strict=True))
    yaws_rad = unwrap([pose.yaw_rad for pose in poses])
    pitch_rad = float(np.median(unwrap([pose.pitch_rad for pose in poses])))
    roll_rad = float(np.median(unwrap([pose.roll_rad for pose in poses])))
    errors_m = [standard_error([pose.position_m[axis] for pose in poses]) for axis in (0, 1)]
    return RestingPose(
        (x_m, y_m, z_m),
        float(np.median(yaws_rad)),
        pitch_rad,
        roll_rad,
        None if errors_m[0] is None or errors_m[1] is None else math.hypot(errors_m[0], errors_m[1]) / math.sqrt(2.0),
        standard_error(yaws_rad),
    )


def unwrap(angles_rad: Sequence[float]) -> list[float]:
    """Return the angles, each within half a turn of the last one."""
    last_rad = angles_rad[-1]
    return [last_rad + math.remainder(angle_rad - last_rad, math.tau) for angle_rad in angles_rad]


def standard_error(values: Sequence[float]) -> float | None:
    """Return the standard error of the median of ``values``; None for a single one."""
    if len(values) < 2:
        return None
    deviation = float(np.median(np.abs(np.array(values) - np.median(values))))
    return MEDIAN_TO_MEAN * _MAD_TO_SD * deviation / math.sqrt(len(values))
