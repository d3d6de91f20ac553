"""The scale on which a model sees scores."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Estimate

ALMOST_LINEAR = 1e4
"""Bend of a linear scale, in mean sizes of its scores."""

REACH = 100.0
"""Estimates and their intervals end at so many times the bend: what reaches further is not known at all."""


@dataclass(frozen=True, slots=True)
class Scale:
    """A map that is linear for small scores and logarithmic for large scores of either sign.

        score = bend * sinh(centre + spread * standardised value)

    The greater a robot's scores, the more they scatter. Beyond ``bend`` the map makes that scatter even.

    Args:
        bend: score at which the map turns from linear to logarithmic.
        centre: mean of arcsinh(score / bend).
        spread: standard deviation of arcsinh(score / bend).
    """

    bend: float
    centre: float
    spread: float

    @classmethod
    def of(cls, scores: Array) -> Scale:
        """Return the scale on which scores (n,), n >= 1, have mean 0 and variance 1; it bends at their mean size.

        Scores that are all equal are measured in their own size: one score of 0.02 does not mean 0.02 +- 1.
        """
        return cls._bent(scores, _size(scores))

    @classmethod
    def linear(cls, scores: Array) -> Scale:
        """Return the scale that does not bend near scores (n,), n >= 1: in effect an affine map."""
        return cls._bent(scores, ALMOST_LINEAR * _size(scores))

    @classmethod
    def _bent(cls, scores: Array, bend: float) -> Scale:
        values = np.arcsinh(scores / bend)
        centre, spread = float(values.mean()), float(values.std())
        return cls(bend, centre, spread if spread > 1e-9 * _size(values) else _size(values))

    def standardise(self, scores: Array) -> Array:
        """Return the standardised values (n,) of scores (n,)."""
        return np.asarray((np.arcsinh(scores / self.bend) - self.centre) / self.spread)

    def scores(self, standardised: Array) -> Array:
        """Return the scores (n,) at standardised values (n,)."""
        return np.asarray(self.bend * np.sinh(self.centre + self.spread * standardised))

    def unit(self, standardised: float = 0.0) -> float:
        """Return the derivative of the score with respect to the standardised value, at a standardised value."""
        return self.bend * self.spread * float(np.cosh(self.centre + self.spread * standardised))

    def estimates(
        self, mean: Array, variance: Array, noise_variance: Array | float, doubt: Array | float = 0.0
    ) -> tuple[Estimate, ...]:
        """Return estimates (m of them) of mean scores, averaged over the noise of a trial, with 95 % intervals.

        A value m with the noise variance n^2 has the mean score bend * sinh(m) * exp(n^2 / 2). If m itself has a normal
        distribution with variance s^2, its average is bend * sinh(E[m]) * exp((s^2 + n^2) / 2).

        Args:
            mean: means (m,) of the standardised values.
            variance: variances (m,) of the standardised values, without noise.
            noise_variance: noise variance of a standardised score, (m,) or one for all.
            doubt: variance (m,) to add for the intervals alone: uncertainty that the variances leave out.
        """
        middle, sd = self.centre + self.spread * mean, self.spread * np.sqrt(variance)
        factor = self.bend * np.exp(0.5 * self.spread**2 * noise_variance)
        means = factor * np.sinh(middle) * np.exp(0.5 * sd**2)
        half = 1.96 * self.spread * np.sqrt(variance + doubt)
        low, high = factor * np.sinh(middle - half), factor * np.sinh(middle + half)
        numbers = np.clip(np.stack([means, low, high], axis=1), -REACH * self.bend, REACH * self.bend)
        return tuple(Estimate(*each) for each in numbers.tolist())


def _size(values: Array) -> float:
    """Return the mean size of values (n,), 1 if all are 0. Dividing by the largest avoids over- and underflow."""
    largest = float(np.abs(values).max())
    return largest * float(np.abs(values / largest).mean()) if largest > 0.0 else 1.0
