"""Ways to choose the next place to try: from a list at first, then from what is believed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.acquisition import LogExpectedImprovement, maximise
from vvvaltr.transfer.bayes.belief import Belief
from vvvaltr.transfer.bayes.refitting import EVERY_TRIAL
from vvvaltr.transfer.bayes.trials import Trials

INCUMBENT_DRAWS = 256
"""Random draws over which the expected best is averaged."""

INCUMBENT_PLACES, LATE_INCUMBENT_PLACES = 200, 60
"""Most places that the best is sought among: of more than these, those with the greatest posterior means. The second
holds once hyperparameters are no longer fitted after each trial: of many places, few may be the best."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """A place to try next.

    Args:
        x: place (d,) in the unit cube.
        origin: what proposed it, as the log and the screen name it.
        improvement: gain that is expected of it, in the unit of the score; infinite where the place was not chosen for
            an expected gain.
    """

    x: Array
    origin: str
    improvement: float = math.inf


Propose = Callable[[Trials, Belief | None, np.random.Generator], Proposal]
"""Chooses the next place from the trials told, what is believed after them, and a random stream."""

Choose = Callable[[Trials, Belief, np.random.Generator], Proposal]
"""The same, where something is believed already."""


def list_proposals(x: Iterable[Array], origin: str) -> list[Proposal]:
    """Return a proposal for each place (d,) of ``x``, all of the same origin."""
    return [Proposal(place, origin) for place in x]


def maximise_improvement(belief: Belief, rng: np.random.Generator, trials: int) -> Proposal:
    """Return the place with the greatest expected improvement over the expected best of the places seen.

    Args:
        belief: what is believed.
        rng: random stream.
        trials: number of trials told.
    """
    incumbent = expected_best(belief, rng, INCUMBENT_PLACES if trials <= EVERY_TRIAL else LATE_INCUMBENT_PLACES)
    acquisition = LogExpectedImprovement(belief.posterior, incumbent, belief.noise)
    x = maximise(acquisition, belief.promising(), rng, belief.draw)
    improvement = belief.scale.unit(incumbent) * math.exp(acquisition.value(x[None, :])[0])
    return Proposal(x, "expected improvement", improvement)


def begin_with(
    first: Sequence[Proposal],
    choose: Choose = lambda trials, belief, rng: maximise_improvement(belief, rng, len(trials)),
) -> Propose:
    """Return a way to propose ``first``, one a trial, and from then on what ``choose`` chooses.

    With nothing in ``first``, something must be believed before the first trial.
    """

    def propose(trials: Trials, belief: Belief | None, rng: np.random.Generator) -> Proposal:
        if len(trials) < len(first):
            return first[len(trials)]
        assert belief is not None  # learning begins with the first trial at the latest
        return choose(trials, belief, rng)

    return propose


def expected_best(belief: Belief, rng: np.random.Generator, most: int = INCUMBENT_PLACES) -> float:
    """Return the expected standardised score of the best place seen, as if the places' errors were independent.

    This exceeds the best posterior mean: any of the places may be better than its mean. The less is known of them, the
    higher is the mark that a new place must pass. A place out of bounds is judged at the nearest place within bounds.
    Of more than ``most`` places, those with the greatest posterior means are looked at.
    """
    places = np.clip(belief.seen, 0.0, 1.0)
    if len(places) > most:
        is_within = np.array_equal(places, belief.seen)
        means = belief.means if is_within else belief.posterior.predict_mean(places)
        places = places[np.argsort(-means, kind="stable")[:most]]
    mean, variance = belief.posterior.predict(places)
    draws = mean + np.sqrt(variance) * rng.normal(size=(INCUMBENT_DRAWS, len(mean)))
    return float(draws.max(axis=1).mean())
