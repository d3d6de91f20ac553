"""The floor's drift: what an inclined floor adds to every drive, along the floor's own axes.

A robot that turns while it walks tells its own part, which turns with it, from the floor's, which does not. A trial is
cut into pieces; piece k of trial i moved the robot by

    d_k = T R_k (g + u_i) + T w_i (s + e_i) + noise

with the duration T, the mean rotation R_k of the piece, the velocity g that all trials of the gait share in the robot's
frame, its deviation u_i in this trial, the drift s, its deviation e_i (gaits feel a floor differently), and the trial's
weight w_i, the sum of its squared frequencies over the usual one. The gaits of a run scatter around a velocity of their
own, of which nothing is known: g = g_0 + v. All of it is Gaussian, so v, u and e are integrated out exactly. How noisy
a trial is, over the others, is taken from what its own fit leaves. The sizes of drift, deviations and noise, and how
far gaits scatter, are averaged over a grid by their evidence. For each of them a level floor competes, with s = 0 but
the same deviations: what only scatters is no drift.

What a trial adds to a hypothesis depends on that trial and on the usual speed and weight alone, which are powers of 2.
So it is computed once, and a new trial costs little.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.records import Piece
from vvvaltr.transfer.causes.pieces import find_speed_m_s, turns

SURE = 0.95
"""Probability of a drift at which it is told."""

_SIZES = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)  # of the drift, over the usual speed of a trial
_LEVEL = 0.25  # prior probability of a level floor
_USUAL_NOISE = 0.45  # of a piece, over the trial's own speed
_COUNTS = 3.0  # number of coordinates as which the usual noise counts beside what a trial's own fit leaves
_USUAL_DRIFT = 0.5  # over the usual speed, in that fit
_NOISES = (0.45, 1.0)  # of the pieces, over what is found of each trial by itself
_CHANGES = (0.1, 0.3)  # of a gait from trial to trial, over the trial's own speed
_DIFFERS = 0.35  # standard deviation of e over the size of the drift
_LEAST_M = 0.0005  # noise of a piece that hardly moves
_LEAST_SHARE = 1e-3  # probability below which a hypothesis says nothing of single trials
_SPREADS = (0.3, 0.6, 1.2)  # standard deviation of v, over the usual speed
_WIDE = 3.0  # standard deviation of g_0, over the usual speed

_OF_TRIALS = np.array(list(product(_SIZES, _NOISES, _CHANGES)))  # (hypotheses of what a trial adds, 3)
_GRID = np.repeat(_OF_TRIALS, len(_SPREADS), axis=0)  # (hypotheses, 3)
_IS_INCLINED = _GRID[:, 0] > 0.0
_LOG_PRIOR = math.log((1.0 - _LEVEL) / _IS_INCLINED.sum())
_LOG_PRIOR_LEVEL = math.log(_LEVEL / len(_GRID))


@dataclass(frozen=True, slots=True)
class Drift:
    """The floor's drift at a usual sum of squared frequencies.

    Args:
        velocity_m_s: posterior mean along x and y, (2,).
        covariance: of it, in m^2/s^2, (2, 2).
        is_inclined: probability that there is any drift.
        mean_weight: the sum of squared frequencies in Hz^2 at which the drift is as given; it grows in proportion.
        of_trials_m_s: what the floor added to the velocity of each trial, the posterior mean, (trials, 2).
    """

    velocity_m_s: Array
    covariance: Array
    is_inclined: float
    mean_weight: float
    of_trials_m_s: Array

    @property
    def speed_m_s(self) -> float:
        """Size of the drift."""
        return float(np.hypot(*self.velocity_m_s))

    @property
    def is_told(self) -> bool:
        """Whether it is certain enough to be told."""
        return self.is_inclined >= SURE

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


_Key = tuple[int, float, float]  # of a trial: identity of its pieces, share of the usual weight, usual speed


@dataclass(frozen=True, slots=True)
class _Added:
    """What a trial adds to each hypothesis of it: precision and pull of g and drift, and minus twice the log."""

    precision: Array  # (hypotheses of trials, 4, 4)
    pull: Array  # (hypotheses of trials, 4)
    value: Array  # (hypotheses of trials,)


@dataclass(frozen=True, slots=True)
class _OfGait:
    """What the trials of a gait add, v integrated out: it is the last of ``cross`` less the others times g_0 and s."""

    precision: Array  # of g_0 and the drift, (hypotheses, 4, 4)
    pull: Array  # (hypotheses, 4)
    value: Array  # (hypotheses,)
    cross: Array  # (hypotheses, 2, 5)


class DriftLearner:
    """Learns the floor's drift from the trials of a run. It keeps what it computed; the results do not depend on it."""

    def __init__(self) -> None:
        self._speeds: dict[int, tuple[tuple[Piece, ...], float]] = {}
        self._turned: dict[tuple[int, tuple[float, float]], tuple[tuple[Piece, ...], bool]] = {}
        self._added: dict[_Key, _Added] = {}
        self._of_gaits: dict[tuple[_Key, ...], _OfGait] = {}

    def learn(
        self, gaits: Sequence[Hashable], trials: Sequence[Sequence[Piece]], weights: Sequence[float]
    ) -> Drift | None:
        """Return the drift; None where no trial moved, or the robot always had one heading: then nothing tells it.

        Args:
            gaits: what each trial drove; equal ones share their velocity in the robot's frame.
            trials: the pieces of each, at least two.
            weights: of each the sum of the squared frequencies, in Hz^2.
        """
        tuples = [tuple(pieces) for pieces in trials]
        if not self._have_turned(tuples):
            return None
        usual_m_s = _power_of_2(math.sqrt(float(np.mean([self._measure(pieces) ** 2 for pieces in tuples]))))
        usual_weight = _power_of_2(float(np.mean(weights)))
        if usual_m_s == 0.0 or usual_weight == 0.0:
            return None
        shares = [weight / usual_weight for weight in weights]
        keys = [self._add(it, share, usual_m_s) for it, share in zip(tuples, shares, strict=True)]
        members: dict[Hashable, list[int]] = {}
        for i, gait in enumerate(gaits):
            members.setdefault(gait, []).append(i)
        groups = [tuple(keys[i] for i in index) for index in members.values()]
        of_gaits = [self._combine(group, usual_m_s) for group in groups]
        self._forget_all_but(keys, groups)
        group = np.zeros(len(keys), dtype=int)
        for number, index in enumerate(members.values()):
            group[index] = number
        drift = _conclude([self._added[key] for key in keys], of_gaits, group, np.array(shares), usual_m_s)
        scale = float(np.mean(shares))
        return replace(
            drift,
            velocity_m_s=scale * drift.velocity_m_s,
            covariance=scale**2 * drift.covariance,
            mean_weight=scale * usual_weight,
        )

    def _have_turned(self, trials: Sequence[tuple[Piece, ...]]) -> bool:
        """Return whether there are different headings; trackers without one, and robots in a plane, have one alone."""
        first = next((piece.heading for pieces in trials for piece in pieces), (1.0, 0.0))
        for pieces in trials:
            key = id(pieces), first
            if key not in self._turned:
                self._turned[key] = pieces, turns(pieces, first)
            if self._turned[key][1]:
                return True
        return False

    def _forget_all_but(self, keys: Sequence[_Key], groups: Sequence[tuple[_Key, ...]]) -> None:
        """Let go of what was computed for another usual speed, and for gaits that have been driven again since."""
        self._speeds = {number: self._speeds[number] for number, _, _ in keys}
        self._added = {key: self._added[key] for key in keys}
        self._of_gaits = {group: self._of_gaits[group] for group in groups}

    def _measure(self, pieces: tuple[Piece, ...]) -> float:
        """Return the speed of a trial in m/s."""
        if id(pieces) not in self._speeds:
            self._speeds[id(pieces)] = pieces, find_speed_m_s(pieces)  # the pieces are kept, so that their identity is
        return self._speeds[id(pieces)][1]

    def _add(self, pieces: tuple[Piece, ...], share: float, usual_m_s: float) -> _Key:
        key = (id(pieces), share, usual_m_s)
        if key not in self._added:
            self._added[key] = _add(pieces, share, usual_m_s)
        return key

    def _combine(self, keys: tuple[_Key, ...], usual_m_s: float) -> _OfGait:
        if keys not in self._of_gaits:
            self._of_gaits[keys] = _combine([self._added[key] for key in keys], usual_m_s)
        return self._of_gaits[keys]


