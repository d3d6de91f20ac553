"""A repertoire: tried gaits, and what each of them does to place and heading.

Neighbouring gaits say next to nothing of the direction of each other's movement, so it is a table and no surface.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Trial
from vvvaltr.transfer.steering.belief import FLOOR_TURN, Belief, drives
from vvvaltr.transfer.steering.passage import STEADY_S, Passage, passage, start_delay_s

_USUAL_SCATTER = 0.4  # of a movement, from trial to trial, before repeats have said more
_USUAL_DELAY_S = 0.25
_WEIGHT = 4.0  # of what is usual, in repeats
_LEAST = np.array([0.0007, 0.0007, 0.02])  # scatter of a gait that hardly moves
_NEARLY_LEVEL = 0.3  # of what the floor adds to turns elsewhere, where a repertoire is learned
_MORE = 100  # movements that a belief is extended by: not one by one, for each time all of it is copied
_FLOOR = 0.5  # the floor's drift over the usual speed, before anything is known


@dataclass(frozen=True, slots=True)
class LearnedMovement:
    """What one gait does.

    Args:
        gait: the gait.
        velocity: forward and left in m/s in the robot's own frame, turn in rad/s, shape (3,).
        covariance: of the velocity's posterior, shape (3, 3).
        scatter: standard deviation of each from trial to trial, shape (3,).
        trials: how often it was driven.
    """

    gait: Gait
    velocity: Array
    covariance: Array
    scatter: Array
    trials: int

    @property
    def deviation(self) -> Array:
        """Standard deviation of the velocity's posterior, shape (3,)."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True, slots=True)
class Repertoire:
    """Tried gaits.

    Args:
        movements: what each gait does.
        drift_m_s: the floor's drift where the last of them was tried, at the usual drive, shape (2,).
        delay_s: by how much a driven gait lags behind one that moves at its steady speed at once.
    """

    movements: tuple[LearnedMovement, ...] = ()
    drift_m_s: tuple[float, float] = (0.0, 0.0)
    delay_s: float = _USUAL_DELAY_S

    @property
    def gaits(self) -> tuple[Gait, ...]:
        """The gaits, in the order in which they were first tried."""
        return tuple(movement.gait for movement in self.movements)

    @property
    def velocities(self) -> Array:
        """Forward, left (m/s) and turn (rad/s) of each, shape (n, 3)."""
        return np.array([movement.velocity for movement in self.movements]).reshape(-1, 3)

    def joined(self, other: Repertoire) -> Repertoire:
        """Return both; of a gait that both have, the precisions add up, unless it is the same knowledge twice.

        The other one's floor is the last.
        """
        mine = {movement.gait: movement for movement in self.movements}
        for movement in other.movements:
            known = mine.get(movement.gait)
            is_same = known is not None and np.array_equal(known.velocity, movement.velocity)
            mine[movement.gait] = movement if known is None or is_same else _fused(known, movement)
        return Repertoire(tuple(mine.values()), other.drift_m_s, other.delay_s) if other.movements else self

    def belief(self) -> Belief:
        """Return all of it as one Gaussian, with the drift of the last floor taken for exact."""
        n = len(self.movements)
        mean, covariance = np.zeros(5 * n + 2), np.zeros((5 * n + 2, 5 * n + 2))
        mean[:-2].reshape(-1, 5)[:, :3], mean[-2:] = self.velocities, self.drift_m_s
        for index, movement in enumerate(self.movements):
            covariance[5 * index : 5 * index + 3, 5 * index : 5 * index + 3] = movement.covariance
        scatter = np.array([movement.scatter for movement in self.movements]).reshape(-1, 3)
        return Belief(mean, covariance, scatter, drives(self.gaits))


def learn_repertoire(runs: Iterable[Sequence[Trial]], base: Repertoire = Repertoire()) -> Repertoire:
    """Return what is known after some runs: every valid trial with poses counts.

    Each run has a floor's drift of its own, which is taken off.

    Args:
        runs: the trials of each, in their order.
        base: what was known before.
    """
    driven = [_driven(run) for run in runs]
    if not any(driven):
        return base
    gaits = tuple(dict.fromkeys([*base.gaits, *(gait for run in driven for gait, _, _ in run)]))
    place = {gait: index for index, gait in enumerate(gaits)}
    vague = _vague(base, gaits, driven)
    size = _sizes(vague.movements, driven)
    floor = _FLOOR * float(np.hypot(*size[:2])), _NEARLY_LEVEL * FLOOR_TURN * float(size[2])
    belief = vague.first(len(base.gaits))
    counts = np.array([movement.trials for movement in base.movements] + [0] * (len(gaits) - len(base.gaits)))
    for run in driven:
        belief, vague = belief.on_new_floor(*floor), vague.on_new_floor(*floor)
        for gait, seen, _ in run:
            if place[gait] == len(belief.drive):  # not before, for an update takes time with the square of their number
                belief = belief.extended(vague.first(min(place[gait] + _MORE, len(gaits))))
            belief, _ = belief.observed(place[gait], seen)
            counts[place[gait]] += 1
    blocks = [slice(5 * index, 5 * index + 3) for index in range(len(gaits))]
    movements = tuple(
        LearnedMovement(gait, belief.mean[block], belief.covariance[block, block], scatter, int(count))
        for gait, block, scatter, count in zip(gaits, blocks, belief.scatter, counts, strict=True)
    )
    delays = [delay for run in driven for _, _, delay in run if delay is not None]
    delay_s = float(np.median([*delays, base.delay_s])) if delays else base.delay_s
    x_m_s, y_m_s = belief.drift_m_s.tolist()
    return Repertoire(movements, (x_m_s, y_m_s), min(max(delay_s, 0.0), STEADY_S))


