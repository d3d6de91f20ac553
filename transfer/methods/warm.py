"""Warm start: the best gaits of earlier runs first, then Plain-BO."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import GaitSpace, Source
from vvvaltr.transfer.bayes.belief import Belief, Trials
from vvvaltr.transfer.bayes.earlier_run import best_of_all, learned_from
from vvvaltr.transfer.bayes.initial_design import initial_design
from vvvaltr.transfer.bayes.proposal import Proposal, expected_improvement
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.methods.plain_bo import INITIAL_TRIALS, learned_alone

WARM_TRIALS = 3


class WarmStart(Search):
    """Plain-BO whose first trials are the sources' best gaits, well apart; fewer are spread over the space after them.

    Nothing else of the sources is used, so that neither their unit nor their noise matters.

    Args:
        space: the gaits to search.
        seed: of all that is random.
        sources: one or more earlier runs.

    Raises:
        ValueError: there is no source, or one has another number of motors.
    """

    def __init__(self, space: GaitSpace, seed: int, sources: Sequence[Source]) -> None:
        warm = best_of_all(learned_from(space, seed, sources), WARM_TRIALS)
        cold = initial_design(INITIAL_TRIALS - len(warm), space.dimension, stream(seed, 0, "initial design"))

        def learn(trials: Trials, last: Belief | None, rng: np.random.Generator) -> Belief | None:
            return learned_alone(space, trials, last, rng) if len(trials) else None

        def propose(trials: Trials, belief: Belief | None, rng: np.random.Generator) -> Proposal:
            if len(trials) < len(warm):
                return Proposal(warm[len(trials)], "best of source")
            if belief is None or len(trials) < INITIAL_TRIALS:
                return Proposal(cold[len(trials) - len(warm)], "initial design")
            return expected_improvement(belief, rng)

        super().__init__(space, seed, learn, propose)
