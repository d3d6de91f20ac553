"""Gaussian-process regression: Matern 5/2 kernel, one length scale per parameter, most probable hyperparameters.

After Rasmussen and Williams, *Gaussian Processes for Machine Learning* (2006): equations 2.25 and 2.26 for the
posterior, 4.17 for the kernel, 5.8 and 5.9 for the likelihood and its gradient.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.minimise import minimise

JITTER = 1e-6
"""Share of the signal variance added to the kernel's diagonal, so that equal places leave it invertible."""

NOISE_MEDIAN, LOG_NOISE_SD = 0.3, 1.0
"""Prior of the noise variance: its median, and the standard deviation of its logarithm."""

BLOCK_PLACES = 128
"""Places predicted at a time; the matrices of a block stay in the processor's cache."""


@dataclass(frozen=True, slots=True)
class Observations:
    """Data to fit a process to. The noise variance of value i is ``given[i] + share[i] * noise_variance``.

    Args:
        x: places (n, d), roughly in the unit cube.
        y: values (n,), roughly with mean 0 and variance 1.
        given: known part (n,) of each value's noise variance.
        share: factor (n,) of the learned noise variance in each value's noise variance.
        coupling: correlation (n, n), at one place, between the functions that two values belong to; 1 for one function.
        loading: correlation (n,), at one place, between the function that a value belongs to and the one to predict.
    """

    x: Array
    y: Array
    given: Array
    share: Array
    coupling: Array | float = 1.0
    loading: Array | float = 1.0

    @classmethod
    def alike(cls, x: Array, y: Array) -> Observations:
        """Return observations that all have the learned noise variance and no other noise."""
        return cls(x, y, np.zeros(len(y)), np.ones(len(y)))


@dataclass(frozen=True, slots=True)
class Hyperparameters:
    """The hyperparameters of kernel and noise.

    Args:
        length_scale: length scales (d,) of the kernel, in the unit of x.
        signal_variance: variance of the function, in the squared unit of y.
        noise_variance: variance of the noise, in the squared unit of y.
    """

    length_scale: Array
    signal_variance: float
    noise_variance: float

    @classmethod
    def from_logs(cls, logs: Array) -> Hyperparameters:
        """Return the hyperparameters from their logarithms (d + 2,): length scales, signal and noise variance."""
        numbers = np.exp(logs)
        return cls(numbers[:-2], float(numbers[-2]), float(numbers[-1]))

    @property
    def logs(self) -> Array:
        """The natural logarithms (d + 2,): length scales, signal and noise variance."""
        return np.asarray(np.log(np.append(self.length_scale, [self.signal_variance, self.noise_variance])))


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


