"""A driven gait as the steering sees it: pieces of its path, cut so that the robot's own walk and the floor's part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Pose

STEADY_S = 1.2  # until then motors speed up and the robot shakes itself into its walk
_PIECE_S, _MOST_PIECES = 1.0, 60  # what is learned from them takes time that grows with the cube of their number
_LEAST_S = 0.4  # of a path that says anything
SHORTEST_S = STEADY_S + _LEAST_S
"""The shortest drive that tells a movement."""


@dataclass(frozen=True, slots=True)
class Passage:
    """The steady part of a driven gait, in pieces of about 1 s, of a long one in 60.

    Args:
        duration_s: (pieces,) of each piece.
        rotation: (pieces, 2, 2) mean rotation from the robot's frame to the floor's within each piece.
        moved_m: (pieces, 2) displacement along the floor.
        turned_rad: in all pieces together.
    """

    duration_s: Array
    rotation: Array
    moved_m: Array
    turned_rad: float

    @property
    def total_s(self) -> float:
        """Duration of all pieces together."""
        return float(self.duration_s.sum())


def passage(poses: Sequence[Pose], from_s: float = STEADY_S) -> Passage | None:
    """Return the steady part of a driven gait; None where too little is left of it, or a pose is no number."""
    path = path_of(poses)
    path = path[path[:, 0] >= from_s - 1e-9]
    if len(path) < 3 or path[-1, 0] - path[0, 0] < _LEAST_S or not np.isfinite(path).all():
        return None
    pieces = min(max(1, round((path[-1, 0] - path[0, 0]) / _PIECE_S)), _MOST_PIECES)
    cuts = np.linspace(path[0, 0], path[-1, 0], pieces + 1)
    at = np.unique(np.searchsorted(path[:, 0], cuts - 1e-9).clip(0, len(path) - 1))
    rotations = np.array([_mean_rotation(path[begin : end + 1]) for begin, end in pairwise(at)])
    return Passage(np.diff(path[at, 0]), rotations, np.diff(path[at, 1:3], axis=0), float(path[-1, 3] - path[0, 3]))


def path_of(poses: Sequence[Pose]) -> Array:
    """Return time, x, y and yaw of each pose, shape (poses, 4), the yaw without jumps at half a turn."""
    path = np.array([(pose.t_s, pose.position_m[0], pose.position_m[1], pose.yaw_rad) for pose in poses]).reshape(-1, 4)
    path[:, 3] = np.unwrap(path[:, 3])
    return path


def where(pose: Pose) -> Array:
    """Return x, y and yaw of a pose, shape (3,)."""
    return np.array([pose.position_m[0], pose.position_m[1], pose.yaw_rad])


def _mean_rotation(path: Array) -> Array:
    weight_s = np.diff(path[:, 0])
    middle_rad = 0.5 * (path[1:, 3] + path[:-1, 3])
    cosine = float(weight_s @ np.cos(middle_rad) / weight_s.sum())
    sine = float(weight_s @ np.sin(middle_rad) / weight_s.sum())
    return np.array([[cosine, -sine], [sine, cosine]])


def start_delay_s(poses: Sequence[Pose]) -> float | None:
    """Return by how much a driven gait lags behind one that moves at its steady speed at once; None if it says not.

    The speed is compared along the path, so that a robot that turns is not taken for a slow one.
    """
    path = path_of(poses)
    steps_m = np.linalg.norm(np.diff(path[:: max(1, len(path) // 25), 1:3], axis=0), axis=1)
    times_s = path[:: max(1, len(path) // 25), 0][1:]
    early = times_s <= STEADY_S + 1e-9
    if early.sum() < 1 or (~early).sum() < 4 or steps_m[~early].mean() < 5e-4:
        return None
    return float(times_s[early][-1] - steps_m[early].sum() / (steps_m[~early].sum() / np.ptp(times_s[~early])))


def rotation(yaw_rad: float) -> Array:
    """Return the rotation from the robot's frame to the floor's, shape (2, 2)."""
    return np.array([[math.cos(yaw_rad), -math.sin(yaw_rad)], [math.sin(yaw_rad), math.cos(yaw_rad)]])
