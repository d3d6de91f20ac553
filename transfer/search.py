"""Ask and tell around a model: what all methods share.

A method is two functions, one that learns from the trials and one that proposes a place. Both get all that they depend
on, so a search that is told a log of trials continues exactly like the one that ran them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.streams import stream
from controller.types import Estimate, Gait, GaitSpace, Recommendation, Suggestion
from transfer.acquisition import LogExpectedImprovement, Posterior, PosteriorMean, maximise
from transfer.gp import GaussianProcess, Hyperparameters, Observations, Prior, fit
from transfer.scale import Scale

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Trials:
    """What has been told, in order: places (n, d), outside of the unit cube where a gait was, and scores (n,)."""

    x: Array
    scores: Array

    def __len__(self) -> int:
        return len(self.scores)

    def followed_by(self, x: Array, score: float) -> Trials:
        """Return these trials and one more."""
        return Trials(np.vstack([self.x, x]), np.append(self.scores, score))


@dataclass(frozen=True, slots=True)
class Belief:
    """What has been learned.

    Args:
        posterior: of the standardised score, over the unit cube.
        scale: of the scores.
        seen: (k, d), k >= 1, the places whose scores the posterior rests on.
        logs: (d + 2,) logarithms of the process's hyperparameters, where the next fit starts.
        hyperparameters: the model's by name, in natural units.
    """

    posterior: Posterior
    scale: Scale
    seen: Array
    logs: Array
    hyperparameters: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Proposal:
    """A place (d,) of the unit cube to try next, and what proposed it."""

    x: Array
    origin: str


Learn = Callable[[Trials, Belief | None, np.random.Generator], Belief | None]
"""From the trials, what was believed before the last of them, and randomness, to what is believed now."""

Propose = Callable[[Trials, Belief | None, np.random.Generator], Proposal]
"""From the trials, what is believed, and randomness, to the next place."""

Incumbent = Callable[[Trials, Belief], float]
"""The standardised score that a new trial should improve upon."""


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
        expected = estimates(self._belief, proposal.x[None, :])[0]
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
        belief = self._told()
        x = maximise(PosteriorMean(belief.posterior), promising(belief), self._stream("recommendation"))
        return Recommendation(self._space.from_unit(x), estimates(belief, x[None, :])[0])

    def predict(self, gaits: Sequence[Gait]) -> tuple[Estimate, ...]:
        """Return posterior means of the gaits' true scores with 95 % intervals, which leave out the noise of a trial.

        Raises:
            ValueError: nothing has been told yet, or a gait has another number of motors.
        """
        return estimates(self._told(), places(self._space, gaits))

    def _told(self) -> Belief:
        if self._belief is None or not len(self._trials):
            raise ValueError("there is no trial to predict from yet: tell one first")
        return self._belief

    def _stream(self, purpose: str) -> np.random.Generator:
        return stream(self._seed, len(self._trials), purpose)


def expected_improvement(trials: Trials, belief: Belief, rng: np.random.Generator, incumbent: Incumbent) -> Proposal:
    """Return the place of the greatest expected improvement."""
    acquisition = LogExpectedImprovement(belief.posterior, incumbent(trials, belief))
    return Proposal(maximise(acquisition, promising(belief), rng), "expected improvement")


def best_mean(trials: Trials, belief: Belief) -> float:
    """Return the greatest posterior mean at a seen place: under noise it wastes fewer trials on bad gaits."""
    return float(belief.posterior.predict(belief.seen)[0].max())


def best_observation(trials: Trials, belief: Belief) -> float:
    """Return the greatest standardised score: better than ``best_mean`` where there is hardly any noise."""
    return float(belief.scale.standardise(trials.scores).max())


def promising(belief: Belief, count: int = 5) -> Array:
    """Return the seen places (k, d), k <= count, of the greatest posterior mean."""
    mean, _ = belief.posterior.predict(belief.seen)
    return np.asarray(belief.seen[np.argsort(-mean, kind="stable")[:count]])


def refitted(observations: Observations, last: Belief | None, trials: int, rng: np.random.Generator) -> GaussianProcess:
    """Return the process fitted from the prior's mean and from the last optimum, at every fifth trial also at random.

    The last optimum alone gets stuck where the first few trials led it.
    """
    prior = Prior.of(observations.x.shape[1])
    starts = [prior.mean] if last is None else [prior.mean, last.logs]
    if trials % 5 == 0:
        starts.append(rng.normal(prior.mean, prior.sd))
    return fit(observations, prior, starts)


def named(space: GaitSpace, scale: Scale, hyperparameters: Hyperparameters) -> dict[str, float]:
    """Return hyperparameters by name: length scales in the parameters' units, deviations in the unit of the score."""
    lengths = {
        f"length_scale_{parameter.name}": float(length) * (parameter.high - parameter.low)
        for parameter, length in zip(space.parameters, hyperparameters.length_scale, strict=True)
    }
    return lengths | {
        "signal_sd": scale.spread * math.sqrt(hyperparameters.signal_variance),
        "noise_sd": scale.spread * math.sqrt(hyperparameters.noise_variance),
    }


def estimates(belief: Belief, x: Array) -> tuple[Estimate, ...]:
    """Return what is believed of the true scores at places (m, d)."""
    return belief.scale.estimates(*belief.posterior.predict(x))


def places(space: GaitSpace, gaits: Sequence[Gait]) -> Array:
    """Return the gaits' places (m, d) in the unit cube; outside of it where a gait is out of bounds.

    Raises:
        ValueError: a gait has another number of motors than the space.
    """
    for gait in gaits:
        if gait.motor_count != space.motor_count:
            raise ValueError(f"gait {gait} is for {gait.motor_count} motors, the robot has {space.motor_count}")
    return np.array([space.to_unit(gait) for gait in gaits]).reshape(-1, space.dimension)
