"""Plain-BO: Bayesian optimisation from nothing, the thesis' baseline."""

from __future__ import annotations

import numpy as np

from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import GaitSpace
from vvvaltr.transfer.bayes.belief import Belief, Trials, refitted
from vvvaltr.transfer.bayes.gp import Observations
from vvvaltr.transfer.bayes.initial_design import initial_design
from vvvaltr.transfer.bayes.proposal import Proposal, expected_improvement
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.search import Search

INITIAL_TRIALS = 8


class PlainBO(Search):
    """A Gaussian process over the trials, and expected improvement one trial at a time.

    Args:
        space: the gaits to search.
        seed: of all that is random.
        initial_trials: how many trials are spread over the space before the model chooses, at least 1. Not a share of
            the budget, so that a run can be extended.
    """

    def __init__(self, space: GaitSpace, seed: int, initial_trials: int = INITIAL_TRIALS) -> None:
        design = initial_design(initial_trials, space.dimension, stream(seed, 0, "initial design"))

        def learn(trials: Trials, last: Belief | None, rng: np.random.Generator) -> Belief | None:
            return learned_alone(space, trials, last, rng) if len(trials) else None

        def propose(trials: Trials, belief: Belief | None, rng: np.random.Generator) -> Proposal:
            if belief is None or len(trials) < initial_trials:
                return Proposal(design[len(trials)], "initial design")
            return expected_improvement(belief, rng)

        super().__init__(space, seed, learn, propose)


def learned_alone(space: GaitSpace, trials: Trials, last: Belief | None, rng: np.random.Generator) -> Belief:
    """Return what one or more trials say by themselves."""
    scale = Scale.of(trials.scores)
    observations = Observations.alike(trials.x, scale.standardise(trials.scores))
    return Belief.of(refitted(observations, last, len(trials), rng), scale, space)
