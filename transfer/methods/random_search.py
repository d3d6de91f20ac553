"""Random search: the control that shows what a model is worth."""

from __future__ import annotations

import numpy as np

from vvvaltr.controller.core.values import GaitSpace
from vvvaltr.transfer.bayes.belief import Belief, Trials
from vvvaltr.transfer.bayes.proposal import Proposal
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.methods.plain_bo import learned_alone


class RandomSearch(Search):
    """Gaits drawn evenly from the space; what to recommend is learned from them as Plain-BO learns.

    Args:
        space: the gaits to search.
        seed: of all that is random.
    """

    def __init__(self, space: GaitSpace, seed: int) -> None:
        def learn(trials: Trials, last: Belief | None, rng: np.random.Generator) -> Belief | None:
            return learned_alone(space, trials, last, rng) if len(trials) else None

        def propose(trials: Trials, belief: Belief | None, rng: np.random.Generator) -> Proposal:
            return Proposal(rng.random(space.dimension), "random")

        super().__init__(space, seed, learn, propose)
