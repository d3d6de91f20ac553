import json
from itertools import count
from typing import Any

import numpy as np
import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.errors import TrackingLost, UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.loop.one_trial import make_trial
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.controller.runs.log import LOG_NAME, read_run
from vvvaltr.controller.studies import compare as study
from vvvaltr.controller.studies.compare import Comparison, Contest, compare
from vvvaltr.twin.presets import planar_robot

FAST, SLOW = Gait((12.0, 14.0, 16.0)), Gait((9.0, 15.0, -7.0))
SHORT = TrialSettings(duration_s=1.0)


def test_the_faster_of_two_gaits_is_found_in_turns_and_no_trial_is_made_after_that():
    comparison = Comparison(Contest((SLOW, FAST), trials=40))
    trials = list(compare(planar_robot(seed=1), SHORT, comparison, lambda _: None))

    assert comparison.best == 1
    assert len(trials) == 2 * len(comparison.scores) < 40
    for start in range(0, len(trials), 2):
        assert {logged.trial.gait for logged in trials[start : start + 2]} == {FAST, SLOW}


def test_two_gaits_that_hardly_differ_use_the_trials_up():
    comparison = Comparison(Contest((FAST, Gait((12.0, 14.0, 16.01))), trials=9))

    trials = list(compare(planar_robot(seed=1), SHORT, comparison, lambda _: None))

    assert (len(trials), comparison.best) == (8, None)
    assert comparison.describe()["better"] is None


def test_a_trial_that_failed_is_made_again_and_three_in_a_row_end_it():
    robot, recorded = planar_robot(seed=1), []

    def lost() -> Pose:
        raise TrackingLost("nobody sees the robot")

    with pytest.raises(UserError, match="3 trials in a row failed; the last one: tracking lost"):
        robot.tracker.pose = lost  # type: ignore[method-assign]
        list(compare(robot, SHORT, Comparison(Contest((FAST, SLOW))), recorded.append))
    assert len({logged.trial.gait for logged in recorded}) == 1 and len(recorded) == 3


def test_impossible_contests_are_refused():
    with pytest.raises(ValueError, match="two gaits or more"):
        Contest((FAST,))
    with pytest.raises(ValueError, match="all different"):
        Contest((FAST, FAST))
    with pytest.raises(ValueError, match="less than two rounds"):
        Contest((FAST, SLOW), trials=3)


def test_the_command_says_which_is_better_how_much_and_keeps_the_trials(tmp_path, capsys):
    out = tmp_path / "compared"
    asked = [
        "compare",
        "12,14,16",
        "-9,15,-7",
        "--robot",
        "planar",
        "--duration",
        "1",
        "--out",
        str(out),
        "--json",
        "-q",
    ]

    assert main(asked) == 0

    found = json.loads(capsys.readouterr().out)
    assert found["better"] == [12.0, 14.0, 16.0]
    (other,) = found["differences"]
    assert 0.0 < other["low_m_s"] < other["slower_by_m_s"] < other["high_m_s"]
    logged = read_run(out / LOG_NAME).trials
    scores = [it.score for it in logged if it.trial.gait.frequency_hz == (12.0, 14.0, 16.0)]
    assert np.mean(scores) == pytest.approx(found["gaits"][0]["mean_m_s"])


def test_a_run_stands_for_the_gait_it_recommends_on_its_own_robot(tmp_path, capsys):
    run = tmp_path / "run"
    learned = ["learn", "--robot", "planar", "--trials", "9", "--duration", "1", "--out", str(run), "-q"]
    assert main([*learned, "--no-recording"]) == 0
    capsys.readouterr()

    assert main(["compare", str(run), "4,4,4", "--duration", "1", "--json", "-q"]) == 0

    found = json.loads(capsys.readouterr().out)
    recommended = read_run(run / LOG_NAME).trials[-1].recommendation
    assert recommended is not None
    assert found["better"] == pytest.approx(list(recommended.gait.frequency_hz))


def test_what_recommends_nothing_is_said_with_its_cure(capsys):
    assert main(["compare", "runs/none", "4,4,4", "--robot", "planar"]) in (1, 2)
    assert "runs/none" in capsys.readouterr().err


def test_an_interrupt_leaves_a_summary_of_the_rounds_that_were_driven(tmp_path, monkeypatch, capsys):
    out, calls = tmp_path / "compared", count(1)

    def make_or_interrupt(*arguments: Any) -> LoggedTrial:
        if next(calls) == 6:
            raise KeyboardInterrupt("SIGINT")
        return make_trial(*arguments)

    monkeypatch.setattr(study, "make_trial", make_or_interrupt)

    assert main(["compare", "12,14,16", "12,14,16.01", "--duration", "1", "--out", str(out), "-q"]) == 130

    summary = json.loads((out / "summary.json").read_text())
    assert (summary["rounds"], summary["better"], summary["run"], summary["trials"]) == (2, None, str(out), 5)
    assert f"interrupted (SIGINT; what was driven is saved in {out})" in capsys.readouterr().err
    assert len(read_run(out).trials) == 5


def test_a_folder_that_is_there_already_keeps_its_own_summary(tmp_path):
    (tmp_path / "summary.json").write_text("mine")
    assert main(["compare", "12,14,16", "9,15,7", "--out", str(tmp_path), "-q"]) == 1
    assert (tmp_path / "summary.json").read_text() == "mine"
