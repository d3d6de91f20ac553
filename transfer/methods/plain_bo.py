"""Plain-BO: Bayesian optimisation without a source, the thesis' baseline."""

from __future__ import annotations

from functools import partial

from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.streams import stream
from vvvaltr.transfer.bayes.belief import learn_alone
from vvvaltr.transfer.bayes.initial_design import propose_design
from vvvaltr.transfer.bayes.proposal import begin_with
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.methods.method import Method

INITIAL_TRIALS = 8
"""Number of trials spread over the space before the model chooses."""


class PlainBO(Search):
    """A Gaussian process over the trials, and expected improvement one trial at a time.

    Args:
        space: gaits to search.
        seed: seed of every random stream.
        initial_trials: number of trials spread over the space before the model chooses, at least 1. It is a number and
            not a share of the budget, so that a run can be extended.

    Raises:
        ValueError: ``initial_trials`` is below 1.
    """

    def __init__(
        self, space: GaitSpace, seed: int, initial_trials: int = INITIAL_TRIALS, corrects: bool = True
    ) -> None:
        design = propose_design(initial_trials, space.dimension, stream(seed, 0, "initial design"))
        super().__init__(space, seed, partial(learn_alone, space), begin_with(design))


METHOD = Method(
    "plain",
    "Bayesian optimisation from nothing",
    uses_sources=False,
    make=lambda space, seed, _: PlainBO(space, seed),
)
