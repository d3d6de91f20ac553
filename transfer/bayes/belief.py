"""What a method has been told and what it believes: the values that learning and proposing pass to each other."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Estimate, GaitSpace
from vvvaltr.transfer.bayes.acquisition import Posterior
from vvvaltr.transfer.bayes.gp import GaussianProcess, Hyperparameters, Observations, Prior, fit
from vvvaltr.transfer.bayes.scale import Scale

MODEL_DOUBT_TRIALS = 15.0
"""Number of trials at which the model's own error is as large as the error it predicts; measured, docs/learning.md."""

RANDOM_START_EVERY = 5
"""Every so many trials the hyperparameters are fitted from a random start as well."""


@dataclass(frozen=True, slots=True)
class Trials:
    """The trials told so far, in order.

    Args:
        x: places (n, d) of the gaits, outside the unit cube where a gait is out of bounds.
        scores: scores (n,).
    """

    x: Array
    scores: Array

    @classmethod
    def none(cls, space: GaitSpace) -> Trials:
        """Return no trials of gaits in a space."""
        return cls(np.empty((0, space.dimension)), np.empty(0))

    def __len__(self) -> int:
        return len(self.scores)

    def add(self, x: Array, score: float) -> Trials:
        """Return these trials and one more, of the place (d,)."""
        return Trials(np.vstack([self.x, x]), np.append(self.scores, score))


@dataclass(frozen=True, slots=True)
class Belief:
    """What has been learned.

    Args:
        posterior: posterior of the standardised score over the unit cube.
        scale: scale that the scores are standardised by.
        noise_variance: noise variance of a new trial's standardised score.
        seen: places (k, d), k >= 1, whose scores the posterior rests on.
        logs: natural logarithms (d + 2,) of the process's hyperparameters, where the next fit starts.
        hyperparameters: hyperparameters by name, in natural units, for log and screen.
    """

    posterior: Posterior
    scale: Scale
    noise_variance: float
    seen: Array
    logs: Array
    hyperparameters: Mapping[str, float]

    @classmethod
    def of(cls, process: GaussianProcess, scale: Scale, space: GaitSpace) -> Belief:
        """Return the belief that rests on one process of standardised scores."""
        fit = process.hyperparameters
        names = name_hyperparameters(space, scale, fit)
        return cls(process, scale, fit.noise_variance, process.observations.x, fit.logs, names)

    def estimates(self, x: Array) -> tuple[Estimate, ...]:
        """Return estimates of the true mean scores at places (m, d), with 95 % intervals.

        The posterior treats scale and hyperparameters as known. The intervals are widened to make up for it, the more
        the fewer trials there are.
        """
        widening = math.sqrt(1.0 + MODEL_DOUBT_TRIALS / len(self.seen))
        return self.scale.estimates(*self.posterior.predict(x), self.noise_variance, widening)

    def promising(self, count: int = 5) -> Array:
        """Return the places seen (k, d), k <= count, that have the greatest posterior means, the greatest first."""
        mean, _ = self.posterior.predict(self.seen)
        return np.asarray(self.seen[np.argsort(-mean, kind="stable")[:count]])


def refit(observations: Observations, last: Belief | None, trials: int, rng: np.random.Generator) -> GaussianProcess:
    """Return the process with hyperparameters fitted from the prior's mean and from the last optimum.

    Every fifth trial the fit also starts at a random place: from the last optimum alone it gets stuck where the first
    few trials led it.

    Args:
        observations: observations to fit, at least one.
        last: belief whose hyperparameters are the last optimum; None for the first fit.
        trials: number of trials told.
        rng: random stream of the random start.
    """
    prior = Prior.of(observations.x.shape[1])
    starts = [prior.mean] if last is None else [prior.mean, last.logs]
    if trials % RANDOM_START_EVERY == 0:
        starts.append(rng.normal(prior.mean, prior.sd))
    return fit(observations, prior, starts)


def learn_alone(space: GaitSpace, trials: Trials, last: Belief | None, rng: np.random.Generator) -> Belief:
    """Return what one or more trials say by themselves, without any source."""
    scale = Scale.of(trials.scores)
    observations = Observations.alike(trials.x, scale.standardise(trials.scores))
    return Belief.of(refit(observations, last, len(trials), rng), scale, space)


def name_hyperparameters(space: GaitSpace, scale: Scale, hyperparameters: Hyperparameters) -> dict[str, float]:
    """Return hyperparameters by name: length scales in the parameters' units, deviations in the unit of the score."""
    lengths = {
        f"length_scale_{parameter.name}": float(length) * (parameter.high - parameter.low)
        for parameter, length in zip(space.parameters, hyperparameters.length_scale, strict=True)
    }
    return lengths | {
        "signal_sd": scale.unit() * math.sqrt(hyperparameters.signal_variance),
        "noise_sd": scale.unit() * math.sqrt(hyperparameters.noise_variance),
    }
