"""Warm start: the best gaits of earlier runs first, then Plain-BO."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.bayes.belief import learn_alone
from vvvaltr.transfer.bayes.earlier_run import learn_sources, propose_best
from vvvaltr.transfer.bayes.initial_design import propose_design
from vvvaltr.transfer.bayes.proposal import begin_with
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.methods.method import Method
from vvvaltr.transfer.methods.plain_bo import INITIAL_TRIALS


class WarmStart(Search):
    """Plain-BO that tries the sources' best gaits first, well apart; fewer trials are then spread over the space.

    Nothing else of the sources is used, so neither their unit nor their noise matters.

    Args:
        space: gaits to search.
        seed: seed of every random stream.
        sources: earlier runs, at least one.

    Raises:
        ValueError: there is no source, or one has another number of motors than the space.
    """

    def __init__(self, space: GaitSpace, seed: int, sources: Sequence[Source]) -> None:
        warm = propose_best(learn_sources(space, seed, sources))
        cold = propose_design(INITIAL_TRIALS - len(warm), space.dimension, stream(seed, 0, "initial design"))
        super().__init__(space, seed, partial(learn_alone, space), begin_with([*warm, *cold]))


METHOD = Method(
    "warm",
    "Plain-BO that begins with the sources' best gaits",
    uses_sources=True,
    make=WarmStart,
)
