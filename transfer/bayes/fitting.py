"""The most probable hyperparameters of a Gaussian process.

After Rasmussen and Williams, *Gaussian Processes for Machine Learning* (2006): equations 5.8 and 5.9 for the likelihood
and its gradient.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import (
    Hyperparameters,
    Observations,
    covariance_of,
    length_factors,
    squared_differences,
)
from vvvaltr.transfer.bayes.minimise import minimise

NOISE_MEDIAN, LOG_NOISE_SD = 0.3, 1.0
"""Prior of the noise variance: its median, and the standard deviation of its logarithm."""


@dataclass(frozen=True, slots=True)
class Prior:
    """Independent normal distributions of the hyperparameters' natural logarithms.

    Args:
        mean: means (d + 2,).
        sd: standard deviations (d + 2,).
    """

    mean: Array
    sd: Array

    @classmethod
    def of(cls, dimension: int) -> Prior:
        """Return the usual prior: length scales near 0.3 in three dimensions and longer in more, and much noise."""
        length = math.log(0.3) + 0.5 * math.log(dimension / 3)
        return cls(
            np.array([length] * dimension + [0.0, math.log(NOISE_MEDIAN)]),
            np.array([0.7] * dimension + [1.0, LOG_NOISE_SD]),
        )


def fit(observations: Observations, prior: Prior, starts: Iterable[Array]) -> GaussianProcess:
    """Return the posterior under the most probable hyperparameters that a search from each of ``starts`` finds.

    Args:
        observations: data to fit, at least one value.
        prior: prior of the hyperparameters.
        starts: natural logarithms (d + 2,) of the hyperparameters to start from, at least one set.
    """
    improbability = Improbability(observations, prior, squared_differences(observations.x))
    # In units of the prior's standard deviations, where the prior alone has the identity as its Hessian.
    places = [(start - prior.mean) / prior.sd for start in starts]
    # One guess of the Hessian serves all starts; with the identity instead, a search takes twice as long.
    hessian = improbability.information(places[0])
    found = [minimise(improbability, place, hessian) for place in places]
    best, _ = min(found, key=lambda place_and_value: place_and_value[1])
    return GaussianProcess.condition(observations, Hyperparameters.from_logs(prior.mean + prior.sd * best))


@dataclass(frozen=True, slots=True)
class Improbability:
    """Minus the log of likelihood times prior, up to a constant, as a function of ``(logs - prior.mean) / prior.sd``.

    Args:
        observations: data to fit, at least one value.
        prior: prior of the hyperparameters.
        squares: squared differences (d, n * n) of the observations' places.
    """

    observations: Observations
    prior: Prior
    squares: Array

    def __call__(self, standardised: Array) -> tuple[float, Array]:
        """Return value and gradient (d + 2,) at a place (d + 2,). The value is infinite where it cannot be computed."""
        observations, hyperparameters = self.observations, self._hyperparameters(standardised)
        covariance, rise = covariance_of(observations, hyperparameters, self.squares)
        try:
            root = np.linalg.cholesky(covariance)
        except np.linalg.LinAlgError:
            return math.inf, np.zeros_like(standardised)
        inverse = np.linalg.inv(covariance)
        weights = inverse @ observations.y
        misfit = float(observations.y @ weights)
        value = 0.5 * misfit + float(np.log(root.diagonal()).sum())
        # Twice the derivative of the value with respect to each entry of the covariance.
        sensitivity = inverse - np.outer(weights, weights)
        by_length = length_factors(hyperparameters) * (self.squares @ (sensitivity.ravel() * rise))
        by_noise = hyperparameters.noise_variance * float(sensitivity.diagonal() @ observations.share)
        by_given = float(sensitivity.diagonal() @ observations.given)
        # Scaling the whole covariance would give n - misfit; all but noise and trend scales with the signal variance.
        by_signal = len(observations.y) - misfit - by_noise - by_given
        if observations.trend is not None:
            by_signal -= float((sensitivity * observations.of_trend()).sum())
        gradient = 0.5 * np.append(by_length, [by_signal, by_noise])
        return value + 0.5 * float(standardised @ standardised), gradient * self.prior.sd + standardised

    def information(self, standardised: Array) -> Array:
        """Return the expected Hessian (d + 2, d + 2) at a place: Fisher's information plus the prior's identity.

        Fisher's information has the entries trace(C^-1 dC_i C^-1 dC_j) / 2, where dC_i is the derivative of the
        covariance C with respect to hyperparameter i.
        """
        hyperparameters, places = self._hyperparameters(standardised), len(self.observations.y)
        covariance, rise = covariance_of(self.observations, hyperparameters, self.squares)
        learned = np.diag(self.observations.share * hyperparameters.noise_variance)
        by_length = (length_factors(hyperparameters)[:, None] * self.squares * rise).reshape(-1, places, places)
        by_signal = covariance - np.diag(self.observations.given) - learned
        if self.observations.trend is not None:
            by_signal -= self.observations.of_trend()
        derivatives = np.concatenate([by_length, [by_signal, learned]])
        relative = np.linalg.inv(covariance) @ derivatives
        turned = relative.transpose(0, 2, 1).reshape(len(relative), -1)
        information = 0.5 * relative.reshape(len(relative), -1) @ turned.T
        return np.asarray(information * np.outer(self.prior.sd, self.prior.sd) + np.eye(len(relative)))

    def _hyperparameters(self, standardised: Array) -> Hyperparameters:
        return Hyperparameters.from_logs(self.prior.mean + self.prior.sd * standardised)
