"""Where rigid struts are in space, and how the whole robot is rotated.

A posture is an array of shape (struts, 7): for each strut its middle in metres and the unit quaternion (w first) that
rotates z into its axis, bottom to top.
"""

from __future__ import annotations

import math
from math import cos, sin

import numpy as np

from vvvaltr.controller.core.arrays import Array

Angles = tuple[float, float, float]


def place_nodes(posture: Array, halves_m: Array) -> Array:
    """Return the strut ends in metres, shape (2 * struts, 3), for half lengths of shape (struts,)."""
    w, x, y, z = posture[:, 3:].T
    axes = np.stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)
    reach_m = halves_m[:, None] * axes
    return np.stack([posture[:, :3] + reach_m, posture[:, :3] - reach_m], axis=1).reshape(-1, 3)


def rotate_posture(posture: Array, angles_rad: Angles, about_m: Array) -> Array:
    """Return the posture rotated by yaw, pitch and roll (intrinsic z-y'-x'') about a point of shape (3,), in metres."""
    (cy, sy), (cp, sp), (cr, sr) = ((cos(angle / 2.0), sin(angle / 2.0)) for angle in angles_rad)
    w, x = cy * cp * cr + sy * sp * sr, cy * cp * sr - sy * sp * cr
    y, z = cy * sp * cr + sy * cp * sr, sy * cp * cr - cy * sp * sr
    product = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    conjugate = np.array([[w, x, y, z], [-x, w, -z, y], [-y, z, w, -x], [-z, -y, x, w]])
    rotation = (product @ conjugate)[1:, 1:]
    middles_m = about_m + (posture[:, :3] - about_m) @ rotation.T
    return np.hstack([middles_m, posture[:, 3:] @ product.T])


def fit_rotation(nodes_m: Array, before_m: Array) -> Array:
    """Return the rotation, shape (3, 3), that carries nodes from ``before_m`` to ``nodes_m``, both (nodes, 3), best.

    It is the least-squares fit of W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta
    Crystallographica A32 (1976).
    """
    # Subtracting the mean on one side is enough: it removes the other side's from the product.
    left, _, right = np.linalg.svd((before_m - before_m.mean(axis=0)).T @ nodes_m)
    best = right.T @ left.T
    return np.asarray(best if _determinant(best) > 0.0 else right.T * [1.0, 1.0, -1.0] @ left.T)


def _determinant(matrix: Array) -> float:
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    return float(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))


def continue_angles(rotation: Array, last_rad: Angles) -> Angles:
    """Return yaw, pitch and roll (intrinsic z-y'-x'') of a rotation: of all equivalent angles, those nearest the last.

    The angles therefore do not jump when yaw or roll pass 180 degrees, nor when the pitch of a rolling robot passes 90.
    """
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    roll = math.atan2(rotation[2, 1], rotation[2, 2])
    same = _next_to(last_rad, (yaw, pitch, roll)), _next_to(last_rad, (yaw + math.pi, math.pi - pitch, roll + math.pi))
    return min(same, key=lambda angles: math.dist(angles, last_rad))


def _next_to(last_rad: Angles, angles_rad: Angles) -> Angles:
    turns = (round((last - angle) / math.tau) for last, angle in zip(last_rad, angles_rad, strict=True))
    yaw, pitch, roll = (angle + math.tau * turn for angle, turn in zip(angles_rad, turns, strict=True))
    return yaw, pitch, roll
