"""A mixture of Gaussian processes with a trend of the drive, one for each hypothesis, computed in one batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.drive import Drive
from vvvaltr.transfer.bayes.gp import BLOCK_PLACES, BLOCK_ROWS, LARGER, GaussianProcess, blocks
from vvvaltr.transfer.bayes.kernel import Hyperparameters, Observations, matern
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.causes.beating import Flags, likeness

RISE, RISE_SD = 0.5, 0.7
"""Prior of the coefficient of the drive's trend, in standard deviations of the scores: its mean and deviation."""

LEVEL_SD = 0.5
"""Standard deviation of the mean score, whose prior mean is 0."""


def begin_at_rest(drive: Drive, trials: Trials) -> Trials:
    """Return trials behind one that nobody needs to run: with all motors off a robot stays where it is."""
    if not drive.has_meaning:
        return trials
    return Trials(drive.rest[None, :], np.zeros(1), 0.0).then(trials)


def observe_drive(drive: Drive, trials: Trials, scale: Scale, dead_zone: float) -> Observations:
    """Return trials as observations of what the drive leaves to explain."""
    return observe_each(drive, trials, scale, [dead_zone])[0]


def observe_each(drive: Drive, trials: Trials, scale: Scale, dead_zones: Sequence[float]) -> list[Observations]:
    """Return trials as observations of what the drive leaves to explain beyond each of the dead zones."""
    known = begin_at_rest(drive, trials)
    bare, level = couple_beating(drive, known.observe(scale)), np.full(len(known), LEVEL_SD)
    return [
        replace(bare, y=bare.y - RISE * rise, trend=np.stack([RISE_SD * rise, level], axis=1))
        for rise in drive.trend(known.x, np.array(dead_zones))
    ]


def couple_beating(drive: Drive, observations: Observations) -> Observations:
    """Return observations of which the gaits that beat have more noise, and are less like those that do not."""
    if not drive.can_beat:
        return observations
    beats = drive.beats(observations.x)
    return replace(
        observations,
        share=observations.share * drive.noise(observations.x),
        coupling=observations.coupling * likeness(beats, beats),
    )


def rise_of(process: GaussianProcess) -> float:
    """Return the expected coefficient of the drive's trend."""
    assert process.observations.trend is not None
    return RISE + RISE_SD * float(process.observations.trend[:, 0] @ process.weights)


