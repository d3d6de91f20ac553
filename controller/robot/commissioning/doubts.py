"""What the poses of a robot at rest look like that they should not be: another unit, other axes, another body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.loop.plausibility import Plausibility, PoseFilter

_FEWEST_FROZEN = 20
_LOWEST_M, _HIGHEST_M = -0.02, 0.5  # of a robot's centre, above the ground
_LEAST_HEIGHT_M, _GREATEST_HEIGHT_M = 0.01, 0.3  # of a robot's centre that stands on the ground


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong with a tracker, and the cure. A warning may be right all the same."""

    what: str
    cure: str
    is_warning: bool = False


def doubts_of(poses: Sequence[Pose]) -> Iterator[Problem]:
    """Yield what is implausible about ``poses`` of a robot at rest, the worst first."""
    if not poses:
        return
    try:
        _, y_m, z_m = PoseFilter(Plausibility()).rest(poses).position_m
    except TrackingLost as lost:
        what, _, cure = str(lost).rpartition("; ")
        yield Problem(what, cure)
        return
    if len(poses) >= _FEWEST_FROZEN and len({(pose.position_m, pose.yaw_rad) for pose in poses}) == 1:
        yield Problem(
            f"all {len(poses)} poses are the same to the last digit, as of a body that is not seen any more",
            "show the robot to the tracker, or let it send more digits",
            is_warning=True,
        )
    if not _LOWEST_M < z_m < _HIGHEST_M:
        yield Problem(f"the robot's centre is at z = {z_m:.2f} m", _height_cure(y_m, z_m), is_warning=True)


def _height_cure(y_m: float, z_m: float) -> str:
    if _LEAST_HEIGHT_M < y_m < _GREATEST_HEIGHT_M:
        return f'set up = "y" if y = {y_m:.2f} m is its height, or else put the ground at z = 0'
    if z_m > 1.0:
        return 'set unit = "cm" if these are centimetres, or else put the ground at z = 0'
    return 'put the ground at z = 0, or set up = "y" if that axis points up'
