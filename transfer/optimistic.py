"""Optimism without a source: the control that shows how much of a gain is transfer at all."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from controller.types import GaitSpace
from transfer.acquisition import Posterior
from transfer.belief import Belief, Trials
from transfer.gp import GaussianProcess
from transfer.plain_bo import learned_alone
from transfer.proposal import Proposal, best_mean, expected_improvement
from transfer.search import Search

Array = NDArray[np.float64]

OPTIMISM = 2.0
"""By how many standard deviations of the scores the prior mean is raised above their mean."""


class Optimistic(Search):
    """Plain-BO that takes what is unknown for fast: its prior mean is raised while it chooses a trial.

    So it leaves out the trials that Plain-BO spreads over the space, and begins anywhere. What it recommends is
    believed without optimism.

    Args:
        space: the gaits to search.
        seed: of all that is random.
    """

    def __init__(self, space: GaitSpace, seed: int) -> None:
        def learn(trials: Trials, last: Belief | None, rng: np.random.Generator) -> Belief | None:
            return learned_alone(space, trials, last, rng) if len(trials) else None

        def propose(trials: Trials, belief: Belief | None, rng: np.random.Generator) -> Proposal:
            if belief is None:
                return Proposal(rng.random(space.dimension), "random")
            return expected_improvement(trials, raised(belief, OPTIMISM), rng, best_mean)

        super().__init__(space, seed, learn, propose)


@dataclass(frozen=True, slots=True)
class Raised:
    """The posterior under a prior mean of ``level`` instead of 0; ``process`` has been told scores less ``level``."""

    process: GaussianProcess
    level: float

    def predict(self, x: Array) -> tuple[Array, Array]:
        """See ``Posterior``."""
        mean, variance = self.process.predict(x)
        return mean + self.level, variance

    def predict_with_gradient(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """See ``Posterior``."""
        mean, variance, mean_gradient, variance_gradient = self.process.predict_with_gradient(x)
        return mean + self.level, variance, mean_gradient, variance_gradient


def raised(belief: Belief, level: float) -> Belief:
    """Return the belief that would be held, had the prior mean been ``level`` standard deviations higher."""
    process = belief.posterior
    assert isinstance(process, GaussianProcess)
    observations = replace(process.observations, y=process.observations.y - level)
    posterior: Posterior = Raised(GaussianProcess.conditioned(observations, process.hyperparameters), level)
    return replace(belief, posterior=posterior)