def learn_drift(gaits: Sequence[Hashable], trials: Sequence[Sequence[Piece]], weights: Sequence[float]) -> Drift | None:
    """Return the floor's drift, from the trials of one run; see ``DriftLearner.learn``."""
    return DriftLearner().learn(gaits, trials, weights)


def _solve_2(matrix: Array, right: Array) -> tuple[Array, Array]:
    """Return the solutions (..., 2, k) of systems of two equations (..., 2, 2), and the determinants (...)."""
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    determinant = a * d - b * c
    first, second = right[..., 0, :], right[..., 1, :]
    over = 1.0 / determinant
    top = (d * over)[..., None] * first - (b * over)[..., None] * second
    return np.stack([top, (a * over)[..., None] * second - (c * over)[..., None] * first], axis=-2), determinant


def _power_of_2(number: float) -> float:
    """Return the power of 2 next to a number above 0; else 0."""
    return 2.0 ** round(math.log2(number)) if number > 0.0 else 0.0


def _add(pieces: tuple[Piece, ...], share: float, usual_m_s: float) -> _Added:
    """Return what a trial adds to each hypothesis, its own deviations u and e integrated out."""
    duration_s = np.array([piece.duration_s for piece in pieces])
    cos, sin = np.array([piece.heading for piece in pieces]).T
    design = np.zeros((len(pieces), 2, 4))
    design[:, :, :2] = np.stack([np.stack([cos, -sin], axis=1), np.stack([sin, cos], axis=1)], axis=1)
    design[:, :, 2:] = share * np.eye(2)
    x = (duration_s[:, None, None] * design).reshape(-1, 4)
    y = np.array([piece.moved_m for piece in pieces]).ravel()
    speed_m_s, (sizes, factors, changes) = find_speed_m_s(pieces), _OF_TRIALS.T
    own, floor = (changes * speed_m_s) ** 2, (_DIFFERS * sizes * usual_m_s) ** 2
    spread = np.stack([own, own, floor, floor], axis=1)
    covariance = (x * spread[:, None, :]) @ x.T
    index = np.arange(len(y))
    usual_m = _LEAST_M + _USUAL_NOISE * speed_m_s * np.repeat(duration_s, 2)
    noise_m = usual_m * _compare_noise(x / usual_m[:, None], y / usual_m, speed_m_s, usual_m_s)
    covariance[:, index, index] += (factors[:, None] * noise_m) ** 2
    right = np.broadcast_to(np.column_stack([x, y]), (len(covariance), len(y), 5))
    solved = np.linalg.solve(covariance, right)
    projected = x.T @ solved
    value = np.linalg.slogdet(covariance)[1] + solved[:, :, 4] @ y
    return _Added(projected[:, :, :4], projected[:, :, 4], value)


