"""Gaussian-process regression: Matern 5/2 kernel, one length scale per parameter, most probable hyperparameters.

After Rasmussen and Williams, *Gaussian Processes for Machine Learning* (2006): equations 2.25 and 2.26 for the
posterior, 4.17 for the kernel, 5.8 and 5.9 for the likelihood and its gradient.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transfer.minimise import Objective, minimise

Array = NDArray[np.float64]

JITTER = 1e-6
"""Share of the signal variance that is added to the kernel's diagonal, so that equal places keep it invertible."""


@dataclass(frozen=True, slots=True)
class Observations:
    """What a process is fitted to. The noise variance of value i is ``given[i] + share[i] * noise_variance``.

    Args:
        x: (n, d) places, about in the unit cube.
        y: (n,) values, about of mean 0 and variance 1.
        given: (n,) known part of each value's noise variance.
        share: (n,) how much of the learned noise variance each value has.
    """

    x: Array
    y: Array
    given: Array
    share: Array

    @classmethod
    def alike(cls, x: Array, y: Array) -> Observations:
        """Return observations that all have the learned noise variance and no other."""
        return cls(x, y, np.zeros(len(y)), np.ones(len(y)))


@dataclass(frozen=True, slots=True)
class Hyperparameters:
    """Of the kernel and the noise: length scales (d,) in the unit of x, variances in the squared unit of y."""

    length_scale: Array
    signal_variance: float
    noise_variance: float

    @classmethod
    def from_logs(cls, logs: Array) -> Hyperparameters:
        """Return the hyperparameters with the natural logarithms (d + 2,): length scales, signal, noise variance."""
        numbers = np.exp(logs)
        return cls(numbers[:-2], float(numbers[-2]), float(numbers[-1]))

    @property
    def logs(self) -> Array:
        """The natural logarithms (d + 2,)."""
        return np.asarray(np.log(np.append(self.length_scale, [self.signal_variance, self.noise_variance])))


@dataclass(frozen=True, slots=True)
class Prior:
    """Independent normal distributions of the hyperparameters' logarithms: means and deviations, (d + 2,) each."""

    mean: Array
    sd: Array

    @classmethod
    def of(cls, dimension: int) -> Prior:
        """Return the default: length scales about 0.3 in three dimensions and longer in more, little noise."""
        length = math.log(0.3) + 0.5 * math.log(dimension / 3)
        return cls(
            np.array([length] * dimension + [0.0, math.log(0.02)]),
            np.array([0.7] * dimension + [1.0, 1.5]),
        )


