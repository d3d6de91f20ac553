import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sample_run import logged_trial, sample_run

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.records import Run
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.runs.log import read_run
from vvvaltr.controller.runs.table import write_csv

RUN = sample_run()
FIXTURES = Path(__file__).parents[2] / "fixtures" / "version_0_1"


def test_a_row_says_of_a_trial_what_the_log_says() -> None:
    table, logged = RUN.table(), RUN.trials[2]

    row = table[2]

    assert row["number"] == 3
    assert row["outcome"] == "completed"
    assert [row[f"motor_{motor}_hz"] for motor in (1, 2, 3)] == list(logged.trial.gait.frequency_hz)
    assert [row[f"applied_{motor}_hz"] for motor in (1, 2, 3)] == list(logged.applied.mean_hz)
    assert row["applied_measured"]
    assert row["score_m_s"] == logged.score
    assert row["forward_m"] == logged.movement.displacement.forward_m
    assert (row["start_x_m"], row["start_y_m"]) == logged.movement.start.position_m[:2]
    assert row["end_yaw_rad"] == logged.movement.end.yaw_rad
    assert row["battery_v"] == logged.trial.conditions.battery_v
    assert row["expected_high_m_s"] == logged.suggestion.expected.high
    assert row["recommended_2_hz"] == logged.recommendation.gait.frequency_hz[1]
    assert row["recommended_low_m_s"] == logged.recommendation.estimate.low
    assert (row["verdict"], row["notes"], row["is_suspect"]) == ("keep", "a cable touched it", True)


def test_what_a_failed_trial_does_not_know_is_nan_and_its_reason_is_whole() -> None:
    row = RUN.table()[1]

    assert row["outcome"] == "tracking_lost"
    assert row["reason"] == RUN.trials[1].trial.reason
    for column in ("score_m_s", "expected_mean_m_s", "recommended_1_hz", "recommended_mean_m_s", "start_position_sd_m"):
        assert math.isnan(row[column])


def test_a_trial_without_poses_and_states_has_no_movement() -> None:
    bare = replace(logged_trial(1, outcome=Outcome.LINK_LOST), movement=None, applied=None)
    row = Run(trials=(bare,)).table()[0]
    assert all(math.isnan(row[column]) for column in ("forward_m", "turn_rad", "end_x_m", "applied_3_hz"))
    assert not row["applied_measured"]


def test_columns_are_selected_and_computed_with() -> None:
    table = RUN.table()
    valid = table[table["outcome"] == "completed"]
    assert valid["score_m_s"].mean() == pytest.approx(np.mean([it.score for it in RUN.trials if it.score is not None]))
    assert np.nanmax(table["score_m_s"]) == max(it.score for it in RUN.trials if it.score is not None)


def test_a_run_without_trials_is_an_empty_table() -> None:
    table = Run().table()
    assert table.shape == (0,)
    assert table.dtype.names is not None and "score_m_s" in table.dtype.names


def test_the_columns_and_types_are_the_documented_ones() -> None:
    text = (Path(__file__).parents[3] / "docs" / "log.md").read_text()
    for name in RUN.table().dtype.names:
        shown = name.replace("end_", "start_")
        for motor in "123":
            shown = shown.replace(f"_{motor}_", "_K_")
        assert f"`{shown}`" in text
    kinds = {name: RUN.table().dtype[name].kind for name in ("number", "score_m_s", "reason", "is_suspect")}
    assert kinds == {"number": "i", "score_m_s": "f", "reason": "U", "is_suspect": "b"}


def test_a_run_of_version_0_1_is_a_table_too() -> None:
    table = read_run(FIXTURES / "run").table()
    assert len(table) == 9
    assert np.isfinite(table["forward_m"]).all()
    assert np.isnan(table["battery_v"]).all()


def test_csv_has_the_names_all_digits_and_empty_cells_for_what_is_not_known(tmp_path: Path) -> None:
    write_csv(RUN.table(), tmp_path / "run.csv")

    with (tmp_path / "run.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == RUN.table().dtype.names
    assert [float(row["score_m_s"]) for row in rows if row["score_m_s"]] == [
        logged.score for logged in RUN.trials if logged.score is not None
    ]
    assert rows[1]["score_m_s"] == ""
    assert rows[1]["reason"] == RUN.trials[1].trial.reason


def test_a_csv_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot be written: No such file or directory; name another file"):
        write_csv(RUN.table(), tmp_path / "nowhere" / "run.csv")
