"""What a method has been told and what it believes: the values that learning and proposing pass to each other."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.values import Estimate, GaitSpace
from vvvaltr.transfer.bayes.acquisition import Posterior
from vvvaltr.transfer.bayes.gp import GaussianProcess, Hyperparameters, Observations, Prior, fit
from vvvaltr.transfer.bayes.scale import Scale

Array = NDArray[np.float64]

MODEL_DOUBT = 15.0
"""After so many trials the model itself is as uncertain as what it predicts: measured, see docs/learning.md."""


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
        noise_variance: of a new trial's standardised score.
        seen: (k, d), k >= 1, the places whose scores the posterior rests on.
        logs: (d + 2,) logarithms of the process's hyperparameters, where the next fit starts.
        hyperparameters: the model's by name, in natural units.
    """

    posterior: Posterior
    scale: Scale
    noise_variance: float
    seen: Array
    logs: Array
    hyperparameters: Mapping[str, float]

    @classmethod
    def of(cls, process: GaussianProcess, scale: Scale, space: GaitSpace) -> Belief:
        """Return the belief that is one process of standardised scores."""
        fitted = process.hyperparameters
        names = named(space, scale, fitted)
        return cls(process, scale, fitted.noise_variance, process.observations.x, fitted.logs, names)

    def estimates(self, x: Array) -> tuple[Estimate, ...]:
        """Return what is believed of the true scores at places (m, d).

        The posterior takes scale and hyperparameters for known; the intervals are widened for it, the more the fewer
        trials there are.
        """
        widening = math.sqrt(1.0 + MODEL_DOUBT / len(self.seen))
        return self.scale.estimates(*self.posterior.predict(x), self.noise_variance, widening)

    def promising(self, count: int = 5) -> Array:
        """Return the seen places (k, d), k <= count, of the greatest posterior mean, the greatest first."""
        mean, _ = self.posterior.predict(self.seen)
        return np.asarray(self.seen[np.argsort(-mean, kind="stable")[:count]])


def refitted(observations: Observations, last: Belief | None, trials: int, rng: np.random.Generator) -> GaussianProcess:
    """Return the process fitted from the prior's mean and from the last optimum, at every fifth trial also at random.

    From the last optimum alone the fit gets stuck where the first few trials led it.
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
        "signal_sd": scale.unit() * math.sqrt(hyperparameters.signal_variance),
        "noise_sd": scale.unit() * math.sqrt(hyperparameters.noise_variance),
    }
