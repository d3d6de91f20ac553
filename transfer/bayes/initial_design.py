"""The first trials, before a model can say anything: spread over the whole space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def initial_design(count: int, dimension: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return ``count`` places (count, dimension) of the unit cube, the best spread of many Latin hypercubes.

    A Latin hypercube (McKay et al. 1979) has one place in each of ``count`` equal slices of every axis; of 200 random
    ones the one whose closest two places are farthest apart is returned.

    Raises:
        ValueError: ``count`` is not positive.
    """
    if count < 1:
        raise ValueError(f"{count} places are no design: it needs at least one")
    cells = rng.permuted(np.tile(np.arange(count), (200, dimension, 1)), axis=2).transpose(0, 2, 1)
    designs = (cells + rng.random(cells.shape)) / count
    distances = np.linalg.norm(designs[:, :, None] - designs[:, None], axis=3)
    distances[:, np.arange(count), np.arange(count)] = np.inf
    return np.asarray(designs[np.argmax(distances.min(axis=(1, 2)))])
