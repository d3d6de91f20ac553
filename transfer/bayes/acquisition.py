"""How much a gait is worth trying, and where in the unit cube that is greatest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vvvaltr.controller.core.arrays import Array

SCAN_PLACES, NEAR_PLACES = 500, 100
"""Random places that the search begins with: over the whole cube, and near promising places."""

NEAR_SD = 0.05
"""Standard deviation of the distance from a promising place, for each parameter."""

ASCENT_STARTS, ASCENT_STEPS, FIRST_STEP = 6, 9, 0.05
"""Gradient ascent: best places that it starts from, steps that it takes, and length of the first step."""

Draw = Callable[[int, int, np.random.Generator], Array]
"""Returns so many random places of the unit cube, of so many dimensions."""

LOG_ROOT_2_PI = 0.5 * math.log(2.0 * math.pi)


class Posterior(Protocol):
    """A model's belief about a function on the unit cube, without the noise of observations."""

    def predict(self, x: Array) -> tuple[Array, Array]:
        """Return mean (m,) and variance (m,) at places (m, d)."""
        ...

    def predict_with_gradient(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Return mean (m,), variance (m,) and their gradients (m, d) each, at places (m, d)."""
        ...

    def predict_mean(self, x: Array) -> Array:
        """Return the mean (m,) alone at places (m, d)."""
        ...

    def predict_mean_with_gradient(self, x: Array) -> tuple[Array, Array]:
        """Return mean (m,) and its gradient (m, d) at places (m, d)."""
        ...


class Acquisition(Protocol):
    """A quantity to maximise over the unit cube."""

    def value(self, x: Array) -> Array:
        """Return the values (m,) at places (m, d)."""
        ...

    def value_and_gradient(self, x: Array) -> tuple[Array, Array]:
        """Return values (m,) and gradients (m, d) at places (m, d)."""
        ...


@dataclass(frozen=True, slots=True)
class LogExpectedImprovement:
    """log E[max(m - incumbent, 0)], where m is the posterior mean at a place after one more trial there.

    Before that trial, m has a normal distribution around the present mean with s^2 = variance^2 / (variance + noise
    variance): the expected quantile improvement of Picheny et al. (2013) for the median. Without noise this is the
    usual expected improvement. With noise, a well-known place promises little, so it is not tried again and again. The
    value is log s + log h(z) with z = (mean - incumbent) / s, see ``log_h``; it never underflows (Ament et al. 2023).

    Args:
        posterior: belief about the function.
        incumbent: value to improve upon.
        noise_variance: returns the noise variance of a trial's observation at places (m, d): (m,), or one for all.
    """

    posterior: Posterior
    incumbent: float
    noise_variance: Callable[[Array], Array | float]

    def value(self, x: Array) -> Array:
        """Return the values (m,) at places (m, d)."""
        mean, variance = self.posterior.predict(x)
        sd = variance / np.sqrt(variance + self.noise_variance(x))
        return np.asarray(np.log(sd) + log_h((mean - self.incumbent) / sd)[0])

    def value_and_gradient(self, x: Array) -> tuple[Array, Array]:
        """Return values (m,) and gradients (m, d) at places (m, d)."""
        mean, variance, mean_gradient, variance_gradient = self.posterior.predict_with_gradient(x)
        total = variance + self.noise_variance(x)
        sd = variance / np.sqrt(total)
        z = (mean - self.incumbent) / sd
        log_h_z, slope = log_h(z)
        log_sd_gradient = (1.0 / variance - 0.5 / total)[:, None] * variance_gradient
        z_gradient = mean_gradient / sd[:, None] - z[:, None] * log_sd_gradient
        return np.log(sd) + log_h_z, log_sd_gradient + slope[:, None] * z_gradient


@dataclass(frozen=True, slots=True)
class PosteriorMean:
    """The posterior mean. The gait to recommend is the one where it is greatest.

    Args:
        posterior: belief about the function.
    """

    posterior: Posterior

    def value(self, x: Array) -> Array:
        """Return the values (m,) at places (m, d)."""
        return self.posterior.predict_mean(x)

    def value_and_gradient(self, x: Array) -> tuple[Array, Array]:
        """Return values (m,) and gradients (m, d) at places (m, d)."""
        return self.posterior.predict_mean_with_gradient(x)


def log_h(z: Array) -> tuple[Array, Array]:
    """Return log h(z) and its derivative, with h(z) = phi(z) + z Phi(z) of the standard normal distribution.

    Below z = -10, with t = -z, it is computed as h(z) = phi(z) c / (t + c), where c = 1 / (t + 2 / (t + 3 / (t + ...)))
    is the tail of the continued fraction of Mills' ratio (Abramowitz and Stegun 26.2.14). This avoids the difference of
    nearly equal numbers in the definition. The derivative of log h is then 1 / c.
    """
    log_value, slope = np.empty_like(z), np.empty_like(z)
    far = z < -10.0
    t = -z[far]
    fraction = t.copy()
    for k in range(10, 1, -1):
        fraction = t + k / fraction
    log_value[far] = -0.5 * t**2 - LOG_ROOT_2_PI - np.log1p(t * fraction)
    slope[far] = fraction
    near = z[~far]
    below = 0.5 * np.array([math.erfc(value) for value in (near / -math.sqrt(2.0)).tolist()])
    body = np.exp(-0.5 * near**2 - LOG_ROOT_2_PI) + near * below
    log_value[~far], slope[~far] = np.log(body), below / body
    return log_value, slope


def draw_uniformly(count: int, dimension: int, rng: np.random.Generator) -> Array:
    """Return random places (count, d) of the unit cube."""
    return rng.random((count, dimension))


def maximise(acquisition: Acquisition, around: Array, rng: np.random.Generator, draw: Draw = draw_uniformly) -> Array:
    """Return the place (d,) of the unit cube where an acquisition is greatest, as far as a short search finds it.

    The search scans random places, some of them near the places ``around``, and then climbs from the best of them.

    Args:
        acquisition: quantity to maximise.
        around: promising places (k, d), k >= 1. They are candidates themselves, moved into the cube where outside it.
        rng: random stream of the places to scan.
        draw: draws the places over the whole cube, so many of so many dimensions.
    """
    dimension = around.shape[1]
    near = around[rng.integers(len(around), size=NEAR_PLACES)] + rng.normal(0.0, NEAR_SD, (NEAR_PLACES, dimension))
    candidates = np.clip(np.concatenate([around, near, draw(SCAN_PLACES, dimension, rng)]), 0.0, 1.0)
    order = np.argsort(-acquisition.value(candidates), kind="stable")
    return _ascend(acquisition, candidates[order[:ASCENT_STARTS]])


def _ascend(acquisition: Acquisition, x: Array) -> Array:
    """Return the best place (d,) after some steps uphill from each of the places (m, d), all in one batch.

    A step that climbs is kept and the next one is longer; a step that does not is undone and the next one is shorter.
    """
    value, gradient = acquisition.value_and_gradient(x)
    reach = np.full(len(x), FIRST_STEP)
    for _ in range(ASCENT_STEPS):
        # On a face of the cube, the outward part of the gradient is dropped, so that the step follows the face.
        uphill = np.where(((x <= 0.0) & (gradient < 0.0)) | ((x >= 1.0) & (gradient > 0.0)), 0.0, gradient)
        length = np.maximum(np.linalg.norm(uphill, axis=1), 1e-300)
        trial = np.clip(x + (reach / length)[:, None] * uphill, 0.0, 1.0)
        trial_value, trial_gradient = acquisition.value_and_gradient(trial)
        better = trial_value > value
        x, gradient = np.where(better[:, None], trial, x), np.where(better[:, None], trial_gradient, gradient)
        value, reach = np.where(better, trial_value, value), np.where(better, 1.6 * reach, 0.3 * reach)
    return np.asarray(x[np.argmax(value)])
