"""Even walks: along an arc the robot moves by the exponential of its velocity."""

from __future__ import annotations

import numpy as np

from vvvaltr.controller.core.arrays import Array

Places = tuple[Array, Array]
"""x and y."""


def travel(velocities: Array, duration_s: Array) -> tuple[Array, Array]:
    """Return displacement (..., 2) in the frame at the start, and turn, of velocities (..., 3) over durations (...)."""
    turn = velocities[..., 2] * duration_s
    _, end = chords(velocities[..., 0] * duration_s, velocities[..., 1] * duration_s, turn)
    return np.stack(end, axis=-1), turn


def chords(forward_m: Array, left_m: Array, turn_rad: Array) -> tuple[Places, Places]:
    """Return x and y halfway and at the end, in the frame at the start, of paths along which the robot turns evenly.

    A chord points along the heading at the middle of its arc. Sine and cosine take most of a plan's time: those of a
    quarter of the turn make all others.
    """
    quarter = 0.25 * turn_rad
    sine, cosine = np.sin(quarter), np.cos(quarter)
    shorter = np.where(np.abs(quarter) < 1e-5, 1.0, sine / np.where(quarter == 0.0, 1.0, quarter))
    halfway = (
        0.5 * shorter * (cosine * forward_m - sine * left_m),
        0.5 * shorter * (sine * forward_m + cosine * left_m),
    )
    shorter, sine, cosine = shorter * cosine, 2.0 * sine * cosine, 1.0 - 2.0 * sine**2
    return halfway, (shorter * (cosine * forward_m - sine * left_m), shorter * (sine * forward_m + cosine * left_m))
