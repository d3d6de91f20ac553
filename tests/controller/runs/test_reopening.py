"""A twin that is left where it stopped is taken up where a run was broken off."""

from pathlib import Path

import pytest

from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.runs.log import read_run
from vvvaltr.controller.runs.run import RunDirectory

ASKED = {"seed": 3, "duration_s": 1.0, "range_hz": (-16.0, 16.0)}


def make(path: Path, twin: str, trials: int) -> RunDirectory:
    asked = {**ASKED, "robot": {"name": twin, "scatter": "hurried:spin_up_s=0.1"}, "trials": trials}
    run = RunDirectory.create(path, asked)
    for _ in run.learn():
        pass
    run.close()
    return run


@pytest.mark.parametrize("twin", ["planar", "spatial"])
def test_a_resumed_run_goes_on_bit_for_bit_with_a_twin_that_was_left_where_it_stopped(
    tmp_path: Path, twin: str
) -> None:
    make(tmp_path / "whole", twin, 6)
    make(tmp_path / "broken", twin, 4)

    resumed = RunDirectory.resume(tmp_path / "broken", {"trials": 6})
    list(resumed.learn())
    resumed.close()

    whole, again = read_run(tmp_path / "whole").trials, read_run(tmp_path / "broken").trials
    assert [it.trial.poses for it in again] == [it.trial.poses for it in whole]
    assert [(it.suggestion, it.score, it.recommendation) for it in again] == [
        (it.suggestion, it.score, it.recommendation) for it in whole
    ]


def test_after_an_interrupted_drive_the_twin_stands_where_the_log_saw_it_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = make(tmp_path / "run", "planar", 2)
    monkeypatch.setattr("vvvaltr.controller.runs.reopening._BROKEN_OFF", (Outcome.COMPLETED,))

    resumed = RunDirectory.resume(run.path, {"trials": 3})
    (third,) = resumed.learn()
    resumed.close()

    last = read_run(run.path).trials[1].movement
    assert last is not None and third.movement is not None
    assert third.movement.start.position_m[0] == pytest.approx(last.end.position_m[0], abs=0.002)
