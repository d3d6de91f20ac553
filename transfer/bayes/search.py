"""Ask and tell around a model: what all methods share.

A method is two functions, one that learns from the trials and one that proposes a place. Both get all that they depend
on, so a search that is told a log of trials continues exactly like the one that ran them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Estimate, Gait, GaitSpace, Recommendation, Suggestion
from vvvaltr.transfer.bayes.acquisition import SCAN, PosteriorMean, maximise
from vvvaltr.transfer.bayes.belief import Belief, Trials
from vvvaltr.transfer.bayes.proposal import Proposal
from vvvaltr.transfer.bayes.spread import spread_out

Array = NDArray[np.float64]

Learn = Callable[[Trials, Belief | None, np.random.Generator], Belief | None]
"""From the trials, what was believed before the last of them, and randomness, to what is believed now."""

Propose = Callable[[Trials, Belief | None, np.random.Generator], Proposal]
"""From the trials, what is believed, and randomness, to the next place."""


class Search:
    """An ``Optimizer`` made of a way to learn and a way to propose.

    Learning takes place in ``tell``, so that nothing depends on how often ``ask`` was called; randomness depends on the
    seed and the number of trials told, and on nothing else.
    """

    def __init__(self, space: GaitSpace, seed: int, learn: Learn, propose: Propose) -> None:
        self._space, self._seed, self._learn, self._propose = space, seed, learn, propose
        self._trials = Trials(np.empty((0, space.dimension)), np.empty(0))
        self._belief = learn(self._trials, None, self._stream("hyperparameters"))

    def ask(self) -> Suggestion:
        """Return the gait to try next; the same one until a trial is told."""
        proposal = self._propose(self._trials, self._belief, self._stream("proposal"))
        gait = self._space.from_unit(proposal.x)
        if self._belief is None:
            return Suggestion(gait, proposal.origin)
        expected = self._belief.estimates(proposal.x[None, :])[0]
        return Suggestion(gait, proposal.origin, expected, self._belief.hyperparameters)

    def tell(self, gait: Gait, score: float) -> None:
        """Learn from one valid trial, also of a gait that was not asked for or is out of bounds.

        Raises:
            ValueError: the score is not finite, or the gait has another number of motors.
        """
        if not math.isfinite(score):
            raise ValueError(f"score {score} of gait {gait} is not finite: tell only valid trials")
        self._trials = self._trials.followed_by(places(self._space, [gait])[0], score)
        self._belief = self._learn(self._trials, self._belief, self._stream("hyperparameters"))

    def recommend(self) -> Recommendation:
        """Return the gait whose posterior mean is greatest, with the 95 % interval of its true mean score.

        Raises:
            ValueError: nothing has been told yet.
        """
        x, belief = self._best(), self._told()
        return Recommendation(self._space.from_unit(x), belief.estimates(x[None, :])[0])

    def predict(self, gaits: Sequence[Gait]) -> tuple[Estimate, ...]:
        """Return posterior means of the gaits' true scores with 95 % intervals, which leave out the noise of a trial.

        Raises:
            ValueError: nothing has been told yet, or a gait has another number of motors.
        """
        return self._told().estimates(places(self._space, gaits))

    def promising(self, count: int) -> tuple[Gait, ...]:
        """Return up to ``count`` gaits of great posterior mean, the recommended one first, none near another.

        Raises:
            ValueError: nothing has been told yet.
        """
        others = np.concatenate([self._told().seen, self._stream("promising").random((SCAN, self._space.dimension))])
        x = np.vstack([self._best(), np.clip(others, 0.0, 1.0)])
        chosen = spread_out(x, np.append(np.inf, self._told().posterior.predict(x[1:])[0]), count)
        return tuple(map(self._space.from_unit, chosen))

    def improvement(self) -> float:
        """Return what the next suggestion is expected to gain over the best known gait, in the unit of the score.

        Infinite while trials are not chosen for that.
        """
        return self._propose(self._trials, self._belief, self._stream("proposal")).improvement

    def _best(self) -> Array:
        """Return the place (d,) of the greatest posterior mean."""
        belief = self._told()
        return maximise(PosteriorMean(belief.posterior), belief.promising(), self._stream("recommendation"))

    def _told(self) -> Belief:
        if self._belief is None or not len(self._trials):
            raise ValueError("there is no trial to predict from yet: tell one first")
        return self._belief

    def _stream(self, purpose: str) -> np.random.Generator:
        return stream(self._seed, len(self._trials), purpose)


def places(space: GaitSpace, gaits: Sequence[Gait]) -> Array:
    """Return the gaits' places (m, d) in the unit cube; outside of it where a gait is out of bounds.

    Raises:
        ValueError: a gait has another number of motors than the space.
    """
    for gait in gaits:
        if gait.motor_count != space.motor_count:
            raise ValueError(f"gait {gait} is for {gait.motor_count} motors, the robot has {space.motor_count}")
    return np.array([space.to_unit(gait) for gait in gaits]).reshape(-1, space.dimension)
