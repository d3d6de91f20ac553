"""Optimism without a source: the control that shows how much of a gain is not transfer at all."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.transfer.bayes.belief import Belief, learn_alone
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.proposal import Proposal, maximise_improvement
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.methods.method import Method

OPTIMISM_SD = 2.0
"""Height of the raised prior mean above the scores' mean, in standard deviations of the scores."""


class Optimistic(Search):
    """Plain-BO that expects every unknown gait to be fast: it raises the prior mean while it chooses a trial.

    It therefore needs no trials spread over the space, and begins with a random gait. Its recommendation is made
    without optimism.

    Args:
        space: gaits to search.
        seed: seed of every random stream.
    """

    def __init__(self, space: GaitSpace, seed: int) -> None:
        def propose(trials: Trials, belief: Belief | None, rng: np.random.Generator) -> Proposal:
            if belief is None:
                return Proposal(rng.random(space.dimension), "random")
            return maximise_improvement(raise_prior_mean(belief, OPTIMISM_SD), rng, len(trials))

        super().__init__(space, seed, partial(learn_alone, space), propose)


def raise_prior_mean(belief: Belief, level: float) -> Belief:
    """Return the belief under a prior mean that is ``level`` standard deviations of the scores higher.

    The belief must rest on one Gaussian process. A constant prior mean is the same as observations that are lower by
    it, and a scale whose centre is higher by it.
    """
    process, scale = belief.posterior, belief.scale
    assert isinstance(process, GaussianProcess)
    posterior = process.with_values(process.observations.y - level)
    return replace(belief, posterior=posterior, scale=replace(scale, centre=scale.centre + level * scale.spread))


METHOD = Method(
    "optimistic",
    "a control: Plain-BO that expects every unknown gait to be fast, without a source",
    uses_sources=False,
    make=lambda space, seed, _: Optimistic(space, seed),
)
