"""The expected speed over two motors at a time, as the runs of an experiment learned it on source and target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.streams import stream
from vvvaltr.transfer.bayes.belief import learn_alone
from vvvaltr.transfer.bayes.search import places
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.experiments.unit import Result

GRID_POINTS = 21  # along each axis; odd, so that one of them is off where motors may turn both ways
MOST_TRIALS = 250  # trials that one model is fitted to; the time of a fit grows with their cube


@dataclass(frozen=True, slots=True)
class Slice:
    """Expected speeds over two motors, with the third at a fixed frequency.

    Args:
        motors: indices of the two motors.
        held_hz: frequency of the third motor.
        source_m_s: speeds on the source, ``[i, j]`` at frequency i of the second motor and j of the first.
        target_m_s: speeds on the target, likewise.
    """

    motors: tuple[int, int]
    held_hz: float
    source_m_s: Array
    target_m_s: Array


@dataclass(frozen=True, slots=True)
class Surfaces:
    """Slices through the learned surfaces of source and target.

    Args:
        frequency_hz: frequencies of every axis, (GRID_POINTS,).
        best_hz: frequencies of the gait that is expected to be the target's fastest.
        slices: one slice for each pair of motors.
    """

    frequency_hz: tuple[float, ...]
    best_hz: tuple[float, ...]
    slices: tuple[Slice, ...]


def fit_surfaces(space: GaitSpace, source: Sequence[Result], target: Sequence[Result]) -> Surfaces:
    """Fit a model to the trials of several runs each on source and target, and return slices through both.

    The motor that a slice leaves out is off, as in section 8.1 of the thesis, where motors may turn both ways;
    otherwise it runs as in the target's best gait. Source and target are cut at the same place.

    Args:
        space: gaits of three motors.
        source: runs on the source.
        target: runs on the target.
    """
    line = np.linspace(0.0, 1.0, GRID_POINTS)
    grid = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    of_source, of_target = (_expected_m_s(space, runs, grid).reshape((GRID_POINTS,) * 3) for runs in (source, target))
    best = np.unravel_index(int(of_target.argmax()), of_target.shape)
    first = space.parameters[0]
    frequency_hz = first.low + line * (first.high - first.low)
    held = (GRID_POINTS // 2,) * 3 if first.low == -first.high else tuple(map(int, best))

    def cut(motors: tuple[int, int]) -> Slice:
        (third,) = {0, 1, 2} - set(motors)
        at = held[third]
        source_m_s, target_m_s = (np.asarray(it.take(at, axis=third).T) for it in (of_source, of_target))
        return Slice(motors, float(frequency_hz[at]), source_m_s, target_m_s)

    return Surfaces(
        tuple(frequency_hz.tolist()),
        tuple(float(frequency_hz[i]) for i in best),
        tuple(map(cut, combinations(range(3), 2))),
    )


def _expected_m_s(space: GaitSpace, runs: Sequence[Result], x: Array) -> Array:
    """Return the speeds (m,) in m/s that a model of the runs' trials expects at places (m, 3)."""
    steps = [step for run in runs for step in run.steps][:MOST_TRIALS]
    tried = places(space, [Gait(step.gait_hz) for step in steps])
    trials = Trials(tried, np.array([step.score_m_s for step in steps]))
    belief = learn_alone(space, trials, None, stream(0, 0, "surfaces"))
    return np.array([estimate.mean for estimate in belief.estimates(x)])
