"""A choice of good places that differ from each other."""

from __future__ import annotations

import math

import numpy as np

from vvvaltr.controller.core.arrays import Array

LEAST_SEPARATION = 0.1
"""Least distance between chosen places, as a share of the unit cube's diagonal."""


def spread_out(x: Array, values: Array, count: int) -> Array:
    """Return up to ``count`` of the places (n, d), the greatest of the values (n,) first, none near another."""
    chosen: list[Array] = []
    for place in x[np.argsort(-values, kind="stable")]:
        if all(np.linalg.norm(place - other) >= LEAST_SEPARATION * math.sqrt(x.shape[1]) for other in chosen):
            chosen.append(place)
        if len(chosen) == count:
            break
    return np.array(chosen)