def _compare_noise(x: Array, y: Array, speed_m_s: float, usual_m_s: float) -> float:
    """Return the noise of a trial's pieces over the usual one, by which design and values have been divided.

    It is what a fit of the trial's own velocity and drift leaves, with the usual noise as a prior: some drives are far
    more even than others.
    """
    known = np.diag(np.repeat([max(speed_m_s, 1e-6), _USUAL_DRIFT * usual_m_s], 2) ** -2.0)
    squares = x.T @ x
    fitted = np.linalg.solve(squares + known, x.T @ y)
    freedom = len(y) - float(np.trace(np.linalg.solve(squares + known, squares)))
    return math.sqrt((_COUNTS + float(((y - x @ fitted) ** 2).sum())) / (_COUNTS + max(freedom, 1.0)))


def _combine(added: Sequence[_Added], usual_m_s: float) -> _OfGait:
    """Return what the trials of one gait add, v integrated out."""
    precision, pull, value = (
        np.repeat(sum(getattr(it, name) for it in added), len(_SPREADS), axis=0)
        for name in ("precision", "pull", "value")
    )
    variance = np.tile((np.array(_SPREADS) * usual_m_s) ** 2, len(_OF_TRIALS))
    known = precision[:, :2, :2] + np.eye(2) / variance[:, None, None]
    cross, determinant = _solve_2(known, np.concatenate([precision[:, :2], pull[:, :2, None]], axis=-1))
    left = precision[:, :, :2] @ cross
    value += np.log(variance**2 * determinant) - (pull[:, :2] * cross[..., 4]).sum(axis=-1)
    return _OfGait(precision - left[..., :4], pull - left[..., 4], value, cross)


