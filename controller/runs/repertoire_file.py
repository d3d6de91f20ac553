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
from vvvaltr.transfer.steering.repertoire import LearnedMovement, Repertoire, learn_repertoire

SOURCE_NAME = "source.json"


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
    except (msgspec.DecodeError, msgspec.ValidationError, OSError, RecursionError) as error:
        raise UserError(f"{path}: {error}; restore the file as the run wrote it") from None
    movements = tuple(
        LearnedMovement(
            Gait(row.frequency_hz, row.phase_rad, row.amplitude),
            np.array(row.velocity),
            np.array(row.covariance),
            np.array(row.scatter),
            row.trials,
        )
        for row in table.movements
    )
    return Repertoire(movements, table.drift_m_s, table.delay_s)


def split_runs(trials: Sequence[Trial]) -> list[list[Trial]]:
    """Return the trials of each run of a log that holds several: where the numbers begin again, another run begins."""
    runs: list[list[Trial]] = []
    for trial in trials:
        if not runs or trial.number <= runs[-1][-1].number:
            runs.append([])
        runs[-1].append(trial)
    return runs
