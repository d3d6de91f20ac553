"""A drive cut into pieces, in which a robot that turns tells its own part from the floor's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from vvvaltr.controller.core.records import Piece
from vvvaltr.controller.core.values import Pose

PIECE_S = 1.0
"""Usual duration of a piece."""

MOST_PIECES = 60
"""Greatest number of pieces of a drive: what is learned from them takes time that grows with the cube of it."""

SKIPPED_S = 1.25
"""Time at the start of a drive that is left out, up to a quarter of the drive: motors are still speeding up."""

_LEAST_TURN_RAD = 0.1  # of the headings, else nothing tells the floor


def cut(poses: Sequence[Pose]) -> tuple[Piece, ...]:
    """Cut a drive into pieces of about 1 s, one of a minute or more into 60; none where the poses do not make two."""
    times_s = np.array([pose.t_s for pose in poses])
    first = int(np.searchsorted(times_s, min(SKIPPED_S, 0.25 * times_s[-1]) - 1e-6)) if len(times_s) else 0
    if len(times_s) - first < 3 or not all(pose.is_finite for pose in poses):
        return ()
    count = min(int((times_s[-1] - times_s[first]) / PIECE_S + 0.5), MOST_PIECES)
    if count < 2:
        return ()
    borders = np.searchsorted(times_s, np.linspace(times_s[first], times_s[-1], count + 1) - 1e-6)
    if not (np.diff(borders) > 0).all():
        return ()
    yaw_rad = np.array([pose.yaw_rad for pose in poses])
    heading = np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=1)
    found = []
    for begin, end in pairwise(borders.tolist()):
        cos, sin = heading[begin : end + 1].mean(axis=0).tolist()
        (x, y, _), (x_end, y_end, _) = poses[begin].position_m, poses[end].position_m
        found.append(Piece(float(times_s[end] - times_s[begin]), (x_end - x, y_end - y), (cos, sin)))
    return tuple(found)


def weigh(frequency_hz: Sequence[float]) -> float:
    """Return the sum of the squared frequencies, in Hz^2: the drift of a gait grows with it."""
    return math.fsum(hz * hz for hz in frequency_hz)


def turns(pieces: Sequence[Piece], first: tuple[float, float]) -> bool:
    """Return whether a trial had another heading than ``first``."""
    away = (
        math.atan2(s * first[0] - c * first[1], c * first[0] + s * first[1]) for c, s in (it.heading for it in pieces)
    )
    return any(abs(angle_rad) > _LEAST_TURN_RAD for angle_rad in away)


def find_speed_m_s(pieces: Sequence[Piece]) -> float:
    """Return the speed of a trial: the root of the pieces' mean square."""
    moved = math.fsum(x * x + y * y for x, y in (piece.moved_m for piece in pieces))
    return math.sqrt(moved / max(math.fsum(piece.duration_s**2 for piece in pieces), 1e-12))
