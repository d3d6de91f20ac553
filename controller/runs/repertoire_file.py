"""Movements as a file beside a run's log: what the run began with."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from vvvaltr.controller.core.disk import read_bytes
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Trial
from vvvaltr.transfer.steering.passage import STEADY_S
from vvvaltr.transfer.steering.repertoire import LearnedMovement, Repertoire, learn_repertoire

SOURCE_NAME = "source.json"

_GREATEST = 1e3  # m/s or rad/s, of a movement


def known_in_run(path: Path, trials: Sequence[Trial]) -> Repertoire:
    """Return what a run tells of movements: what it began with, and its own trials. Raises UserError if damaged."""
    source = path / SOURCE_NAME
    base = read_repertoire(source) if source.exists() else Repertoire()
    return learn_repertoire(split_runs(trials), base)


class _Row(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    frequency_hz: tuple[float, ...]
    phase_rad: tuple[float, ...]
    amplitude: tuple[float, ...]
    velocity: tuple[float, float, float]
    covariance: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    scatter: tuple[float, float, float]
    trials: int


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    movements: tuple[_Row, ...]
    drift_m_s: tuple[float, float]
    delay_s: float


def table_of(repertoire: Repertoire) -> dict[str, Any]:
    """Return a repertoire as plain data."""
    rows = [
        {
            "frequency_hz": movement.gait.frequency_hz,
            "phase_rad": movement.gait.phase_rad,
            "amplitude": movement.gait.amplitude,
            "velocity": movement.velocity.tolist(),
            "covariance": movement.covariance.tolist(),
            "scatter": movement.scatter.tolist(),
            "trials": movement.trials,
        }
        for movement in repertoire.movements
    ]
    return {"movements": rows, "drift_m_s": repertoire.drift_m_s, "delay_s": repertoire.delay_s}


def read_repertoire(path: Path) -> Repertoire:
    """Return the movements that a file holds. Raises UserError if it is damaged."""
    try:
        table = msgspec.json.decode(read_bytes(path), type=_Table)
        movements = tuple(_read_movement(number, row) for number, row in enumerate(table.movements, start=1))
        _check_together(table, movements)
    except (ValueError, OSError, RecursionError) as error:  # of JSON, its types and its numbers alike
        raise UserError(f"{path}: {error}; restore the file as the run wrote it") from None
    return Repertoire(movements, table.drift_m_s, table.delay_s)


def _read_movement(number: int, row: _Row) -> LearnedMovement:
    """Return a movement. Raises ValueError for what no run writes."""
    gait = Gait(row.frequency_hz, row.phase_rad, row.amplitude)
    velocity, covariance, scatter = map(np.array, (row.velocity, row.covariance, row.scatter))
    if not gait.motor_count or row.trials < 1 or scatter.min() < 0.0:
        raise ValueError(f"movement {number} has no motors, no trials or a scatter below 0")
    if max(map(np.max, map(np.abs, (velocity, covariance, scatter)))) > _GREATEST:
        raise ValueError(f"movement {number} has numbers beyond {_GREATEST:g}")
    if not (np.allclose(covariance, covariance.T) and np.linalg.eigvalsh(covariance).min() > 0.0):
        raise ValueError(f"the covariance of movement {number} is none")
    return LearnedMovement(gait, velocity, covariance, scatter, row.trials)


def _check_together(table: _Table, movements: Sequence[LearnedMovement]) -> None:
    """Raise ValueError where movements do not make a repertoire."""
    gaits = [movement.gait for movement in movements]
    if len(set(gaits)) < len(gaits) or len({gait.motor_count for gait in gaits}) > 1:
        raise ValueError("a gait is there twice, or gaits are of different motors")
    if max(map(abs, table.drift_m_s)) > _GREATEST or not 0.0 <= table.delay_s <= STEADY_S:
        raise ValueError(f"drift_m_s or delay_s is beyond what a run writes, {_GREATEST:g} m/s and 0 to {STEADY_S:g} s")


def split_runs(trials: Sequence[Trial]) -> list[list[Trial]]:
    """Return the trials of each run of a log that holds several: where the numbers begin again, another run begins."""
    runs: list[list[Trial]] = []
    for trial in trials:
        if not runs or trial.number <= runs[-1][-1].number:
            runs.append([])
        runs[-1].append(trial)
    return runs
