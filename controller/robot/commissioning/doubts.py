"""What the poses of a robot at rest look like that they should not be: another unit, other axes, another body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.loop.plausibility import Plausibility, PoseFilter

_FEWEST_FROZEN = 20
_NEIGHBOURS, _STRAY_M = 9, 0.05  # poses whose median tells where a robot is that is at rest, or carried slowly
_MOST_STRAYS = 0.05  # of all poses: with more of them trials would be lost now and then
_LOWEST_M, _HIGHEST_M = -0.02, 0.5  # of a robot's centre, above the ground
_LEAST_HEIGHT_M, _GREATEST_HEIGHT_M = 0.01, 0.3  # of a robot's centre that stands on the ground


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong with a tracker, and the cure. A warning may be right all the same."""

    what: str
    cure: str
    is_warning: bool = False


def find_strays(places_m: Array) -> Array:
    """Return how far each of the places (n, 3) is from the robot along an axis, shape (n,); 0 where it can be its own.

    The robot is at the median of the nine places around: those before, the place itself, and those after. Zeros among
    others are no place.
    """
    if len(places_m) < _NEIGHBOURS:
        return np.zeros(len(places_m))
    margin = _NEIGHBOURS // 2
    around_m = np.pad(places_m, ((margin, margin), (0, 0)), mode="reflect")
    middles_m = np.median(np.lib.stride_tricks.sliding_window_view(around_m, _NEIGHBOURS, axis=0), axis=-1)
    away_m = np.abs(places_m - middles_m).max(axis=1)  # which, unlike a distance, does not overflow
    is_unseen = ~places_m.any(axis=1) & middles_m.any(axis=1)
    return np.where((away_m > _STRAY_M) | is_unseen, away_m, 0.0)


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
    places_m = np.array([pose.position_m for pose in poses])
    is_seen = places_m.any(axis=1)
    if 0 < (zeros := len(poses) - int(is_seen.sum())) < len(poses):
        yield Problem(
            f"{zeros} of {len(poses)} poses are zero to the last digit, as of a body that is not seen",
            "show the robot to the tracker",
            is_warning=zeros <= _MOST_STRAYS * len(poses),
        )
    away_m = find_strays(places_m)[is_seen]
    if strays := int(np.count_nonzero(away_m)):
        yield Problem(
            f"{strays} of {len(poses)} poses jump away from the others, by up to {away_m.max():.3g} m",
            "cover what else reflects or looks like the robot, and let the tracker see one body alone, the robot",
            is_warning=strays <= _MOST_STRAYS * len(poses),
        )
    if len(poses) >= _FEWEST_FROZEN and len({(pose.position_m, pose.yaw_rad) for pose in poses}) == 1:
        yield Problem(
            f"all {len(poses)} poses are the same to the last digit, as of a body that is not seen any more",
            "show the robot to the tracker, or let it send more digits",
            is_warning=True,
        )
    looks_y_up = z_m < _LEAST_HEIGHT_M < y_m < _GREATEST_HEIGHT_M
    if looks_y_up or not _LOWEST_M < z_m < _HIGHEST_M:
        yield Problem(f"the robot's centre is at z = {z_m:.2f} m", _height_cure(y_m, z_m), is_warning=True)


def _height_cure(y_m: float, z_m: float) -> str:
    if _LEAST_HEIGHT_M < y_m < _GREATEST_HEIGHT_M:
        return f'set up = "y" if y = {y_m:.2f} m is its height, or else put the ground at z = 0'
    if z_m > 1.0:
        return 'set unit = "cm" if these are centimetres, or else put the ground at z = 0'
    return 'put the ground at z = 0, or set up = "y" if that axis points up'
