"""The first trials, spread over the whole space before a model can say anything."""

from __future__ import annotations

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.proposal import Proposal, list_proposals

HYPERCUBES = 200
"""Number of random Latin hypercubes to choose from."""


def initial_design(count: int, dimension: int, rng: np.random.Generator) -> Array:
    """Return ``count`` places (count, dimension) of the unit cube: the best spread of many Latin hypercubes.

    A Latin hypercube (McKay et al. 1979) has one place in each of ``count`` equal slices of every axis. Of 200 random
    ones, this is the one whose closest two places are farthest apart.

    Raises:
        ValueError: ``count`` is not positive.
    """
    if count < 1:
        raise ValueError(f"count is {count}: an initial design needs at least 1 place")
    cells = rng.permuted(np.tile(np.arange(count), (HYPERCUBES, dimension, 1)), axis=2).transpose(0, 2, 1)
    designs = (cells + rng.random(cells.shape)) / count
    distances = np.linalg.norm(designs[:, :, None] - designs[:, None], axis=3)
    distances[:, np.arange(count), np.arange(count)] = np.inf
    return np.asarray(designs[np.argmax(distances.min(axis=(1, 2)))])


def propose_design(count: int, dimension: int, rng: np.random.Generator) -> list[Proposal]:
    """Return the places of an initial design as proposals; see ``initial_design``."""
    return list_proposals(initial_design(count, dimension, rng), "initial design")
