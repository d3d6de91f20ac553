"""Random search: the control that shows what a model is worth."""

from __future__ import annotations

from functools import partial

import numpy as np

from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.transfer.bayes.belief import Belief, learn_alone
from vvvaltr.transfer.bayes.proposal import Proposal
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.methods.method import Method


class RandomSearch(Search):
    """Gaits drawn uniformly from the space. The recommendation is learned from them as in Plain-BO.

    Args:
        space: gaits to search.
        seed: seed of every random stream.
    """

    def __init__(self, space: GaitSpace, seed: int) -> None:
        def propose(trials: Trials, belief: Belief | None, rng: np.random.Generator) -> Proposal:
            return Proposal(rng.random(space.dimension), "random")

        super().__init__(space, seed, partial(learn_alone, space), propose)


METHOD = Method(
    "random",
    "a control: gaits drawn at random",
    uses_sources=False,
    make=lambda space, seed, _: RandomSearch(space, seed),
)
