"""Ways to choose the next place from what is believed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transfer.acquisition import LogExpectedImprovement, maximise
from transfer.belief import Belief, Trials


@dataclass(frozen=True, slots=True)
class Proposal:
    """A place (d,) of the unit cube to try next, and what proposed it.

    ``improvement`` is the standardised score that it is expected to gain, infinite where it was not chosen for that.
    """

    x: NDArray[np.float64]
    origin: str
    improvement: float = math.inf


Incumbent = Callable[[Trials, Belief], float]
"""The standardised score that a new trial should improve upon."""


def expected_improvement(trials: Trials, belief: Belief, rng: np.random.Generator, incumbent: Incumbent) -> Proposal:
    """Return the place of the greatest expected improvement."""
    acquisition = LogExpectedImprovement(belief.posterior, incumbent(trials, belief), belief.noise_variance)
    x = maximise(acquisition, belief.promising(), rng)
    return Proposal(x, "expected improvement", math.exp(acquisition.value(x[None, :])[0]))


def best_mean(trials: Trials, belief: Belief) -> float:
    """Return the greatest posterior mean at a seen place: under noise it drives fewer bad gaits."""
    return float(belief.posterior.predict(belief.seen)[0].max())


def best_observation(trials: Trials, belief: Belief) -> float:
    """Return the greatest standardised score, which under noise is a lucky one: it explores more."""
    return float(belief.scale.standardise(trials.scores).max())
