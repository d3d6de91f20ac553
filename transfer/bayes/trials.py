"""The trials of a run as a model sees them: places, scores, and how much noise each score has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.transfer.bayes.kernel import Observations
from vvvaltr.transfer.bayes.scale import Scale


@dataclass(frozen=True, slots=True)
class Trials:
    """Trials in order.

    Args:
        x: places (n, d) of the gaits, outside the unit cube where a gait is out of bounds.
        scores: scores (n,).
        share: share (n,) of a trial's noise variance that each score has: 1 / k for the mean of k trials.
    """

    x: Array
    scores: Array
    share: Array | float = 1.0

    @classmethod
    def none(cls, space: GaitSpace) -> Trials:
        """Return no trials of gaits in a space."""
        return cls(np.empty((0, space.dimension)), np.empty(0))

    def __len__(self) -> int:
        return len(self.scores)

    @property
    def shares(self) -> Array:
        """The share of each score, (n,)."""
        return np.asarray(np.ones(len(self)) * self.share)

    def then(self, later: Trials) -> Trials:
        """Return these trials and later ones."""
        share = 1.0 if self.share is later.share == 1.0 else np.append(self.shares, later.shares)
        return Trials(np.vstack([self.x, later.x]), np.append(self.scores, later.scores), share)

    def begin_with(self, first: Trials) -> bool:
        """Whether ``first`` are the first of these trials, whatever their scores."""
        count = len(first)
        return np.array_equal(self.x[:count], first.x) and np.array_equal(self.shares[:count], first.shares)

    def part(self, which: slice | Sequence[int] | np.ndarray) -> Trials:
        """Return some of the trials."""
        return Trials(self.x[which], self.scores[which], self.shares[which])

    def observe(self, scale: Scale) -> Observations:
        """Return the trials as observations of one function, with the learned noise variance and no other noise."""
        return Observations(self.x, scale.standardise(self.scores), np.zeros(len(self)), self.shares)
