"""Hypotheses that differ in the trend of the drive alone: many places are predicted in the time that one of them takes.

The covariances K of two of them differ by the outer products of their trends t: K = K_b + t t' - t_b t_b'. So one
inverse root R of K_b serves all, with the Sherman-Morrison-Woodbury formula (Golub and Van Loan 2013, section 2.1.4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.driven import LEVEL_SD, RISE, RISE_SD, Driven
from vvvaltr.transfer.bayes.gp import BLOCK_PLACES, BLOCK_ROWS, blocks
from vvvaltr.transfer.bayes.kernel import matern
from vvvaltr.transfer.causes.beating import likeness


@dataclass(frozen=True, slots=True)
class Alike(Driven):
    """The posterior of hypotheses of the same trials, of one task: the same numbers as of ``Driven`` but for rounding.

    Gradients, at a few places, are those of ``Driven``.
    """

    def predict(self, x: Array) -> tuple[Array, Array]:
        """See ``Posterior``."""
        base = int(np.argmax(self.chance))
        turned = self.trend[:, :, 0] @ self.inverse_root[base].T  # R t, (h, n)
        parts = [self._predict_block(x[block], base, turned) for block in blocks(len(x), BLOCK_PLACES)]
        mean, variance = (np.concatenate(numbers) for numbers in zip(*parts, strict=True))
        return mean, variance

    def predict_mean(self, x: Array) -> Array:
        """See ``Posterior``."""
        parts = (self._common(x[block]) for block in blocks(len(x), BLOCK_PLACES))
        return np.concatenate([(self.chance * self._means_of(common, trend)).sum(axis=0) for common, trend in parts])

    def _common(self, x: Array) -> tuple[Array, Array]:
        """Return the kernel (m, n) without the trend of the drive, and that trend (h, m), at places (m, d)."""
        scaled = x / self.hyperparameters.length_scale
        squares = (scaled**2).sum(axis=1)[:, None] + (self.x**2).sum(axis=1) - 2.0 * scaled @ self.x.T
        kernel, _ = matern(np.maximum(squares, 0.0, out=squares))
        kernel *= self.hyperparameters.signal_variance
        if self.drive.can_beat:
            kernel *= likeness(self.drive.beats(x), self.beats)
        kernel += LEVEL_SD * self.trend[0, :, 1]
        return kernel, self.drive.trend(x, self.dead_zones)

    def _means_of(self, common: Array, trend: Array) -> Array:
        """Return the mean (h, m) of every hypothesis."""
        slope = RISE + RISE_SD * (self.trend[:, :, 0] * self.weights).sum(axis=1)
        return np.asarray((common @ self.weights.T).T + slope[:, None] * trend)

    def _predict_block(self, x: Array, base: int, turned: Array) -> tuple[Array, Array]:
        common, trend = self._common(x)
        means = self._means_of(common, trend)
        mean = (self.chance * means).sum(axis=0)
        kernel = common + RISE_SD * trend[base][:, None] * self.trend[base, :, 0]
        explained = self._explain(self._whiten(kernel, base), RISE_SD * trend, base, turned)
        signal = self.hyperparameters.signal_variance
        variances = np.maximum(signal + LEVEL_SD**2 + (RISE_SD * trend) ** 2 - explained, 1e-10 * signal)
        return mean, (self.chance * (variances + (means - mean) ** 2)).sum(axis=0)

    def _whiten(self, kernel: Array, base: int) -> Array:
        """Return a kernel (m, n) times the base's transposed root, whose rows are zero behind the diagonal."""
        root, whitened = self.inverse_root[base], np.empty(kernel.shape)
        for rows in blocks(kernel.shape[1], BLOCK_ROWS):
            np.matmul(kernel[:, : rows.stop], root[rows, : rows.stop].T, out=whitened[:, rows])
        return whitened

    def _explain(self, whitened: Array, rise: Array, base: int, turned: Array) -> Array:
        """Return how much of its variance (h, m) the trials explain under every hypothesis.

        With q = p + c R t - c_b R t_b, where p is the base's kernel times R' and c the place's trend, it is q q' less
        what the formula takes off for the change of K: q A M^-1 A' q', where A = [R t, R t_b], M = A' A + diag(1, -1).
        """
        own, products = np.diagonal(turned @ turned.T), turned @ turned.T  # of R t with itself, and with each other
        mixed, of_base = products[:, base, None], products[base, base]
        along, gone = (whitened @ turned.T).T, rise[base]
        by_own = along + rise * own[:, None] - gone * mixed
        by_base = along[base] + rise * mixed - gone * of_base
        length = (whitened**2).sum(axis=1) + rise * (along + by_own) - gone * (along[base] + by_base)
        first, last = 1.0 + own[:, None], of_base - 1.0
        solved = last * by_own**2 - 2.0 * mixed * by_own * by_base + first * by_base**2
        return np.asarray(length - solved / (first * last - mixed**2))