def _fused(one: LearnedMovement, other: LearnedMovement) -> LearnedMovement:
    precisions = np.linalg.inv(one.covariance), np.linalg.inv(other.covariance)
    covariance = np.linalg.inv(precisions[0] + precisions[1])
    velocity = covariance @ (precisions[0] @ one.velocity + precisions[1] @ other.velocity)
    trials = one.trials + other.trials
    scatter = np.sqrt((one.trials * one.scatter**2 + other.trials * other.scatter**2) / trials)
    return LearnedMovement(one.gait, velocity, covariance, scatter, trials)


_Driven = tuple[Gait, Passage, float | None]


def _driven(trials: Sequence[Trial]) -> list[_Driven]:
    valid = [trial for trial in trials if trial.outcome.is_valid and trial.poses]
    seen = [(trial.gait, passage(trial.poses), start_delay_s(trial.poses)) for trial in valid]
    return [(gait, piece, delay) for gait, piece, delay in seen if piece is not None]


def _vague(base: Repertoire, gaits: tuple[Gait, ...], driven: list[list[_Driven]]) -> Belief:
    """Return the belief before the runs: what the base says, and next to nothing of new gaits."""
    known = base.belief()
    size = _sizes(known.movements, driven)
    n, old = len(gaits), len(base.gaits)
    usual = np.append((1.5 * size) ** 2, [0.0, 0.0])
    mean, covariance = np.zeros(5 * n + 2), np.diag(np.append(np.tile(usual, n), [0.0, 0.0]))
    mean[: 5 * old] = known.mean[:-2]
    covariance[: 5 * old, : 5 * old] = known.covariance[:-2, :-2]
    return Belief(mean, covariance, _scatter(known, gaits, driven), drives(gaits))


def _sizes(known: Array, driven: list[list[_Driven]]) -> Array:
    """Return the usual size of forward, left and turn."""
    seen = np.array([_raw(piece) for run in driven for _, piece, _ in run]).reshape(-1, 3)
    squares = np.mean(np.concatenate([known, seen]) ** 2, axis=0)
    along = np.sqrt(squares[:2].mean())
    return np.maximum([along, along, np.sqrt(squares[2])], 5.0 * _LEAST)


def _scatter(known: Belief, gaits: tuple[Gait, ...], driven: list[list[_Driven]]) -> Array:
    """Return each gait's scatter from trial to trial: from its repeats, and what is usual of its size."""
    seen: dict[Gait, list[Array]] = defaultdict(list)
    for run in driven:
        for gait, piece, _ in run:
            seen[gait].append(_raw(piece))
    usual = _usual_scatter([np.array(of_gait) for of_gait in seen.values() if len(of_gait) > 1])
    rows = list(known.scatter)
    for gait in gaits:
        if gait in seen:
            of_gait = np.array(seen[gait])
            mean = of_gait.mean(axis=0)
            size = np.array([*[np.hypot(*mean[:2]) / np.sqrt(2.0)] * 2, abs(mean[2])])
            guess = _WEIGHT * ((usual * size) ** 2 + _LEAST**2)
            row = np.sqrt((guess + ((of_gait - mean) ** 2).sum(axis=0)) / (_WEIGHT + len(of_gait) - 1))
            if gait in gaits[: len(known.scatter)]:
                rows[gaits.index(gait)] = np.sqrt(0.5 * (row**2 + rows[gaits.index(gait)] ** 2))
            else:
                rows.append(row)
    return np.array(rows).reshape(-1, 3)


def _usual_scatter(repeated: list[Array]) -> Array:
    """Return the scatter over the size, of forward and left alike and of the turn, shape (3,)."""
    within, size = np.full(2, _WEIGHT * _USUAL_SCATTER**2), np.full(2, _WEIGHT)
    for of_gait in repeated:
        spread = ((of_gait - of_gait.mean(axis=0)) ** 2).sum(axis=0)
        whole = (of_gait**2).sum(axis=0) * (len(of_gait) - 1) / len(of_gait)
        unit = np.array([whole[:2].sum(), whole[2]]) + 1e-12
        within += (len(of_gait) - 1) * np.array([spread[:2].sum(), spread[2]]) / unit
        size += len(of_gait) - 1
    along, turn = np.sqrt(within / size)
    return np.array([along, along, turn])


def _raw(seen: Passage) -> Array:
    """Return the mean velocity of one trial in the robot's frame, with the floor's drift in it."""
    own = np.einsum("kji,kj->i", seen.rotation, seen.moved_m) / seen.total_s
    return np.append(own, seen.turned_rad / seen.total_s)
