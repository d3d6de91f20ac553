"""What a Gaussian process is made of: observations, hyperparameters, and the covariance that they give.

The Matern 5/2 kernel with one length scale per parameter: Rasmussen and Williams, *Gaussian Processes for Machine
Learning* (2006), equation 4.17.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array

JITTER = 1e-6
"""Share of the signal variance added to the kernel's diagonal, so that equal places leave it invertible."""


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
        trend: trends (n, t) at the places, each times the standard deviation of its unknown coefficient; None for none.
    """

    x: Array
    y: Array
    given: Array
    share: Array
    coupling: Array | float = 1.0
    loading: Array | float = 1.0
    trend: Array | None = None

    @classmethod
    def alike(cls, x: Array, y: Array) -> Observations:
        """Return observations that all have the learned noise variance and no other noise."""
        return cls(x, y, np.zeros(len(y)), np.ones(len(y)))

    def begin_with(self, first: Observations) -> bool:
        """Whether ``first`` are the first of these observations, whatever the values."""
        count = len(first.y)
        ours, theirs = self._covered(count), first._covered(count)
        return all(np.array_equal(one, other) for one, other in zip(ours, theirs, strict=True))

    def _covered(self, count: int) -> list[Array]:
        """Return all but the values of the first observations."""
        loading = np.broadcast_to(self.loading, len(self.y))
        coupling = np.asarray(self.coupling)
        coupled = coupling[:count, :count] if coupling.ndim else coupling  # mostly 1: no matrix of ones to compare
        trend = np.empty((count, 0)) if self.trend is None else self.trend[:count]
        return [self.x[:count], self.given[:count], self.share[:count], loading[:count], coupled, trend]

    def of_trend(self) -> Array | float:
        """Return the part (n, n) of the covariance that is due to the coefficients of the trends."""
        return 0.0 if self.trend is None else np.asarray(self.trend @ self.trend.T)


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


def length_factors(hyperparameters: Hyperparameters) -> Array:
    """Return the factors (d,) from squared differences times ``rise`` to the kernel's derivatives by log length."""
    return 5.0 / 3.0 * hyperparameters.signal_variance / hyperparameters.length_scale**2


def squared_differences(x: Array) -> Array:
    """Return the squared differences (d, n * n) between all pairs of places (n, d), parameter by parameter."""
    differences = x.T[:, :, None] - x.T[:, None, :]
    return (differences**2).reshape(x.shape[1], -1)


def covariance_of(observations: Observations, hyperparameters: Hyperparameters, squares: Array) -> tuple[Array, Array]:
    """Return the observations' covariance (n, n), and ``rise`` (n * n,) of ``matern`` times the coupling."""
    places = len(observations.y)
    correlation, rise = matern(hyperparameters.length_scale**-2 @ squares)
    coupling = observations.coupling
    covariance = hyperparameters.signal_variance * coupling * correlation.reshape(places, places)
    noise = observations.given + observations.share * hyperparameters.noise_variance
    covariance.ravel()[:: places + 1] += JITTER * hyperparameters.signal_variance + noise
    if observations.trend is not None:
        covariance += observations.of_trend()
    return covariance, (coupling * rise.reshape(places, places)).ravel()


def covariance_of_row(observations: Observations, hyperparameters: Hyperparameters, row: int) -> tuple[Array, float]:
    """Return the covariance (row,) of an observation with those before it, and its own variance."""
    squares = (observations.x[:row] - observations.x[row]) ** 2
    correlation, _ = matern(squares @ hyperparameters.length_scale**-2)
    coupling = np.broadcast_to(observations.coupling, (len(observations.y), len(observations.y)))[row, :row]
    signal = hyperparameters.signal_variance
    noise = observations.given[row] + observations.share[row] * hyperparameters.noise_variance
    covariance, variance = signal * coupling * correlation, float(signal + JITTER * signal + noise)
    if observations.trend is None:
        return covariance, variance
    before, here = observations.trend[:row], observations.trend[row]
    return covariance + before @ here, variance + float(here @ here)


def matern(squares: Array) -> tuple[Array, Array]:
    """Return the correlation at scaled squared distances, and ``rise``: the correlation's derivative is -5/6 of it."""
    distance = 5.0 * squares  # in place from here on: these are the largest arrays of all
    np.sqrt(distance, out=distance)
    decay = np.negative(distance)
    np.exp(decay, out=decay)
    rise = distance
    rise += 1.0
    rise *= decay
    correlation = (5.0 / 3.0) * squares
    correlation *= decay
    correlation += rise
    return correlation, rise