@dataclass(frozen=True, slots=True)
class Driven:
    """The posterior of h hypotheses with the same hyperparameters, one of which is right.

    Args:
        drive: drive of the space.
        chance: probability (h, 1) of each hypothesis.
        dead_zones: dead zone (h,) of each.
        x: places (n, d) of the observations, in length scales.
        beats: whether the observations' gaits beat, (n,).
        hyperparameters: those of all of them.
        trend: trends (h, n, t) of the observations, the first two those of the function to predict.
        loading: correlation (h, 1, n) of the observations' functions with the one to predict.
        inverse_root, weights: those of the processes, (h, n, n) and (h, n).
    """

    drive: Drive
    chance: Array
    dead_zones: Array
    x: Array
    beats: Flags
    hyperparameters: Hyperparameters
    trend: Array
    loading: Array
    inverse_root: Array
    weights: Array

    @classmethod
    def of(
        cls, drive: Drive, chance: Array, dead_zones: Sequence[float], processes: Sequence[GaussianProcess]
    ) -> Driven:
        """Return the mixture of processes of ``observe_drive``, each with its probability (h,) and its dead zone."""
        first = processes[0]
        return cls(
            drive,
            chance[:, None],
            np.array(dead_zones),
            first.observations.x / first.hyperparameters.length_scale,
            drive.beats(first.observations.x),
            first.hyperparameters,
            np.array([process.observations.trend for process in processes]),
            np.array([np.broadcast_to(process.observations.loading, process.weights.shape) for process in processes])[
                :, None
            ],
            np.array([process.inverse_root for process in processes]),
            np.array([process.weights for process in processes]),
        )

    def predict(self, x: Array) -> tuple[Array, Array]:
        """See ``Posterior``."""
        parts = [self._predict(x[block]) for block in blocks(len(x), BLOCK_PLACES)]
        mean, variance = (np.concatenate(numbers) for numbers in zip(*parts, strict=True))
        return mean, variance

    def predict_mean(self, x: Array) -> Array:
        """See ``Posterior``."""
        near = (self._near(x[block]) for block in blocks(len(x), BLOCK_PLACES))
        return np.concatenate([(self.chance * self._means(each)).sum(axis=0) for each in near])

    def predict_with_gradient(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """See ``Posterior``."""
        trend, slopes = self.drive.trend_and_slopes(x, self.dead_zones)
        near = self._near(x, trend)
        means, projected = self._means(near), self._project(near.kernel)
        mean_slopes = self._mean_slopes(near, slopes)
        variance_slopes = -2.0 * self._slopes(near, slopes, projected @ self.inverse_root)
        variance_slopes += 2.0 * RISE_SD**2 * near.trend[:, :, None] * slopes
        chance, mean = self.chance[:, :, None], (self.chance * means).sum(axis=0)
        mean_slope, away = (chance * mean_slopes).sum(axis=0), means - mean
        variance_slopes += 2.0 * away[:, :, None] * (mean_slopes - mean_slope)
        variance = (self.chance * (self._variances(near, projected) + away**2)).sum(axis=0)
        return mean, variance, mean_slope, (chance * variance_slopes).sum(axis=0)

    def predict_mean_with_gradient(self, x: Array) -> tuple[Array, Array]:
        """See ``Posterior``."""
        trend, slopes = self.drive.trend_and_slopes(x, self.dead_zones)
        near = self._near(x, trend)
        slopes = self._mean_slopes(near, slopes)
        slope = (self.chance[:, :, None] * slopes).sum(axis=0)
        return (self.chance * self._means(near)).sum(axis=0), np.asarray(slope)

    def _predict(self, x: Array) -> tuple[Array, Array]:
        near = self._near(x)
        means = self._means(near)
        variances = self._variances(near, self._project(near.kernel))
        mean = (self.chance * means).sum(axis=0)
        return mean, (self.chance * (variances + (means - mean) ** 2)).sum(axis=0)

    def _near(self, x: Array, trend: Array | None = None) -> _Near:
        """Return what the predictions at places (m, d) are made of, of which the trend (h, m) may be known."""
        if trend is None:
            trend = self.drive.trend(x, self.dead_zones)
        scaled = x / self.hyperparameters.length_scale
        squares = (scaled**2).sum(axis=1)[:, None] + (self.x**2).sum(axis=1) - 2.0 * scaled @ self.x.T
        correlation, rise = matern(np.maximum(squares, 0.0, out=squares))
        if self.drive.can_beat:
            alike = likeness(self.drive.beats(x), self.beats)
            correlation *= alike
            rise *= alike
        kernel = RISE_SD * trend[:, :, None] * self.trend[:, None, :, 0]
        kernel += LEVEL_SD * self.trend[:, None, :, 1]
        kernel += self.hyperparameters.signal_variance * correlation * self.loading
        return _Near(kernel, rise, scaled, trend)

    def _means(self, near: _Near) -> Array:
        """Return the mean (h, m) of every hypothesis."""
        return np.asarray((near.kernel @ self.weights[:, :, None])[:, :, 0] + RISE * near.trend)

    def _mean_slopes(self, near: _Near, slopes: Array) -> Array:
        """Return the gradient (h, m, d) of every hypothesis' mean."""
        return self._slopes(near, slopes, self.weights[:, None]) + RISE * slopes

    def _variances(self, near: _Near, projected: Array) -> Array:
        """Return the variance (h, m) of every hypothesis, from the kernel times the inverse root (h, m, n)."""
        signal = self.hyperparameters.signal_variance
        prior = signal + LEVEL_SD**2 + (RISE_SD * near.trend) ** 2
        return np.asarray(np.maximum(prior - (projected**2).sum(axis=2), 1e-10 * signal))

    def _project(self, kernel: Array) -> Array:
        """Return a kernel (h, m, n) times the transposed inverse root, whose rows are zero behind the diagonal."""
        count = kernel.shape[2]
        if count <= LARGER:
            return np.asarray(kernel @ self.inverse_root.transpose(0, 2, 1))
        projected = np.empty(kernel.shape)
        for rows in blocks(count, BLOCK_ROWS):
            root = self.inverse_root[:, rows, : rows.stop]
            np.matmul(kernel[:, :, : rows.stop], root.transpose(0, 2, 1), out=projected[:, :, rows])
        return projected

    def _slopes(self, near: _Near, slopes: Array, factor: Array) -> Array:
        """Return the gradient (h, m, d) of the kernel times ``factor`` (h, m, n) or (h, 1, n), which is held fixed."""
        weighted = self.loading * near.rise * factor
        difference = weighted @ self.x - weighted.sum(axis=2)[:, :, None] * near.scaled
        per_length = 5.0 / 3.0 * self.hyperparameters.signal_variance / self.hyperparameters.length_scale
        by_trend = RISE_SD * (factor @ self.trend[:, :, :1])
        return np.asarray(difference * per_length + by_trend * slopes)


@dataclass(frozen=True, slots=True)
class _Near:
    """Some places as all hypotheses see them: kernel (h, m, n) with the observations, and trend (h, m).

    ``rise`` (m, n) is that of ``matern``, ``scaled`` are the places (m, d) in length scales.
    """

    kernel: Array
    rise: Array
    scaled: Array
    trend: Array
