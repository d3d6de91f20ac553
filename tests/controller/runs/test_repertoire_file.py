"""The movements beside a run's log: read as they were written, and refused in one line where no run writes them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.runs.repertoire_file import read_repertoire, table_of
from vvvaltr.transfer.steering.repertoire import LearnedMovement, Repertoire

KNOWN = Repertoire(
    tuple(
        LearnedMovement(Gait((hz, 12.0)), np.array([0.01, 0.0, 0.1]), 1e-6 * np.eye(3), np.full(3, 0.002), 2)
        for hz in (10.0, 11.0)
    ),
    (0.001, -0.002),
    0.3,
)


def write(folder: Path, table: dict[str, Any]) -> Path:
    path = folder / "source.json"
    path.write_text(json.dumps(table))
    return path


def test_a_repertoire_is_read_as_it_was_written(tmp_path: Path) -> None:
    assert table_of(read_repertoire(write(tmp_path, table_of(KNOWN)))) == table_of(KNOWN)
    assert read_repertoire(write(tmp_path, table_of(Repertoire()))) == Repertoire()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: rows[0].update(phase_rad=[0.0]), "phase_rad has 1 values for 2 motors"),
        (lambda rows: rows[0].update(frequency_hz=[], phase_rad=[], amplitude=[]), "movement 1 has no motors"),
        (lambda rows: rows[0].update(trials=0), "movement 1 has no motors, no trials"),
        (lambda rows: rows[1].update(scatter=[0.0, -1.0, 0.0]), "movement 2 has no motors, no trials or a scatter"),
        (lambda rows: rows[1].update(velocity=[1e300, 0.0, 0.0]), "movement 2 has numbers beyond 1000"),
        (lambda rows: rows[0].update(covariance=[[0.0] * 3] * 3), "the covariance of movement 1 is none"),
        (lambda rows: rows[0]["covariance"][0].reverse(), "the covariance of movement 1 is none"),
        (lambda rows: rows.append(rows[0]), "a gait is there twice"),
        (lambda rows: rows[0].update(frequency_hz=[1.0], phase_rad=[0.0], amplitude=[1.0]), "of different motors"),
    ],
)
def test_a_movement_that_no_run_writes_is_refused(
    tmp_path: Path, change: Callable[[list[dict[str, Any]]], None], said: str
) -> None:
    table = json.loads(json.dumps(table_of(KNOWN)))
    change(table["movements"])

    with pytest.raises(UserError, match=f"source.json: .*{said}.*; restore the file as the run wrote it"):
        read_repertoire(write(tmp_path, table))


@pytest.mark.parametrize("change", [{"delay_s": -1.0}, {"delay_s": 5.0}, {"drift_m_s": [1e300, 0.0]}])
def test_a_delay_or_drift_that_no_run_writes_is_refused(tmp_path: Path, change: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="drift_m_s or delay_s is beyond what a run writes"):
        read_repertoire(write(tmp_path, {**table_of(KNOWN), **change}))
