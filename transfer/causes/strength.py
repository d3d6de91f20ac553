"""The robot's strength: a factor common to all gaits that changes slowly, or falls from one trial to the next for good.

The logarithm of a trial's speed is a gait's own value, which is smooth over the gaits, plus a slow random walk, plus
noise, plus a step at an unknown trial T. All of it is Gaussian, and the step is integrated out exactly for every T; the
sizes of walk and noise are averaged over a grid by their evidence. Steps up compete with steps down but are neither
told nor corrected for: a search that finds better gaits looks like one. Trials far below what all others say of their
gait are left out: a motor stood still. Gaits that beat say little beside others: chance decides what they do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.causes.beating import beat
from vvvaltr.transfer.causes.standing import find_standing

STRETCH = 60
"""Number of trials after which the strengths of those before a stretch are settled."""

ALARM = 0.95
"""Probability of a loss at which it is told."""

_HAZARD = 0.015  # prior probability of a step down before a trial, and of one up
_STEP, _STEP_SD = 0.7, 0.3  # of the logarithm: half, 0.33 to 0.75 with 80 %
_LEAST_LOSS = 0.25  # of the logarithm: less is not worth an alarm
_NOISES, _WALKS, _GAITS = (0.05, 0.1, 0.2, 0.4, 0.8), (0.0, 0.02, 0.05), (0.4, 1.0)
_GRID = np.array(list(product(_NOISES, _WALKS, _GAITS)))  # (grid, 3)
_MEAN_SD = 2.0  # of the logarithm, of all gaits together
_LENGTH = 0.5  # over which gaits are alike, in the unit cube's sides
_BEATING = 50.0  # noise variance of gaits that beat, in units of that of others: of the logarithm, 7 times the scatter
_FAR_BELOW = -1.4  # of the logarithm against what the other trials predict: a quarter, where a step is a half
_LEAST_SHARE = 1e-3  # probability below which sizes of noise, walk and gaits are left out
_ROOM = 10  # rows that roots get room for beyond those that they need
_LEAST = 0.05  # of the median speed: below it, a logarithm says nothing


@dataclass(frozen=True, slots=True)
class Loss:
    """A loss of strength.

    Args:
        probability: that there was one.
        since: index of the trial since which the robot is weaker, the most probable one.
        factor: what the speeds have been multiplied by.
    """

    probability: float
    since: int
    factor: float

    @property
    def is_told(self) -> bool:
        """Whether it is certain and large enough to be told."""
        return self.probability >= ALARM and -math.log(self.factor) >= _LEAST_LOSS


def find_loss(places: Array, speeds_m_s: Sequence[float]) -> Loss | None:
    """Return what the valid trials of a run, in order, say of a loss; None for fewer than four that moved.

    Trials in which a gait stood still are left out.

    Args:
        places: the gaits in the unit cube, (n, d).
        speeds_m_s: of the trials, (n,).
    """
    found = StrengthLearner().learn(places, np.asarray(speeds_m_s, dtype=float))
    return found[0] if found else None


class StrengthLearner:
    """Learns the strength of a run's trials. It keeps what it computed; the results do not depend on it."""

    def __init__(self) -> None:
        self._kept: list[int] = []
        self._seen = np.zeros((0, 0))  # their places and scatter
        self._roots = _Roots.empty(0)
        self._logs: dict[int, Array] = {}

    def follow(self, places: Array, speeds: Array) -> Array:
        """Return the logarithm of each trial's strength over that of the first, (n,): 0 while no loss is told.

        A long history is taken in stretches of ``STRETCH`` trials: the strengths of all but the last two are settled.

        Args:
            places: the gaits in the unit cube, (n, d).
            speeds: of the trials, (n,); whoever calls again must not change the earlier trials.
        """
        n = len(speeds)
        logs, first, level = np.zeros(n), 0, 0.0
        while n - first > 2 * STRETCH:
            if first not in self._logs:
                part = slice(first, first + 2 * STRETCH)
                found = StrengthLearner().learn(places[part], speeds[part])
                self._logs[first] = found[1] if found else np.zeros(2 * STRETCH)
            stretch = self._logs[first]
            logs[first : first + STRETCH] = level + stretch[:STRETCH]
            level += float(stretch[STRETCH])
            first += STRETCH
        found = self.learn(places[first:], speeds[first:])
        logs[first:] = level + (found[1] if found else 0.0)
        return logs

    def learn(self, places: Array, speeds: Array) -> tuple[Loss, Array] | None:
        """Return the loss, and the logarithm of each trial's strength over that of the first, (n,).

        It is 0 while the loss is not told.
        """
        kept = np.flatnonzero(~_stood(places, speeds) & (speeds > 0.0))
        for _ in range(2):
            if len(kept) < 4:
                return None
            logs = np.log(speeds[kept] + _LEAST * np.median(speeds[kept]))
            y = logs - logs.mean()
            scatter = _scatter(places[kept])
            distance = np.sqrt(((places[kept][:, None] - places[kept][None, :]) ** 2).sum(axis=2))
            good = _is_no_outlier(y, distance, scatter)
            if good.all():
                break
            kept, y, scatter, distance = kept[good], y[good], scatter[good], distance[np.ix_(good, good)]
        if len(kept) < 4:
            return None
        walks = np.minimum(kept[:, None], kept[None, :]).astype(float)
        roots = self._root(kept.tolist(), places[kept], scatter, distance, walks)
        weighed = _weigh(roots, y)
        at = int(weighed.downs.sum(axis=0).argmax())
        weights = weighed.downs[:, at] / max(weighed.downs[:, at].sum(), 1e-300)
        loss = Loss(float(weighed.downs.sum()), int(kept[at + 1]), math.exp(float(weights @ weighed.steps[:, at])))
        if not loss.is_told:  # an uncertain step is mostly noise, and the data say next to nothing of the walk
            return loss, np.zeros(len(speeds))
        change = _expect_change(roots.inverse, y, walks, weighed)
        return loss, np.interp(np.arange(len(speeds)), kept, change - change[0])

    def _root(self, kept: list[int], places: Array, scatter: Array, distance: Array, walks: Array) -> _Roots:
        """Return the inverse roots of the covariances, row by row beyond what is the same as before."""
        pairs = zip(kept, self._kept, strict=False)
        same = next((i for i, (one, other) in enumerate(pairs) if one != other), min(len(kept), len(self._kept)))
        seen = np.column_stack([places, scatter])
        if not np.array_equal(seen[:same], self._seen[:same]):
            same = 0
        if len(kept) > self._roots.inverse.shape[1]:
            self._roots = self._roots.with_room(len(kept) + _ROOM)
        noise, walk, gaits = _GRID.T
        likeness = np.exp(-distance / _LENGTH)
        for row in range(same, len(kept)):
            before = self._roots.of(row).inverse
            covariance = gaits[:, None] ** 2 * likeness[row, :row] + walk[:, None] ** 2 * walks[row, :row] + _MEAN_SD**2
            variance = gaits**2 + walk**2 * walks[row, row] + _MEAN_SD**2 + noise**2 * scatter[row]
            explained = (before @ covariance[:, :, None])[:, :, 0]
            left = np.sqrt(variance - (explained**2).sum(axis=1))
            self._roots.put(row, -(explained[:, None, :] @ before)[:, 0, :] / left[:, None], 1.0 / left)
        self._kept, self._seen = kept, seen
        return self._roots.of(len(kept))


