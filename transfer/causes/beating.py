"""Gaits that beat: two motors at nearly the same frequency, so that chance decides what the gait does.

Two vibrations of nearly the same frequency add up to one that swells and fades, as their phases meet and part. A trial
is too short to average over it, and nobody commands the phases. So repeats of such a gait scatter several times as much
as those of its neighbours, whose motors are a little apart, and its mean is another one than theirs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array

APART = 0.05
"""How far apart motors are put so that they do not beat; frequencies are in units of the greatest one."""

NEAR = 0.9 * APART
"""Motors that are nearer than this to each other beat."""

SLOW = 0.3
"""A motor that is slower than this shakes the robot too little to beat with another."""

LIKENESS = 0.65
"""Correlation of the score of a gait that beats with that of its neighbours that do not."""

SCATTER, GREATEST_SCATTER = 6.0, 18.0
"""Noise variance of a gait that beats, in units of that of other gaits: while gaits are chosen, and where one's speed
and interval are told, which rest on a few trials of it."""

Flags = NDArray[np.bool_]


def beat(u: Array) -> Flags:
    """Return for each of some gaits (m,) whether two of its motors beat, from their frequencies (m, f)."""
    size = np.abs(u)
    size.sort(axis=1)
    slower = size[:, :-1]
    return np.asarray(((size[:, 1:] - slower < NEAR) & (slower > SLOW)).any(axis=1))


def move_apart(u: Array, rng: np.random.Generator) -> Array:
    """Return frequencies (m, f) at which no two motors beat: of two that would, the slower one is slowed down.

    Of two that are equal, chance decides which.
    """
    order = np.lexsort((rng.random(u.shape), -np.abs(u)), axis=1)
    size = np.take_along_axis(np.abs(u), order, axis=1)
    for place in range(1, u.shape[1]):
        slower = np.maximum(np.minimum(size[:, place], size[:, place - 1] - APART), 0.0)
        size[:, place] = np.where(size[:, place] > SLOW, slower, size[:, place])
    apart = np.empty_like(size)
    np.put_along_axis(apart, order, size, axis=1)
    return np.asarray(np.copysign(apart, u))


def likeness(beats: Flags, others: Flags) -> Array:
    """Return the factor (m, n) of the correlation between gaits that beat or do not (m,) and others (n,)."""
    return np.where(beats[:, None] == others, 1.0, LIKENESS)
