"""Ways to choose the next place from what is believed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vvvaltr.transfer.bayes.acquisition import LogExpectedImprovement, maximise
from vvvaltr.transfer.bayes.belief import Belief

DRAWS = 256


@dataclass(frozen=True, slots=True)
class Proposal:
    """A place (d,) of the unit cube to try next, and what proposed it.

    ``improvement`` is the score that it is expected to gain, infinite where it was not chosen for that.
    """

    x: NDArray[np.float64]
    origin: str
    improvement: float = math.inf


def expected_improvement(belief: Belief, rng: np.random.Generator) -> Proposal:
    """Return the place of the greatest expected improvement over the expected best seen place."""
    incumbent = expected_best(belief, rng)
    acquisition = LogExpectedImprovement(belief.posterior, incumbent, belief.noise_variance)
    x = maximise(acquisition, belief.promising(), rng)
    improvement = belief.scale.unit(incumbent) * math.exp(acquisition.value(x[None, :])[0])
    return Proposal(x, "expected improvement", improvement)


def expected_best(belief: Belief, rng: np.random.Generator) -> float:
    """Return the expected standardised score of the best seen place, as if what is unknown of each were independent.

    One of them may well be better than the best mean: the less is known of them, the further a new place must reach. A
    place out of bounds counts as the nearest in them.
    """
    mean, variance = belief.posterior.predict(np.clip(belief.seen, 0.0, 1.0))
    draws = mean + np.sqrt(variance) * rng.normal(size=(DRAWS, len(mean)))
    return float(draws.max(axis=1).mean())