@dataclass(frozen=True, slots=True)
class _Roots:
    """Inverse roots of covariances, for each of the grid, in arrays that have room for more rows.

    Args:
        inverse: the lower triangular inverse roots, (grid, n, n).
        after: what a step at each trial T = 0, 1 ... becomes: sums of their columns behind T, (grid, n, n).
    """

    inverse: Array
    after: Array

    @classmethod
    def empty(cls, most: int) -> _Roots:
        """Return room for so many rows."""
        return cls(*np.zeros((2, len(_GRID), most, most)))

    def of(self, count: int) -> _Roots:
        """Return the first rows, as views."""
        return _Roots(self.inverse[:, :count, :count], self.after[:, :count, :count])

    def with_room(self, most: int) -> _Roots:
        """Return the same rows with room for more."""
        larger = _Roots.empty(most)
        first = larger.of(self.inverse.shape[1])
        first.inverse[...], first.after[...] = self.inverse, self.after
        return larger

    def put(self, row: int, before: Array, diagonal: Array) -> None:
        """Set a row: (grid, row) before the diagonal, and (grid,) on it."""
        self.inverse[:, row, :row], self.inverse[:, row, row] = before, diagonal
        sums = np.cumsum(self.inverse[:, row, row::-1], axis=1)[:, ::-1]  # of the columns from each on
        self.after[:, row, :row] = sums[:, 1:]


