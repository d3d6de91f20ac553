"""What a method has been told and what it believes: the values that learning and proposing pass to each other."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.values import Estimate
from vvvaltr.transfer.bayes.acquisition import Draw, Posterior, draw_uniformly
from vvvaltr.transfer.bayes.drive import Drive
from vvvaltr.transfer.bayes.fitting import Prior, fit
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import Hyperparameters, Observations
from vvvaltr.transfer.bayes.refitting import Fitted, follow
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.causes.beating import GREATEST_SCATTER, SCATTER

MODEL_DOUBT_TRIALS = 15.0
"""Number of trials at which the model's own error is as large as the error it predicts; measured, docs/learning.md."""

ROUGHNESS = 0.25
"""Share of the learned noise that is taken to belong to a gait, and so to its true mean score; docs/learning.md."""

RANDOM_START_EVERY = 5
"""Every so many trials the hyperparameters are fitted from a random start as well."""

LARGEST = 1e9
"""Hyperparameters of a log beyond this, or below its inverse, were not fitted by this program."""


@dataclass(frozen=True)
class Belief:
    """What has been learned.

    Args:
        posterior: posterior of the standardised score over the unit cube.
        scale: scale that the scores are standardised by.
        noise_variance: noise variance of a new trial's standardised score; see ``noise``.
        seen: places (k, d), k >= 1, whose scores the posterior rests on.
        hyperparameters: hyperparameters by name, in natural units, for log and screen.
        fitted: what learning goes on from after the next trial; None where it begins anew.
        drive: drive of the space, where something is expected of it.
    """

    posterior: Posterior
    scale: Scale
    noise_variance: float
    seen: Array
    hyperparameters: Mapping[str, float]
    fitted: Fitted | None = None
    drive: Drive | None = None

    @classmethod
    def of(cls, process: GaussianProcess, scale: Scale, space: GaitSpace, fitted: Fitted | None = None) -> Belief:
        """Return the belief that rests on one process of standardised scores."""
        names = name_hyperparameters(space, scale, process.hyperparameters)
        noise_variance = process.hyperparameters.noise_variance
        return cls(process, scale, noise_variance, process.observations.x, names, fitted)

    def estimates(self, x: Array) -> tuple[Estimate, ...]:
        """Return estimates of the true mean scores at places (m, d), with 95 % intervals.

        The posterior treats scale and hyperparameters as known. The intervals are widened to make up for it, the more
        the fewer trials there are. They are also widened by a share of the noise: to the model, that is whatever it
        cannot follow from gait to gait, so it is not the scatter of repeats alone. The mean over the noise of a gait
        that beats grows with its scatter, of which a few trials say too little to let it count in full.
        """
        mean, variance = self.posterior.predict(x)
        known = min(1.0, len(self.seen) / MODEL_DOUBT_TRIALS)
        noise = self.noise(x, SCATTER + known * (GREATEST_SCATTER - SCATTER))
        doubt = MODEL_DOUBT_TRIALS / len(self.seen) * variance + ROUGHNESS * self.noise(x, GREATEST_SCATTER)
        return self.scale.estimates(mean, variance, noise, doubt)

    def noise(self, x: Array, scatter: float = SCATTER) -> Array | float:
        """Return the noise variance of a trial's standardised score at places (m, d): (m,), or one for all of them.

        That of gaits that beat is ``scatter`` times that of others.
        """
        return self.noise_variance * (1.0 if self.drive is None else self.drive.noise(x, scatter))

    @property
    def draw(self) -> Draw:
        """How random places are drawn to seek the best one among."""
        return draw_uniformly if self.drive is None else self.drive.draw

    def promising(self, count: int = 5) -> Array:
        """Return the places seen (k, d), k <= count, that have the greatest posterior means, the greatest first."""
        return np.asarray(self.seen[np.argsort(-self.means, kind="stable")[:count]])

    @cached_property
    def means(self) -> Array:
        """Posterior means (k,) at the places seen."""
        return self.posterior.predict_mean(self.seen)


def refit(
    observations: Observations, last: Fitted | None, trials: int, rng: np.random.Generator, follows: bool = False
) -> GaussianProcess:
    """Return the process with hyperparameters fitted from the prior's mean and from the last optimum.

    Every fifth trial the fit also starts at a random place: from the last optimum alone it gets stuck where the first
    few trials led it. A fit of these very trials, from the log, is not made again.

    Args:
        observations: observations to fit, at least one.
        last: the last fit; None for the first.
        trials: number of trials told.
        rng: random stream of the random start.
        follows: whether the fit starts at the prior's mean every fifth trial only, which saves half of its time.
    """
    prior, is_thorough = Prior.of(observations.x.shape[1]), trials % RANDOM_START_EVERY == 0
    starts = [] if last is None else [last.hyperparameters.logs]
    if is_thorough or not follows or last is None:
        starts.insert(0, prior.mean)
    if is_thorough:  # drawn also where nothing is fitted: others draw on from the same stream
        starts.append(rng.normal(prior.mean, prior.sd))
    if last is not None and last.is_of(trials):
        return GaussianProcess.condition(observations, last.hyperparameters)
    return fit(observations, prior, starts)


def learn_alone(space: GaitSpace, trials: Trials, last: Fitted | None, rng: np.random.Generator) -> Belief:
    """Return what one or more trials say by themselves, without any source."""
    scale = Scale.of(trials.scores)
    fitted = follow(trials, last, lambda rows: rows.observe(scale), partial(refit, trials=len(trials), rng=rng))
    return Belief.of(fitted.process, scale, space, fitted)


def describe_fit(space: GaitSpace, fitted: Fitted) -> dict[str, float]:
    """Return a fit by name, with the exact numbers of the process; see ``read_fit``.

    Length scales are relative to the parameters' ranges, variances are of standardised scores.
    """
    return {
        **dict(zip(_length_names(space), fitted.hyperparameters.length_scale.tolist(), strict=True)),
        "signal_variance": fitted.hyperparameters.signal_variance,
        "noise_variance": fitted.hyperparameters.noise_variance,
        **fitted.learned,
    }


def read_fit(space: GaitSpace, numbers: Mapping[str, float], trials: int) -> Fitted:
    """Return the fit that ``describe_fit`` described, made after so many trials.

    Raises:
        ValueError: a number is missing, or impossible.
    """
    names = [*_length_names(space), "signal_variance", "noise_variance"]
    if not all(1.0 / LARGEST < numbers.get(name, 0.0) < LARGEST for name in names):
        raise ValueError("the fit lacks a length scale or a variance, or has an impossible one")
    *length_scale, signal_variance, noise_variance = (numbers[name] for name in names)
    learned = {name: number for name, number in numbers.items() if name not in names}
    return Fitted(Hyperparameters(np.array(length_scale), signal_variance, noise_variance), trials, learned)


def _length_names(space: GaitSpace) -> list[str]:
    return [f"relative_length_scale_{parameter.name}" for parameter in space.parameters]


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