def _conclude(
    added: Sequence[_Added],
    of_gaits: Sequence[_OfGait],
    group: np.ndarray[tuple[int, ...], np.dtype[np.int_]],
    shares: Array,
    usual_m_s: float,
) -> Drift:
    """Return the drift at the usual weight from what all trials and their gaits add."""
    value = np.sum([it.value for it in of_gaits], axis=0)
    precision = np.sum([it.precision for it in of_gaits], axis=0)
    pulled = np.sum([it.pull for it in of_gaits], axis=0)
    wide, variance = (_WIDE * usual_m_s) ** 2, np.maximum((_GRID[:, 0] * usual_m_s) ** 2, 1e-30)
    precision[:, :2, :2] += np.eye(2) / wide
    own, determinant = _solve_2(
        precision[:, :2, :2], np.concatenate([precision[:, :2, 2:], pulled[:, :2, None]], axis=-1)
    )
    value += np.log(wide**2 * determinant) - (pulled[:, :2] * own[..., 2]).sum(axis=-1)
    level = _LOG_PRIOR_LEVEL - 0.5 * value
    information = precision[:, 2:, 2:] - precision[:, 2:, :2] @ own[..., :2] + np.eye(2) / variance[:, None, None]
    pulled_s = pulled[:, 2:] - (precision[:, 2:, :2] @ own[..., 2:])[..., 0]
    covariances = np.linalg.inv(information)
    means = (covariances @ pulled_s[..., None])[..., 0]
    value += np.linalg.slogdet(variance[:, None, None] * information)[1] - (pulled_s * means).sum(axis=1)
    inclined = np.where(_IS_INCLINED, _LOG_PRIOR - 0.5 * value, -np.inf)
    greatest = max(level.max(), inclined.max())
    share = np.exp(inclined - greatest)
    share = share / (share.sum() + np.exp(level - greatest).sum())
    probability = float(share.sum())
    mean = share @ means
    covariance = np.einsum("h,hij->ij", share, covariances + means[:, :, None] * means[:, None, :])
    covariance -= np.outer(mean, mean)
    own_means = own[..., 2] - (own[..., :2] @ means[..., None])[..., 0]
    both = np.concatenate([own_means, means], axis=1)
    of_trials = shares[:, None] * (mean + _find_deviations(added, of_gaits, group, both, share, usual_m_s))
    return Drift(mean, covariance, probability, 1.0, of_trials)


def _find_deviations(
    added: Sequence[_Added],
    of_gaits: Sequence[_OfGait],
    group: np.ndarray[tuple[int, ...], np.dtype[np.int_]],
    means: Array,
    share: Array,
    usual_m_s: float,
) -> Array:
    """Return what is expected of each trial's deviation e, (trials, 2): what own velocity and drift leave tells it."""
    kept = np.flatnonzero(share > _LEAST_SHARE)
    if not len(kept):
        return np.zeros((len(added), 2))
    cross = np.array([it.cross for it in of_gaits])[:, kept]
    theta = np.repeat(means[None, kept], len(cross), axis=0)
    theta[..., :2] += cross[..., 4] - (cross[..., :4] @ means[kept][..., None])[..., 0]
    of_trial = kept // len(_SPREADS)
    precision = np.array([it.precision[:, 2:] for it in added])[:, of_trial]
    pull = np.array([it.pull[:, 2:] for it in added])[:, of_trial]
    left = pull - (precision @ theta[group][..., None])[..., 0]
    return np.asarray(np.einsum("h,nhi->ni", share[kept] * (_DIFFERS * _GRID[kept, 0] * usual_m_s) ** 2, left))