@dataclass(frozen=True, slots=True)
class _Weighed:
    """Probabilities of a step at each trial but the first, with the sizes of noise, walk and gaits of the grid.

    Args:
        downs: probability of a step down, (grid, n - 1).
        steps: logarithm of its factor, (grid, n - 1).
        raised: what steps up are expected to have added to each trial, (grid, n), given the sizes.
        share: probability of the sizes, (grid,).
    """

    downs: Array
    steps: Array
    raised: Array
    share: Array


def _weigh(roots: _Roots, y: Array) -> _Weighed:
    """Weigh all steps by their evidence."""
    solved = roots.inverse @ y
    none = np.log(np.diagonal(roots.inverse, axis1=1, axis2=2)).sum(axis=1) - 0.5 * (solved**2).sum(axis=1)
    after = roots.after[:, :, :-1]
    precision, pull = (after**2).sum(axis=1), np.einsum("hij,hi->hj", after, solved)
    posterior = precision + _STEP_SD**-2
    gains, steps = [], []
    for mean in (-_STEP, _STEP):
        pulled = pull + mean / _STEP_SD**2
        gains.append(0.5 * (pulled**2 / posterior - mean**2 / _STEP_SD**2 - np.log(posterior * _STEP_SD**2)))
        steps.append(pulled / posterior)
    table = np.concatenate([none[:, None], *(none[:, None] + math.log(_HAZARD) + gain for gain in gains)], axis=1)
    share = np.exp(table - table.max())
    share /= share.sum()
    downs, ups = share[:, 1 : len(y)], share[:, len(y) :]
    of_sizes = share.sum(axis=1)
    raised = np.cumsum(ups * steps[1], axis=1) / np.maximum(of_sizes, 1e-300)[:, None]
    return _Weighed(downs, steps[0], np.concatenate([np.zeros((len(_GRID), 1)), raised], axis=1), of_sizes)


def _expect_change(roots: Array, y: Array, walks: Array, weighed: _Weighed) -> Array:
    """Return what walk and steps down are expected to have changed at each trial, (n,)."""
    at = np.flatnonzero(weighed.share > _LEAST_SHARE)
    fallen = np.cumsum(weighed.downs[at] * weighed.steps[at], axis=1)
    fallen = np.concatenate([np.zeros((len(at), 1)), fallen], axis=1)
    left = weighed.share[at][:, None] * (y - weighed.raised[at]) - fallen
    pulled = np.einsum("hji,hj->hi", roots[at], np.einsum("hij,hj->hi", roots[at], left))
    return np.asarray((_GRID[at, 1] ** 2) @ pulled @ walks + fallen.sum(axis=0))


def _is_no_outlier(y: Array, distance: Array, scatter: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return which trials are not far below what the others predict of them."""
    covariance = np.exp(-distance / _LENGTH) + 1.0 + np.diag(0.2**2 * scatter)
    inverse = np.linalg.inv(covariance)
    return np.asarray((inverse @ y) / inverse.diagonal() > _FAR_BELOW)


def _scatter(places: Array) -> Array:
    """Return the noise variance (n,) of each trial, in units of that of gaits that do not beat, if any does not."""
    fastest = np.abs(places).max(axis=1, keepdims=True)
    beats = beat(places / np.maximum(fastest, 1e-12))
    return np.where(beats & ~beats.all(), _BEATING, 1.0)


def _stood(places: Array, speeds: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return which trials stood still among their neighbours in time of the same gait."""
    stood = np.zeros(len(speeds), dtype=bool)
    by_gait: dict[tuple[float, ...], list[int]] = {}
    for i, place in enumerate(np.round(places, 9).tolist()):
        by_gait.setdefault(tuple(place), []).append(i)
    for index in by_gait.values():
        if len(index) > 1:
            stood[index] = find_standing(speeds[index].tolist())
    return stood
