"""Scores in the unit in which a model sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.types import Estimate

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Scale:
    """An affine map: score = centre + spread * standardised value."""

    centre: float
    spread: float

    @classmethod
    def of(cls, scores: Array) -> Scale:
        """Return the scale on which scores (n,), n >= 1, have mean 0 and variance 1.

        Scores that are all equal are measured in their own size, so that one score of 0.02 is not taken for 0.02 +- 1.
        """
        largest = float(np.abs(scores).max()) or 1.0
        centre, spread = float((scores / largest).mean()), float((scores / largest).std())
        return cls(largest * centre, largest * (spread if spread > 1e-9 else 1.0))

    def standardise(self, scores: Array) -> Array:
        """Return scores (n,) on this scale."""
        return np.asarray(scores / self.spread - self.centre / self.spread)

    def estimates(self, mean: Array, variance: Array) -> tuple[Estimate, ...]:
        """Return standardised means and variances (m,) as estimates in the unit of the scores, with 95 % intervals."""
        middle, half = self.centre + self.spread * mean, 1.96 * self.spread * np.sqrt(variance)
        return tuple(Estimate(float(m), float(m - h), float(m + h)) for m, h in zip(middle, half, strict=True))
