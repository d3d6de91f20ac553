"""Whether the robot has lost strength: a factor common to all gaits that falls from one trial to the next, for good.

The logarithm of a trial's speed is a gait's own value, which is smooth over the gaits, plus a slow random walk, plus
noise, plus a step at an unknown trial T. All of it is Gaussian, and the step is integrated out exactly for every T; the
sizes of walk and noise are averaged over a grid by their evidence. Steps up compete with steps down but are not told: a
search that finds better gaits looks like one. Trials far below what all others say of their gait are left out: a motor
stood still.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.causes.standing import find_standing

ALARM = 0.95
"""Probability of a loss at which it is told."""

_HAZARD = 0.015  # prior probability of a step down before a trial, and of one up
_STEP, _STEP_SD = 0.7, 0.3  # of the logarithm: half, 0.33 to 0.75 with 80 %
_LEAST_LOSS = 0.25  # of the logarithm: less is not worth an alarm
_NOISES, _WALKS, _GAITS = (0.05, 0.1, 0.2, 0.4, 0.8), (0.0, 0.02, 0.05), (0.4, 1.0)
_LENGTH = 0.5  # over which gaits are alike, in the unit cube's sides
_FAR_BELOW = -1.4  # of the logarithm against what the other trials predict: a quarter, where a step is a half
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
    speeds = np.asarray(speeds_m_s, dtype=float)
    kept = np.flatnonzero(~_stood(places, speeds) & (speeds > 0.0))
    for _ in range(2):
        if len(kept) < 4:
            return None
        logs = np.log(speeds[kept] + _LEAST * np.median(speeds[kept]))
        y = logs - logs.mean()
        distance = np.sqrt(((places[kept][:, None] - places[kept][None, :]) ** 2).sum(axis=2))
        good = _is_no_outlier(y, distance)
        kept, y, distance = kept[good], y[good], distance[np.ix_(good, good)]
    if len(kept) < 4:
        return None
    times = kept.astype(float)
    after = np.tril(np.ones((len(kept), len(kept))))[:, 1:]  # column T: 1 from trial T on
    evidence, steps = [], []
    for noise, walk, gaits in product(_NOISES, _WALKS, _GAITS):
        covariance = gaits**2 * np.exp(-distance / _LENGTH) + walk**2 * np.minimum(times[:, None], times[None, :]) + 4.0
        covariance[np.diag_indices(len(y))] += noise**2
        log_none, log_down, log_up, down = _weigh(covariance, y, after)
        evidence.append(np.concatenate([[log_none], log_down, log_up]))
        steps.append(down)
    table = np.array(evidence)
    hazard = math.log(_HAZARD)
    table[:, 1:] += hazard
    share = np.exp(table - table.max())
    share /= share.sum()
    downs = share[:, 1 : 1 + after.shape[1]]
    at = int(downs.sum(axis=0).argmax())
    weights = downs[:, at] / max(downs[:, at].sum(), 1e-300)
    return Loss(float(downs.sum()), int(kept[at + 1]), math.exp(float(weights @ np.array(steps)[:, at])))


def _weigh(covariance: Array, y: Array, after: Array) -> tuple[float, Array, Array, Array]:
    """Return log evidences without a step, with one down and with one up at each trial, and the means of those down."""
    root = np.linalg.cholesky(covariance)
    solved = np.linalg.solve(root, np.column_stack([y, after]))
    none = -0.5 * float(solved[:, 0] @ solved[:, 0]) - float(np.log(root.diagonal()).sum())
    precision = (solved[:, 1:] ** 2).sum(axis=0)
    pull = solved[:, 1:].T @ solved[:, 0]
    posterior = precision + _STEP_SD**-2
    found = []
    for mean in (-_STEP, _STEP):
        pulled = pull + mean / _STEP_SD**2
        gain = 0.5 * (pulled**2 / posterior - mean**2 / _STEP_SD**2 - np.log(posterior * _STEP_SD**2))
        found.append((none + gain, pulled / posterior))
    return none, found[0][0], found[1][0], found[0][1]


def _is_no_outlier(y: Array, distance: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return which trials are not far below what the others predict of them."""
    covariance = np.exp(-distance / _LENGTH) + 1.0 + np.diag(np.full(len(y), 0.2**2))
    inverse = np.linalg.inv(covariance)
    return np.asarray((inverse @ y) / inverse.diagonal() > _FAR_BELOW)


def _stood(places: Array, speeds: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return which trials stood still among their neighbours in time of the same gait."""
    stood = np.zeros(len(speeds), dtype=bool)
    _, gait = np.unique(np.round(places, 9), axis=0, return_inverse=True)
    for number in range(int(gait.max()) + 1 if len(gait) else 0):
        index = np.flatnonzero(gait.ravel() == number)
        stood[index] = find_standing(speeds[index].tolist())
    return stood
