"""Rotation matrices and quaternions, as camera systems send them, and the angles of a ``Pose``."""

from __future__ import annotations

import math

from vvvaltr.controller.core.values import Vector

Angles = tuple[float, float, float]
"""Yaw, pitch and roll in rad, intrinsic z-y'-x''."""

Matrix = tuple[Vector, Vector, Vector]
"""A rotation, row by row: its columns are the body's axes in the world."""

Quaternion = tuple[float, float, float, float]
"""A rotation as x, y, z, w."""

_TOLERANCE = 0.01  # of the length of an axis, and of the cosine between two: far above rounding to 32 bits


def is_rotation(matrix: Matrix) -> bool:
    """Return whether ``matrix`` is a rotation: right-handed, and its axes of length 1 and square. NaN is none."""
    x, y, z = zip(*matrix, strict=True)
    squares = (_dot(x, x) - 1.0, _dot(y, y) - 1.0, _dot(z, z) - 1.0, _dot(x, y), _dot(y, z), _dot(z, x))
    return all(abs(error) < _TOLERANCE for error in squares) and _dot(_cross(x, y), z) > 0.0


def is_unit(quaternion: Quaternion) -> bool:
    """Return whether ``quaternion`` is a rotation: of length 1. NaN is none."""
    return abs(math.sqrt(sum(part * part for part in quaternion)) - 1.0) < _TOLERANCE


def angles_of(matrix: Matrix, last: Angles = (0.0, 0.0, 0.0)) -> Angles:
    """Return yaw, pitch and roll of a rotation: of all that describe it, those next to the ``last``.

    So nothing jumps when yaw or roll pass half a turn, nor when the pitch of a rolling robot passes a quarter.
    """
    (r00, _, _), (r10, _, _), (r20, r21, r22) = matrix
    yaw, pitch, roll = math.atan2(r10, r00), math.atan2(-r20, math.hypot(r00, r10)), math.atan2(r21, r22)
    twins = (_next_to(last, (yaw, pitch, roll)), _next_to(last, (yaw + math.pi, math.pi - pitch, roll + math.pi)))
    return min(twins, key=lambda angles: math.dist(angles, last))


def matrix_of(angles: Angles) -> Matrix:
    """Return the rotation of yaw, pitch and roll."""
    (sy, sp, sr), (cy, cp, cr) = map(math.sin, angles), map(math.cos, angles)
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def matrix_of_quaternion(quaternion: Quaternion) -> Matrix:
    """Return the rotation of a quaternion of length 1."""
    x, y, z, w = quaternion
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


def quaternion_of(angles: Angles) -> Quaternion:
    """Return the quaternion of yaw, pitch and roll."""
    halves = tuple(0.5 * angle for angle in angles)
    (sy, sp, sr), (cy, cp, cr) = map(math.sin, halves), map(math.cos, halves)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def _next_to(last: Angles, angles: Angles) -> Angles:
    yaw, pitch, roll = (a + math.tau * round((b - a) / math.tau) for a, b in zip(angles, last, strict=True))
    return yaw, pitch, roll


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