@dataclass(frozen=True, slots=True)
class GaussianProcess:
    """A posterior over functions, conditioned on observations.

    Args:
        observations: observations that it is conditioned on.
        hyperparameters: hyperparameters of kernel and noise.
        inverse_root: inverse (n, n) of the lower Cholesky factor of the observations' covariance.
        weights: inverse covariance times y, (n,).
    """

    observations: Observations
    hyperparameters: Hyperparameters
    inverse_root: Array
    weights: Array

    @classmethod
    def condition(cls, observations: Observations, hyperparameters: Hyperparameters) -> GaussianProcess:
        """Return the posterior under given hyperparameters. Raises LinAlgError where they are degenerate."""
        covariance, _ = _covariance(observations, hyperparameters, _squared_differences(observations.x))
        inverse_root = np.linalg.inv(np.linalg.cholesky(covariance))
        return cls(observations, hyperparameters, inverse_root, inverse_root.T @ (inverse_root @ observations.y))

    def log_evidence(self, given: int = 0) -> float:
        """Return the log probability of the observed values, given the hyperparameters and the first ``given`` values.

        It leaves out a constant that depends on the number of values alone. The inverse root is lower triangular: its
        row i turns y_i into its standardised deviation from what the values before it predict.
        """
        deviations = self.inverse_root[given:] @ self.observations.y
        return float(np.log(self.inverse_root.diagonal()[given:]).sum() - 0.5 * deviations @ deviations)

    def predict(self, x: Array) -> tuple[Array, Array]:
        """Return mean (m,) and variance (m,) of the function without noise at places (m, d)."""
        mean, variance = np.empty(len(x)), np.empty(len(x))
        # Blocks that stay in the processor's cache halve the time for a scan of some hundred places.
        for block in (slice(start, start + BLOCK_PLACES) for start in range(0, len(x), BLOCK_PLACES)):
            kernel, _ = self._kernel(x[block])
            mean[block], variance[block] = kernel @ self.weights, self._variance(kernel @ self.inverse_root.T)
        return mean, variance

    def predict_with_gradient(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Return mean (m,), variance (m,) and their gradients (m, d) each, at places (m, d)."""
        kernel, rise = self._kernel(x)
        projected = kernel @ self.inverse_root.T
        mean_gradient = -self._weigh_differences(x, rise * self.weights)
        variance_gradient = 2.0 * self._weigh_differences(x, rise * (projected @ self.inverse_root))
        return kernel @ self.weights, self._variance(projected), mean_gradient, variance_gradient

    def _kernel(self, x: Array) -> tuple[Array, Array]:
        """Return the kernel (m, n) between places (m, d) and observations, and ``rise`` of ``_matern``, coupled."""
        length = self.hyperparameters.length_scale
        left, right = x / length, self.observations.x / length
        squares = (left**2).sum(axis=1)[:, None] + (right**2).sum(axis=1) - 2.0 * left @ right.T
        correlation, rise = _matern(np.maximum(squares, 0.0))
        loading = self.observations.loading
        return self.hyperparameters.signal_variance * loading * correlation, loading * rise

    def _weigh_differences(self, x: Array, weighted_rise: Array) -> Array:
        """Return minus the sum over the observations of a weight (m, n) times the kernel's gradient: (m, d)."""
        difference = x * weighted_rise.sum(axis=1)[:, None] - weighted_rise @ self.observations.x
        return np.asarray(_length_factors(self.hyperparameters) * difference)

    def _variance(self, projected: Array) -> Array:
        signal = self.hyperparameters.signal_variance
        return np.asarray(np.maximum(signal - (projected**2).sum(axis=1), 1e-10 * signal))


def fit(observations: Observations, prior: Prior, starts: Iterable[Array]) -> GaussianProcess:
    """Return the posterior under the most probable hyperparameters that a search from each of ``starts`` finds.

    Args:
        observations: data to fit, at least one value.
        prior: prior of the hyperparameters.
        starts: natural logarithms (d + 2,) of the hyperparameters to start from, at least one set.
    """
    improbability = Improbability(observations, prior, _squared_differences(observations.x))
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
        covariance, rise = _covariance(observations, hyperparameters, self.squares)
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
        by_length = _length_factors(hyperparameters) * (self.squares @ (sensitivity.ravel() * rise))
        by_noise = hyperparameters.noise_variance * float(sensitivity.diagonal() @ observations.share)
        by_given = float(sensitivity.diagonal() @ observations.given)
        # Scaling the whole covariance would give n - misfit; all of it but the noise scales with the signal variance.
        by_signal = len(observations.y) - misfit - by_noise - by_given
        gradient = 0.5 * np.append(by_length, [by_signal, by_noise])
        return value + 0.5 * float(standardised @ standardised), gradient * self.prior.sd + standardised

    def information(self, standardised: Array) -> Array:
        """Return the expected Hessian (d + 2, d + 2) at a place: Fisher's information plus the prior's identity.

        Fisher's information has the entries trace(C^-1 dC_i C^-1 dC_j) / 2, where dC_i is the derivative of the
        covariance C with respect to hyperparameter i.
        """
        hyperparameters, places = self._hyperparameters(standardised), len(self.observations.y)
        covariance, rise = _covariance(self.observations, hyperparameters, self.squares)
        learned = np.diag(self.observations.share * hyperparameters.noise_variance)
        by_length = (_length_factors(hyperparameters)[:, None] * self.squares * rise).reshape(-1, places, places)
        derivatives = np.concatenate([by_length, [covariance - np.diag(self.observations.given) - learned, learned]])
        relative = np.linalg.inv(covariance) @ derivatives
        turned = relative.transpose(0, 2, 1).reshape(len(relative), -1)
        information = 0.5 * relative.reshape(len(relative), -1) @ turned.T
        return np.asarray(information * np.outer(self.prior.sd, self.prior.sd) + np.eye(len(relative)))

    def _hyperparameters(self, standardised: Array) -> Hyperparameters:
        return Hyperparameters.from_logs(self.prior.mean + self.prior.sd * standardised)


def _length_factors(hyperparameters: Hyperparameters) -> Array:
    """Return the factors (d,) from squared differences times ``rise`` to the kernel's derivatives by log length."""
    return 5.0 / 3.0 * hyperparameters.signal_variance / hyperparameters.length_scale**2


def _squared_differences(x: Array) -> Array:
    """Return the squared differences (d, n * n) between all pairs of places (n, d), parameter by parameter."""
    differences = x.T[:, :, None] - x.T[:, None, :]
    return (differences**2).reshape(x.shape[1], -1)


def _covariance(observations: Observations, hyperparameters: Hyperparameters, squares: Array) -> tuple[Array, Array]:
    """Return the observations' covariance (n, n), and ``rise`` (n * n,) of ``_matern`` times the coupling."""
    places = len(observations.y)
    correlation, rise = _matern(hyperparameters.length_scale**-2 @ squares)
    coupling = observations.coupling
    covariance = hyperparameters.signal_variance * coupling * correlation.reshape(places, places)
    noise = observations.given + observations.share * hyperparameters.noise_variance
    covariance.ravel()[:: places + 1] += JITTER * hyperparameters.signal_variance + noise
    return covariance, (coupling * rise.reshape(places, places)).ravel()


def _matern(squares: Array) -> tuple[Array, Array]:
    """Return the correlation at scaled squared distances, and ``rise``: the correlation's derivative is -5/6 of it."""
    distance = np.sqrt(5.0 * squares)
    decay = np.exp(-distance)
    rise = (1.0 + distance) * decay
    return rise + (5.0 / 3.0) * squares * decay, rise
