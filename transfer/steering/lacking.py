"""What a repertoire lacks: the gait to try next while movements are being learned.

The measure is the expected time to goals all around, by the planner itself. Of a new gait two things can be foretold:
whether it moves at all (the drive, the sum of the squared frequencies) and, from the tried ones, which way it turns (a
linear function of the frequencies). New gaits are drawn, and chosen by these two. Those on which the plans to the goals
rely are repeated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.transfer.steering.planner import Abilities, Goal, plan
from vvvaltr.transfer.steering.repertoire import Repertoire

_FIRST = 8  # gaits that are drawn before anything can be said
_REPEATS = 0.35  # of the trials, at most
_ENOUGH = 3  # trials of a gait
_CANDIDATES = 48
_GOALS = 12
_AWAY_S = 20.0  # how far the goals are, in seconds at the usual speed
_UNEVEN = 0.6  # of the turning in one sense over the other, below which that sense is lacking


@dataclass(frozen=True, slots=True)
class Next:
    """A gait to try, and why, in two or three words."""

    gait: Gait
    why: str


def next_gait(repertoire: Repertoire, range_hz: tuple[float, float], motors: int, random: np.random.Generator) -> Next:
    """Return what to try next.

    Args:
        repertoire: what has been learned so far.
        range_hz: frequencies from which new gaits are drawn; where they are positive, in both senses of rotation.
        motors: how many.
        random: for the draws.
    """
    tried = len(repertoire.movements)
    if tried < _FIRST:
        return Next(drawn_gait(range_hz, motors, random), "new gait")
    trials = sum(movement.trials for movement in repertoire.movements)
    relied, _ = reach(repertoire)
    counts = np.array([movement.trials for movement in repertoire.movements])
    doubt = relied * np.array([movement.deviation[:2].max() for movement in repertoire.movements])
    doubt[counts >= _ENOUGH] = 0.0
    if trials - tried < _REPEATS * trials and doubt.max() > 0.0:
        return Next(repertoire.gaits[int(np.argmax(doubt))], "repeat of a good one")
    return _new(repertoire, range_hz, motors, random)


def reach(repertoire: Repertoire) -> tuple[Array, float]:
    """Return for how long the plans to goals all around use each movement (n,), and the mean of their times in s."""
    velocities = repertoire.velocities
    scatter = np.array([movement.scatter for movement in repertoire.movements])
    spread = np.hypot(scatter, np.array([movement.deviation for movement in repertoire.movements]))
    able = Abilities(velocities, spread, np.zeros((len(velocities), 4)), repertoire.delay_s, 0.3)
    away_m = _AWAY_S * float(np.median(np.hypot(velocities[:, 0], velocities[:, 1]))) + 1e-3
    used, times = np.zeros(len(velocities)), []
    for bearing in np.linspace(0.0, math.tau, _GOALS, endpoint=False):
        goal = Goal(away_m * math.cos(bearing), away_m * math.sin(bearing), 0.07 * away_m)
        way = plan(np.zeros(3), goal, able)
        times.append(way.expected_s)
        for movement, duration_s in way.steps:
            used[movement] += duration_s
    return used, float(np.mean(times))


def drawn_gait(range_hz: tuple[float, float], motors: int, random: np.random.Generator) -> Gait:
    """Return a random gait; a range of positive frequencies is used in both senses."""
    low_hz, high_hz = range_hz
    signs = random.choice([-1.0, 1.0], motors) if low_hz >= 0.0 else 1.0
    return Gait(tuple((signs * random.uniform(low_hz, high_hz, motors)).tolist()))


def _new(repertoire: Repertoire, range_hz: tuple[float, float], motors: int, random: np.random.Generator) -> Next:
    turns = repertoire.velocities[:, 2]
    tried_hz = np.array([gait.frequency_hz for gait in repertoire.gaits])
    candidates = [drawn_gait(range_hz, motors, random) for _ in range(_CANDIDATES)]
    candidates += [_mirrored(gait) for gait in repertoire.gaits if range_hz[0] >= 0.0 or -range_hz[0] == range_hz[1]]
    candidates = [gait for gait in candidates if gait not in set(repertoire.gaits)]
    hz = np.array([gait.frequency_hz for gait in candidates])
    drive = (hz**2).sum(axis=1)
    lively = drive >= np.quantile(drive, 0.4)  # what is driven weakly hardly moves
    per_hz = np.linalg.solve(tried_hz.T @ tried_hz + 0.1 * np.trace(tried_hz.T @ tried_hz) * np.eye(motors),
                             tried_hz.T @ turns)  # fmt: skip
    foretold = np.where(lively, hz @ per_hz, np.nan)
    to_left, to_right = np.sort(turns)[-2:].mean(), -np.sort(turns)[:2].mean()
    if min(to_left, to_right) < _UNEVEN * max(to_left, to_right):
        sense = 1.0 if to_left < to_right else -1.0
        return Next(candidates[int(np.nanargmax(sense * foretold))], "turning is lacking")
    if random.random() < 0.5:
        return Next(candidates[int(np.nanargmin(np.abs(foretold)))], "a straight one is lacking")
    return Next(candidates[int(random.choice(np.flatnonzero(lively)))], "new gait")


def _mirrored(gait: Gait) -> Gait:
    return replace(gait, frequency_hz=tuple(-frequency for frequency in gait.frequency_hz))
