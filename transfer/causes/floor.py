"""The floor's drift: what an inclined floor adds to every drive, along the floor's own axes.

A robot that turns while it walks tells its own part, which turns with it, from the floor's, which does not. A trial is
cut into pieces; piece k of trial i moved the robot by

    d_k = T R_k (g + u_i) + T w_i (s + e_i) + noise

with the duration T, the mean rotation R_k of the piece, the velocity g that all trials of the gait share in the robot's
frame, its deviation u_i in this trial, the drift s, its deviation e_i (gaits feel a floor differently), and the trial's
weight w_i, the sum of its squared frequencies over the mean of all trials. All of it is Gaussian, so g, u and e are
integrated out exactly. The sizes of drift, deviations and noise are averaged over a grid by their evidence; the size 0
of the drift is one of them, so that nothing is found on a level floor.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Pose

PIECE_S = 1.0
"""Usual duration of a piece."""

SKIPPED_S = 0.5
"""Time at the start of a drive that is left out: motors are still speeding up."""

_SIZES = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)  # of the drift, over the usual speed of a trial
_PRIOR = (0.4, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1)
_NOISES = (0.2, 0.45, 1.0)  # of a piece, over the trial's own speed
_CHANGES = (0.1, 0.3)  # of a gait from trial to trial, over the trial's own speed
_DIFFERS = 0.35  # standard deviation of e over the size of the drift
_LEAST_M = 0.0005  # noise of a piece that hardly moves
_SURE = 0.95  # probability of a drift at which it is told
_WIDE = 3.0  # standard deviation of g, over the usual speed


@dataclass(frozen=True, slots=True)
class Pieces:
    """One trial, cut into pieces.

    Args:
        moved_m: displacement of each along the world's x and y, (k, 2).
        rotation: mean rotation from the robot's frame to the world's during each, (k, 2, 2).
        duration_s: of each, (k,).
        weight: sum of the squared frequencies of the motors, in Hz^2.
    """

    moved_m: Array
    rotation: Array
    duration_s: Array
    weight: float


@dataclass(frozen=True, slots=True)
class Drift:
    """The floor's drift at the mean sum of squared frequencies.

    Args:
        velocity_m_s: posterior mean along x and y, (2,).
        covariance: of it, in m^2/s^2, (2, 2).
        is_inclined: probability that there is any drift.
        mean_weight: the sum of squared frequencies in Hz^2 at which the drift is as given; it grows in proportion.
    """

    velocity_m_s: Array
    covariance: Array
    is_inclined: float
    mean_weight: float

    @property
    def speed_m_s(self) -> float:
        """Size of the drift."""
        return float(np.hypot(*self.velocity_m_s))

    @property
    def is_told(self) -> bool:
        """Whether it is certain enough to be told."""
        return self.is_inclined >= _SURE

    @property
    def azimuth_rad(self) -> float:
        """Direction of the drift, counter-clockwise from x."""
        return math.atan2(self.velocity_m_s[1], self.velocity_m_s[0])

    @property
    def deviation_m_s(self) -> float:
        """Standard deviation of each component, as the root of their mean square."""
        return math.sqrt(float(np.trace(self.covariance)) / 2.0)

    def during(self, weight: float, duration_s: float) -> Array:
        """Return how far the floor carries a robot along x and y, (2,), for a sum of squared frequencies in Hz^2."""
        return np.asarray(self.velocity_m_s * weight / self.mean_weight * duration_s)


def cut(poses: Sequence[Pose], frequency_hz: Sequence[float], piece_s: float = PIECE_S) -> Pieces | None:
    """Cut a drive into pieces of about ``piece_s``; None where the poses do not make two."""
    times_s = np.array([pose.t_s for pose in poses])
    first = int(np.searchsorted(times_s, SKIPPED_S - 1e-6))
    if len(times_s) - first < 3 or not all(pose.is_finite for pose in poses):
        return None
    count = int((times_s[-1] - times_s[first]) / piece_s + 0.5)
    if count < 2:
        return None
    borders = np.searchsorted(times_s, np.linspace(times_s[first], times_s[-1], count + 1) - 1e-6)
    if not (np.diff(borders) > 0).all():
        return None
    places_m = np.array([pose.position_m[:2] for pose in poses])
    yaw_rad = np.array([pose.yaw_rad for pose in poses])
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turned = np.stack([np.stack([cos, -sin], axis=1), np.stack([sin, cos], axis=1)], axis=1)
    rotation = np.array([turned[a : b + 1].mean(axis=0) for a, b in pairwise(borders)])
    return Pieces(np.diff(places_m[borders], axis=0), rotation, np.diff(times_s[borders]), _square(frequency_hz))


def learn_drift(gaits: Sequence[Hashable], trials: Sequence[Pieces]) -> Drift | None:
    """Return the floor's drift, from the trials of one run; None where there is none that moved.

    Args:
        gaits: what each trial drove; equal ones share their velocity in the robot's frame.
        trials: their pieces.
    """
    stack = _stack(gaits, trials)
    if stack is None:
        return None
    found = []
    for (size, prior), noise, change in product(zip(_SIZES, _PRIOR, strict=True), _NOISES, _CHANGES):
        log_evidence, mean, covariance = _condition(stack, size * stack.usual_m_s, noise, change)
        found.append((math.log(prior) + log_evidence, size > 0.0, mean, covariance))
    logs = np.array([each[0] for each in found])
    share = np.exp(logs - logs.max())
    share /= share.sum()
    means, covariances = np.array([each[2] for each in found]), np.array([each[3] for each in found])
    mean = share @ means
    off = means - mean
    covariance = np.einsum("h,hij->ij", share, covariances + off[:, :, None] * off[:, None, :])
    inclined = float(share[[each[1] for each in found]].sum())
    return Drift(mean, covariance, inclined, stack.mean_weight)


def _square(frequency_hz: Sequence[float]) -> float:
    return math.fsum(hz * hz for hz in frequency_hz)


@dataclass(frozen=True, slots=True)
class _Stack:
    """All trials, padded to n pieces: rows beyond a trial's own are 0 and have ``is_real`` 0.

    Args:
        design: of own velocity and drift, (trials, 2 n, 4).
        moved_m: (trials, 2 n).
        duration_s: (trials, 2 n).
        is_real: (trials, 2 n).
        speed_m_s: of each trial, as the root of the pieces' mean square, (trials,).
        usual_m_s: the same of all trials.
        group: number of each trial's gait, (trials,).
        mean_weight: in Hz^2.
    """

    design: Array
    moved_m: Array
    duration_s: Array
    is_real: Array
    speed_m_s: Array
    usual_m_s: float
    group: np.ndarray[tuple[int, ...], np.dtype[np.int_]]
    mean_weight: float


def _stack(gaits: Sequence[Hashable], trials: Sequence[Pieces]) -> _Stack | None:
    if not trials:
        return None
    most = max(len(trial.duration_s) for trial in trials)
    mean_weight = max(float(np.mean([trial.weight for trial in trials])), 1e-12)
    design, moved_m = np.zeros((len(trials), most, 2, 4)), np.zeros((len(trials), most, 2))
    duration_s, is_real = np.zeros((len(trials), most, 2)), np.zeros((len(trials), most, 2))
    for index, trial in enumerate(trials):
        rows = slice(len(trial.duration_s))
        design[index, rows, :, :2] = trial.duration_s[:, None, None] * trial.rotation
        along = trial.duration_s * trial.weight / mean_weight
        design[index, rows, :, 2:] = along[:, None, None] * np.eye(2)
        moved_m[index, rows], duration_s[index, rows], is_real[index, rows] = (
            trial.moved_m,
            trial.duration_s[:, None],
            1,
        )
    speed_m_s = np.sqrt((moved_m**2).sum(axis=(1, 2)) / np.maximum((duration_s**2).sum(axis=(1, 2)) / 2.0, 1e-12))
    usual_m_s = float(np.sqrt((speed_m_s**2).mean()))
    if usual_m_s <= 0.0:
        return None
    numbers = {gait: number for number, gait in enumerate(dict.fromkeys(gaits))}
    flat = (len(trials), 2 * most)
    return _Stack(
        design.reshape(*flat, 4),
        moved_m.reshape(flat),
        duration_s.reshape(flat),
        is_real.reshape(flat),
        speed_m_s,
        usual_m_s,
        np.array([numbers[gait] for gait in gaits]),
        mean_weight,
    )


def _condition(stack: _Stack, size_m_s: float, noise: float, change: float) -> tuple[float, Array, Array]:
    """Return log evidence, mean and covariance of the drift, for a size of it and shares of noise and change."""
    x, y = stack.design, stack.moved_m
    noise_m = _LEAST_M + noise * stack.speed_m_s[:, None] * stack.duration_s
    own_change, floor_change = (change * stack.speed_m_s) ** 2, np.full(len(y), (_DIFFERS * size_m_s) ** 2)
    spread = np.stack([own_change, own_change, floor_change, floor_change], axis=1)
    covariance = (x * spread[:, None, :]) @ x.transpose(0, 2, 1)
    diagonal = np.where(stack.is_real > 0.0, noise_m**2, 1.0)
    index = np.arange(y.shape[1])
    covariance[:, index, index] += diagonal
    solved = np.linalg.solve(covariance, np.concatenate([x, y[:, :, None]], axis=2))
    _, log_size = np.linalg.slogdet(covariance)
    own = x.transpose(0, 2, 1) @ solved
    precision, pull = own[:, :, :4], own[:, :, 4]
    value = float((log_size + (y * solved[:, :, 4]).sum(axis=1)).sum())
    gaits = int(stack.group.max()) + 1
    by_gait, pulled = np.zeros((gaits, 4, 4)), np.zeros((gaits, 4))
    np.add.at(by_gait, stack.group, precision)
    np.add.at(pulled, stack.group, pull)
    wide = (_WIDE * stack.usual_m_s) ** 2
    known = by_gait[:, :2, :2] + np.eye(2) / wide
    cross = np.linalg.solve(known, np.concatenate([by_gait[:, :2, 2:], pulled[:, :2, None]], axis=2))
    value += float((np.linalg.slogdet(wide * known)[1] - (pulled[:, :2] * cross[:, :, 2]).sum(axis=1)).sum())
    if size_m_s == 0.0:
        return -0.5 * value, np.zeros(2), np.zeros((2, 2))
    information = (by_gait[:, 2:, 2:] - by_gait[:, 2:, :2] @ cross[:, :, :2]).sum(axis=0) + np.eye(2) / size_m_s**2
    pulled_s = (pulled[:, 2:] - (by_gait[:, 2:, :2] @ cross[:, :, 2:])[:, :, 0]).sum(axis=0)
    found = np.linalg.inv(information)
    mean = found @ pulled_s
    value += float(np.linalg.slogdet(size_m_s**2 * information)[1] - pulled_s @ mean)
    return -0.5 * value, np.asarray(mean), found
