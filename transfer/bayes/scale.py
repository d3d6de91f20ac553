"""Scores in the unit in which a model sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Estimate

ALMOST_LINEAR = 1e4


@dataclass(frozen=True, slots=True)
class Scale:
    """A map that is linear for small scores and logarithmic for large ones of either sign.

        score = bend * sinh(centre + spread * standardised value)

    A robot's scores scatter the more the greater they are; beyond ``bend`` the map makes that scatter even.
    """

    bend: float
    centre: float
    spread: float

    @classmethod
    def of(cls, scores: Array) -> Scale:
        """Return the scale that bends at the mean size of scores (n,), n >= 1; on it they have mean 0 and variance 1.

        Scores that are all equal are measured in their own size, so that one score of 0.02 is not taken for 0.02 +- 1.
        """
        return cls._bent(scores, _size(scores))

    @classmethod
    def linear(cls, scores: Array) -> Scale:
        """Return the scale that does not bend within reach of scores (n,), n >= 1: an affine map."""
        return cls._bent(scores, ALMOST_LINEAR * _size(scores))

    @classmethod
    def _bent(cls, scores: Array, bend: float) -> Scale:
        values = np.arcsinh(scores / bend)
        centre, spread = float(values.mean()), float(values.std())
        return cls(bend, centre, spread if spread > 1e-9 * _size(values) else _size(values))

    def standardise(self, scores: Array) -> Array:
        """Return scores (n,) on this scale."""
        return np.asarray((np.arcsinh(scores / self.bend) - self.centre) / self.spread)

    def scores(self, standardised: Array) -> Array:
        """Return the scores (n,) at standardised values (n,)."""
        return np.asarray(self.bend * np.sinh(self.centre + self.spread * standardised))

    def unit(self, standardised: float = 0.0) -> float:
        """Return how much the score grows with the standardised value there; without one, in the middle."""
        return self.bend * self.spread * float(np.cosh(self.centre + self.spread * standardised))

    def estimates(
        self, mean: Array, variance: Array, noise_variance: float, widening: float = 1.0
    ) -> tuple[Estimate, ...]:
        """Return beliefs about means of scores over their noise, with 95 % intervals.

        A value m with the noise variance n^2 has the mean score bend * sinh(m) * exp(n^2 / 2), and if m is itself
        normal with variance s^2 this is bend * sinh(E[m]) * exp((s^2 + n^2) / 2) on average.

        Args:
            mean: (m,) of the standardised values.
            variance: (m,) of the same, without noise.
            noise_variance: of a standardised score.
            widening: factor of the interval's width, for what else is uncertain.
        """
        middle, sd = self.centre + self.spread * mean, self.spread * np.sqrt(variance)
        factor = self.bend * np.exp(0.5 * self.spread**2 * noise_variance)
        means = factor * np.sinh(middle) * np.exp(0.5 * sd**2)
        half = 1.96 * widening * sd
        low, high = factor * np.sinh(middle - half), factor * np.sinh(middle + half)
        return tuple(Estimate(*numbers) for numbers in np.stack([means, low, high], axis=1).tolist())


def _size(values: Array) -> float:
    """Return the mean size of values (n,), 1 if all are 0; found so that it neither over- nor underflows."""
    largest = float(np.abs(values).max())
    return largest * float(np.abs(values / largest).mean()) if largest > 0.0 else 1.0
