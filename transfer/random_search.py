"""Random search: the control that shows what a model is worth."""

from __future__ import annotations

import numpy as np

from controller.types import GaitSpace
from transfer.belief import Belief, Trials
from transfer.plain_bo import learned_alone
from transfer.proposal import Proposal
from transfer.search import Search


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
