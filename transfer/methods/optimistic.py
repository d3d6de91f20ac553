"""Optimism without a source: the control that shows how much of a gain is transfer at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vvvaltr.controller.core.values import GaitSpace
from vvvaltr.transfer.bayes.belief import Belief, Trials
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.proposal import Proposal, expected_improvement
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.methods.plain_bo import learned_alone

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
            return expected_improvement(raised(belief, OPTIMISM), rng)

        super().__init__(space, seed, learn, propose)


def raised(belief: Belief, level: float) -> Belief:
    """Return the belief that would be held, had the middle of the scale been ``level`` standard deviations higher."""
    process, scale = belief.posterior, belief.scale
    assert isinstance(process, GaussianProcess)
    observations = replace(process.observations, y=process.observations.y - level)
    posterior = GaussianProcess.conditioned(observations, process.hyperparameters)
    return replace(belief, posterior=posterior, scale=replace(scale, centre=scale.centre + level * scale.spread))