@dataclass(frozen=True, slots=True)
class GaussianProcess:
    """A posterior over functions, conditioned on observations.

    Args:
        observations: what it is conditioned on.
        hyperparameters: what it is conditioned under.
        inverse_root: (n, n) inverse of the lower Cholesky factor of the observations' covariance.
        weights: (n,) inverse covariance times y.
    """

    observations: Observations
    hyperparameters: Hyperparameters
    inverse_root: Array
    weights: Array

    @classmethod
    def conditioned(cls, observations: Observations, hyperparameters: Hyperparameters) -> GaussianProcess:
        """Return the posterior under given hyperparameters."""
        covariance, _ = _covariance(observations, hyperparameters, _squared_differences(observations.x))
        inverse_root = np.linalg.inv(np.linalg.cholesky(covariance))
        return cls(observations, hyperparameters, inverse_root, inverse_root.T @ (inverse_root @ observations.y))

    def predict(self, x: Array) -> tuple[Array, Array]:
        """Return mean (m,) and variance (m,) of the function without noise at places (m, d)."""
        mean, variance = np.empty(len(x)), np.empty(len(x))
        # In blocks that stay in the processor's cache: twice as fast for a scan of some hundred places.
        for block in (slice(start, start + 128) for start in range(0, len(x), 128)):
            kernel, _ = self._kernel(x[block])
            mean[block], variance[block] = kernel @ self.weights, self._variance(kernel @ self.inverse_root.T)
        return mean, variance

    def predict_with_gradient(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Return mean (m,), variance (m,) and their gradients (m, d) each, at places (m, d)."""
        kernel, slope = self._kernel(x)
        projected = kernel @ self.inverse_root.T
        away = (x[:, None, :] - self.observations.x[None, :, :]) / self.hyperparameters.length_scale**2
        # d kernel / d x = -slope * away, shape (m, n, d).
        mean_gradient = -np.einsum("mn,mnd->md", slope * self.weights, away)
        variance_gradient = 2.0 * np.einsum("mn,mnd->md", slope * (projected @ self.inverse_root), away)
        return kernel @ self.weights, self._variance(projected), mean_gradient, variance_gradient

    def _kernel(self, x: Array) -> tuple[Array, Array]:
        """Return kernel and slope, (m, n) each, between places (m, d) and the observations."""
        hyperparameters = self.hyperparameters
        left, right = x / hyperparameters.length_scale, self.observations.x / hyperparameters.length_scale
        squares = (left**2).sum(axis=1)[:, None] + (right**2).sum(axis=1)[None, :] - 2.0 * left @ right.T
        kernel, slope = _matern(np.maximum(squares, 0.0))
        return hyperparameters.signal_variance * kernel, hyperparameters.signal_variance * slope

    def _variance(self, projected: Array) -> Array:
        signal = self.hyperparameters.signal_variance
        return np.asarray(np.maximum(signal - (projected**2).sum(axis=1), 1e-10 * signal))


def fit(observations: Observations, prior: Prior, starts: Iterable[Array]) -> GaussianProcess:
    """Return the posterior under the most probable hyperparameters that a search from each of ``starts`` finds.

    Args:
        observations: at least one.
        prior: of the hyperparameters.
        starts: logarithms of hyperparameters, (d + 2,) each; at least one.
    """
    objective = negative_log_posterior(observations, prior)
    # In units of the prior's standard deviations, where the prior alone has the identity as its Hessian.
    found = [minimise(objective, (start - prior.mean) / prior.sd) for start in starts]
    best, _ = min(found, key=lambda place_and_value: place_and_value[1])
    return GaussianProcess.conditioned(observations, Hyperparameters.from_logs(prior.mean + prior.sd * best))


def negative_log_posterior(observations: Observations, prior: Prior) -> Objective:
    """Return minus the log of likelihood times prior (up to a constant), as a function of ``(logs - mean) / sd``."""
    squares = _squared_differences(observations.x)
    diagonal = slice(None, None, len(observations.y) + 1)

    def objective(standardised: Array) -> tuple[float, Array]:
        hyperparameters = Hyperparameters.from_logs(prior.mean + prior.sd * standardised)
        covariance, slope = _covariance(observations, hyperparameters, squares)
        try:
            root = np.linalg.cholesky(covariance)
        except np.linalg.LinAlgError:
            return math.inf, np.zeros_like(standardised)
        inverse = np.linalg.inv(covariance)
        weights = inverse @ observations.y
        value = 0.5 * float(observations.y @ weights) + float(np.log(root.diagonal()).sum())
        # Derivative of the value by each entry of the covariance, (n * n,).
        sensitivity = 0.5 * (inverse - np.outer(weights, weights)).ravel()
        noise = hyperparameters.noise_variance * float(sensitivity[diagonal] @ observations.share)
        given = float(sensitivity[diagonal] @ observations.given)
        gradient = np.concatenate(
            [
                squares @ (sensitivity * slope) / hyperparameters.length_scale**2,
                # All of the covariance but its noise scales with the signal variance.
                [float(sensitivity @ covariance.ravel()) - noise - given, noise],
            ]
        )
        return value + 0.5 * float(standardised @ standardised), gradient * prior.sd + standardised

    return objective


def _squared_differences(x: Array) -> Array:
    """Return the squared differences of all pairs of places (n, d), per parameter: (d, n * n)."""
    differences = x.T[:, :, None] - x.T[:, None, :]
    return (differences**2).reshape(x.shape[1], -1)


def _covariance(observations: Observations, hyperparameters: Hyperparameters, squares: Array) -> tuple[Array, Array]:
    """Return the observations' covariance (n, n) and the kernel's slope (n * n,)."""
    places = len(observations.y)
    kernel, slope = _matern(hyperparameters.length_scale**-2 @ squares)
    covariance = (hyperparameters.signal_variance * kernel).reshape(places, places)
    noise = observations.given + observations.share * hyperparameters.noise_variance
    covariance.ravel()[:: places + 1] += JITTER * hyperparameters.signal_variance + noise
    return covariance, hyperparameters.signal_variance * slope


def _matern(squares: Array) -> tuple[Array, Array]:
    """Return the Matern 5/2 correlation and minus twice its derivative, both by the scaled squared distance."""
    distance = np.sqrt(5.0 * squares)
    decay = np.exp(-distance)
    return (1.0 + distance + distance**2 / 3.0) * decay, (5.0 / 3.0) * (1.0 + distance) * decay
