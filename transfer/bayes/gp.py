"""Gaussian-process regression: a posterior over functions, conditioned on observations.

After Rasmussen and Williams, *Gaussian Processes for Machine Learning* (2006): equations 2.25 and 2.26.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.kernel import (
    JITTER,
    Hyperparameters,
    Observations,
    covariance_of,
    covariance_of_row,
    length_factors,
    matern,
    squared_differences,
)

BLOCK_PLACES = 128
"""Places predicted at a time; the matrices of a block stay in the processor's cache."""

LARGE, BLOCK_ROWS = 200, 100
"""Number of observations above which the triangular shape of the inverse root is made use of, in blocks of rows."""

LARGER, SMALLEST = 240, 64
"""Number of observations above which a mixture makes use of it too, and its root is halved until it is so small: more
than 60 trials with three sources are, whose suggestions thus stay the same to the last bit."""


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
        return cls.condition_each([observations], hyperparameters)[0]

    @classmethod
    def condition_each(
        cls, alternatives: Sequence[Observations], hyperparameters: Hyperparameters
    ) -> list[GaussianProcess]:
        """Return the posteriors given each of some observations that differ in values and trend alone."""
        bare = replace(alternatives[0], trend=None)
        covariance, _ = covariance_of(bare, hyperparameters, squared_differences(bare.x))
        processes = []
        for each in alternatives:
            root = invert_lower(np.asarray(np.linalg.cholesky(covariance + each.of_trend()), dtype=np.float64))
            processes.append(cls(each, hyperparameters, root, root.T @ (root @ each.y)))
        return processes

    def with_values(self, y: Array) -> GaussianProcess:
        """Return the posterior given other values (n,) at the same places."""
        weights = self.inverse_root.T @ (self.inverse_root @ y)
        return replace(self, observations=replace(self.observations, y=y), weights=weights)

    def extend(self, observations: Observations) -> GaussianProcess:
        """Return the posterior given these observations, under the same hyperparameters.

        Where they are the present ones and further ones behind, with any values, the inverse root is extended row by
        row. That takes the square of their number, not the cube, and the same bits result however many rows are added
        at a time. Other observations are conditioned on from the beginning.
        """
        known, count = len(self.observations.y), len(observations.y)
        if not observations.begin_with(self.observations):
            return GaussianProcess.condition(observations, self.hyperparameters)
        root = np.zeros((count, count))
        root[:known, :known] = self.inverse_root
        for row in range(known, count):
            before = root[:row, :row]
            covariance, variance = covariance_of_row(observations, self.hyperparameters, row)
            explained = before @ covariance
            # Rounding must not make it less than the jitter, which no other observation explains.
            left = max(variance - float(explained @ explained), JITTER * self.hyperparameters.signal_variance)
            root[row, :row] = (explained @ before) / -math.sqrt(left)
            root[row, row] = 1.0 / math.sqrt(left)
        return replace(self, observations=observations, inverse_root=root).with_values(observations.y)

    def standardised_errors(self, last: int) -> Array:
        """Return by how many standard deviations each of the last values misses its prediction from those before it."""
        return np.asarray(self.inverse_root[-last:] @ self.observations.y)

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
        for block in blocks(len(x), BLOCK_PLACES):
            kernel, _ = self._kernel(x[block])
            mean[block], variance[block] = kernel @ self.weights, self._variance(self._explained(kernel))
        return mean, variance

    def predict_mean(self, x: Array) -> Array:
        """Return the mean (m,) at places (m, d): the same bits as of ``predict``, in less time."""
        mean = np.empty(len(x))
        for block in blocks(len(x), BLOCK_PLACES):
            mean[block] = self._kernel(x[block])[0] @ self.weights
        return mean

    def predict_mean_with_gradient(self, x: Array) -> tuple[Array, Array]:
        """Return mean (m,) and its gradient (m, d): the same bits as of ``predict_with_gradient``, in less time."""
        kernel, rise = self._kernel(x)
        return kernel @ self.weights, -self._weigh_differences(x, rise * self.weights)

    def predict_with_gradient(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Return mean (m,), variance (m,) and their gradients (m, d) each, at places (m, d)."""
        kernel, rise = self._kernel(x)
        projected = kernel @ self.inverse_root.T
        mean_gradient = -self._weigh_differences(x, rise * self.weights)
        variance_gradient = 2.0 * self._weigh_differences(x, rise * (projected @ self.inverse_root))
        return kernel @ self.weights, self._variance((projected**2).sum(axis=1)), mean_gradient, variance_gradient

    def _kernel(self, x: Array) -> tuple[Array, Array]:
        """Return the kernel (m, n) between places (m, d) and observations, and ``rise`` of ``matern``, coupled."""
        length = self.hyperparameters.length_scale
        left, right = x / length, self.observations.x / length
        squares = (left**2).sum(axis=1)[:, None] + (right**2).sum(axis=1) - 2.0 * left @ right.T
        correlation, rise = matern(np.maximum(squares, 0.0))
        loading = self.observations.loading
        return self.hyperparameters.signal_variance * loading * correlation, loading * rise

    def _weigh_differences(self, x: Array, weighted_rise: Array) -> Array:
        """Return minus the sum over the observations of a weight (m, n) times the kernel's gradient: (m, d)."""
        difference = x * weighted_rise.sum(axis=1)[:, None] - weighted_rise @ self.observations.x
        return np.asarray(length_factors(self.hyperparameters) * difference)

    def _explained(self, kernel: Array) -> Array:
        """Return how much of the variance (m,) the observations explain at places of the kernel (m, n)."""
        if len(self.weights) <= LARGE:
            return np.asarray(((kernel @ self.inverse_root.T) ** 2).sum(axis=1))
        explained = np.zeros(len(kernel))
        for block in blocks(len(self.weights), BLOCK_ROWS):
            # Behind its diagonal a row of the inverse root is zero.
            explained += ((kernel[:, : block.stop] @ self.inverse_root[block, : block.stop].T) ** 2).sum(axis=1)
        return explained

    def _variance(self, explained: Array) -> Array:
        signal = self.hyperparameters.signal_variance
        return np.asarray(np.maximum(signal - explained, 1e-10 * signal))


def blocks(count: int, size: int) -> list[slice]:
    """Return slices of up to ``size`` that together cover ``count``."""
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]


def invert_lower(lower: Array, most: int = LARGE) -> Array:
    """Return the inverse (n, n) of a lower triangular matrix (n, n); those larger than ``most`` are halved."""
    count = len(lower)
    if count <= most:
        return np.asarray(np.linalg.inv(lower))
    half, most = count // 2, SMALLEST if count > LARGER else most
    first, last = invert_lower(lower[:half, :half], most), invert_lower(lower[half:, half:], most)
    inverse = np.zeros((count, count))
    inverse[:half, :half], inverse[half:, half:] = first, last
    inverse[half:, :half] = -last @ (lower[half:, :half] @ first)
    return inverse
