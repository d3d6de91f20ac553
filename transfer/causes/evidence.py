"""Whether one gait is better than another, looked at after every round of trials without fooling oneself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array

_EFFECT_SD = 1.0  # of the mixture over effects, in standard deviations of a difference


@dataclass(frozen=True, slots=True)
class Difference:
    """A mean difference with an interval that holds at all times together, however often one looks."""

    mean: float
    low: float
    high: float

    @property
    def is_decided(self) -> bool:
        """Whether the interval lies on one side of 0."""
        return self.low > 0.0 or self.high < 0.0


def difference(values: Sequence[float], confidence: float) -> Difference:
    """Return the mean of paired differences with its interval at all times.

    The t-test by a mixture: with effects distributed as N(0, 1) in units of the standard deviation, and the right Haar
    prior of the latter, the ratio of the marginal likelihoods after n differences with the t statistic t is

        (1 + n)^(-1/2) * ((1 + t^2 / (n - 1)) / (1 + t^2 / ((1 + n) (n - 1))))^(n / 2)

    which exceeds 1 / alpha at any time with a probability of at most alpha where there is no difference (Perez-Ortiz,
    Lardy, de Heide, Gruenwald: E-statistics, group invariance and anytime-valid testing, 2022).

    Args:
        values: differences of two gaits' scores within a round, one a round.
        confidence: of the interval, for all times together.
    """
    n = len(values)
    mean = math.fsum(values) / n if n else math.nan
    if n < 2:
        return Difference(mean, -math.inf, math.inf)
    error = float(np.std(values, ddof=1)) / math.sqrt(n)
    half = _greatest_t(n, confidence) * error
    return Difference(mean, mean - half, mean + half)


def _greatest_t(n: int, confidence: float) -> float:
    """Return the t statistic at which the ratio of likelihoods reaches 1 / alpha; infinite where none does."""
    prior = n * _EFFECT_SD**2
    power = ((1.0 - confidence) * math.exp(-0.5 * math.log1p(prior))) ** (-2.0 / n)  # the ratio of squares needed
    if power >= 1.0 + prior:
        return math.inf
    return math.sqrt((n - 1) * (power - 1.0) / (1.0 - power / (1.0 + prior)))


def find_best(scores: Array | Sequence[Sequence[float]], confidence: float) -> int | None:
    """Return the gait that is better than all others, as an index; None while that is not clear.

    The chance to name any but the truly best one, ever, is at most 1 - confidence: each gait would have to beat the
    best one falsely, and the pairs share that chance.

    Args:
        scores: of each round and gait, shape (rounds, gaits).
        confidence: wanted.
    """
    scores = np.asarray(scores, dtype=float)
    rounds, gaits = scores.shape
    if rounds < 2 or gaits < 2:
        return None
    best = int(scores.mean(axis=0).argmax())
    each = 1.0 - (1.0 - confidence) / (gaits - 1)
    pairs = (difference((scores[:, best] - scores[:, other]).tolist(), each) for other in range(gaits) if other != best)
    return best if all(pair.low > 0.0 for pair in pairs) else None
