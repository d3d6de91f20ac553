"""The report of a run: every figure is there, nobody is asked for anything, nothing complains, and it is true."""

from __future__ import annotations

import math
import re
import shlex
from dataclasses import replace
from html import unescape
from pathlib import Path
from unittest.mock import Mock

import msgspec
import numpy as np
import pytest
from chromium import chromium
from sample_run import SOURCE, STRUCTURE, logged_trial, sample_run, weaker

from vvvaltr.controller.cli.learn import _asked
from vvvaltr.controller.cli.main import main, make_parser
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.records import AppliedFrequencies, LoggedTrial, Run
from vvvaltr.controller.core.values import Estimate, Outcome, Recommendation
from vvvaltr.controller.runs.config import load_config
from vvvaltr.controller.runs.log import LOG_NAME, RunLog
from vvvaltr.controller.view.commands import write_learn_command, write_trial_command
from vvvaltr.controller.view.run_figures import draw_convergence, draw_left_out, draw_motors
from vvvaltr.controller.view.run_findings import LeftOut, RunFindings, _leave_each_out, _rank, find_in_run
from vvvaltr.controller.view.run_report import _compare, write_run_report


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run, and one in another world that learned from it."""
    folder = tmp_path_factory.mktemp("runs")
    learn = ("learn", "--robot", "planar", "--duration", "1", "--no-recording", "--quiet")
    assert main([*learn, "--trials", "12", "--seed", "3", "--out", str(folder / "flat")]) == 0
    assert main([*learn, "--trials", "10", "--world", "hills", "--source", str(folder / "flat"),
                 "--out", str(folder / "hills")]) == 0  # fmt: skip
    return folder


def report(path: Path, page: Path) -> str:
    write_run_report(path, page)
    return page.read_text()


def write_log(path: Path, run: Run) -> Path:
    with RunLog.create(path, run.structure, run.sources, run.about) as log:
        for logged in run.trials:
            log.append(logged)
    return path


@pytest.mark.parametrize("width", [400, 1200])
def test_a_browser_shows_every_figure_and_asks_nobody_for_anything(runs: Path, tmp_path: Path, width: int) -> None:
    page = tmp_path / "report.html"
    write_run_report(runs / "hills", page)
    with chromium(tmp_path / "profile") as browser:
        browser.open(page, width)
        images = browser.evaluate(
            "[...document.images].map(i => [i.complete && i.naturalWidth > 300, i.alt.length > 20])"
        )
        assert len(images) >= 10
        assert images == [[True, True]] * len(images)
        assert browser.evaluate("document.documentElement.scrollWidth") <= width
        assert browser.evaluate("Math.min(...[...document.images].map(i => i.width))") > 300
        assert browser.requests() == [page.as_uri()]
        assert browser.complaints() == []


def test_it_is_one_small_file(runs: Path, tmp_path: Path) -> None:
    text = report(runs / "hills", tmp_path / "report.html")
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]
    assert len(text) < 3e6
    assert not re.search(r"(src|href)='(?!data:)", text)


def test_it_tells_gait_interval_rival_transfer_and_what_made_it(runs: Path, tmp_path: Path) -> None:
    text = unescape(report(runs / "hills", tmp_path / "report.html"))
    found = find_in_run(runs / "hills")
    (gait, estimate), (_, second), *_ = found.ranked
    assert f"{1000 * estimate.low:.1f} to {1000 * estimate.high:.1f} mm/s" in text
    how = "slower" if second.mean <= estimate.mean else "faster"
    assert f"is expected to be {1000 * abs(estimate.mean - second.mean):.1f} mm/s {how}" in text
    assert write_trial_command(gait, "planar", found.config) in text
    assert "--world hills" in write_trial_command(gait, "planar", found.config)
    assert str(runs / "flat") in text
    assert "trust at the end" in text
    assert found.run.about["version"] in text
    assert "so is the scatter between repeats" in text


def test_the_commands_are_understood_and_make_the_same_run(runs: Path) -> None:
    config = load_config(runs / "hills")
    again = make_parser().parse_args(shlex.split(write_learn_command(config))[1:])
    assert (again.trials, again.seed, again.world, again.method) == (10, config.seed, "hills", config.method)
    assert again.source == list(config.sources)
    assert again.reference is None
    watched = msgspec.structs.replace(config, reference_hz=(12.0, -14.5, 9.0), reference_every=5)
    again = make_parser().parse_args(shlex.split(write_learn_command(watched))[1:])
    assert _asked(again)["reference_hz"] == watched.reference_hz
    assert _asked(again)["reference_every"] == 5
    gait = Gait((1.0, -2.0, 3.0), (0.0, 0.5, 0.0), (1.0, 0.5, 1.0))
    driven = make_parser().parse_args(shlex.split(write_trial_command(gait, "", config))[1:])
    assert (driven.frequency_hz, driven.phase, driven.amplitude) == ([1, -2, 3], [0, 0.5, 0], [1, 0.5, 1])


def test_no_command_goes_beyond_what_the_motors_reach_because_it_was_rounded(runs: Path) -> None:
    most_hz = 1000.0 / 60.0
    config = msgspec.structs.replace(load_config(runs / "flat"), range_hz=(-most_hz, most_hz))
    again = make_parser().parse_args(shlex.split(write_learn_command(config))[1:])
    driven = make_parser().parse_args(
        shlex.split(write_trial_command(Gait((most_hz, -most_hz, 1.2346)), "", config))[1:]
    )

    assert tuple(again.range_hz) == config.range_hz
    assert driven.frequency_hz == [16.666, -16.666, 1.235]


@pytest.mark.parametrize(
    "run",
    [
        sample_run(trials=12),
        Run(None, (), (logged_trial(1),)),
        Run(STRUCTURE, (SOURCE,), tuple(replace(logged_trial(n), movement=None, applied=None) for n in range(1, 9))),
    ],
    ids=["with all fields", "one trial", "no movement"],
)
def test_any_log_has_a_report(tmp_path: Path, run: Run) -> None:
    text = report(write_log(tmp_path / "any.mcap", run), tmp_path / "report.html")
    assert "How it was made" in text


def test_reasons_and_suspicions_are_listed(tmp_path: Path) -> None:
    text = unescape(report(write_log(tmp_path / "any.mcap", sample_run(trials=12)), tmp_path / "report.html"))
    assert "no pose for 0.3 s: is the tag in view?" in text
    assert "turned faster than it can" in text
    assert "Battery: 7.39 V at the first trial, 7.28 V at the last." in text


def test_the_causes_of_scatter_are_told(tmp_path: Path) -> None:
    weak = Run(STRUCTURE, (), tuple(weaker(24, since=13)))
    told = unescape(report(write_log(tmp_path / "weak.mcap", weak), tmp_path / "report.html"))
    assert "from trial 13 on the robot moved 0.47 times as far" in told
    assert "trials 1 with 31.0, 6 with 30.0, 11 with 32.0, 16 with 14.0, 21 with 13.5 mm/s" in told


def test_markup_in_a_log_is_text_in_the_report(tmp_path: Path) -> None:
    failed = logged_trial(2, outcome=Outcome.LINK_LOST)
    evil = replace(failed, trial=replace(failed.trial, reason="<script>alert(1)</script>"))
    log = write_log(tmp_path / "any.mcap", Run(STRUCTURE, (), (logged_trial(1), evil)))
    assert "<script" not in report(log, tmp_path / "report.html")


def test_a_run_without_a_measurement_has_no_report(tmp_path: Path) -> None:
    log = write_log(tmp_path / "any.mcap", Run(STRUCTURE, (), (logged_trial(1, outcome=Outcome.LINK_LOST),)))
    with pytest.raises(UserError, match="no trial has measured anything"):
        write_run_report(log, tmp_path / "report.html")


SPACE = GaitSpace.over(2, 0.0, 10.0)


def smooth_trials(count: int, drift: float = 0.0, noise: float = 0.001) -> list[LoggedTrial]:
    """Trials of a smooth function over two motors, with noise, and a change over the run."""
    dice = np.random.default_rng(0)
    trials = []
    for number in range(1, count + 1):
        first, second = dice.uniform(0, 10, 2)
        score = 0.02 + 0.01 * math.sin(first / 3) + 0.001 * second + noise * dice.normal() + drift * number / count
        logged = logged_trial(number, poses=2)
        trials.append(replace(logged, trial=replace(logged.trial, gait=Gait((first, second))), score=score))
    return trials


def test_the_gaits_below_the_recommended_one_come_by_what_is_expected_of_them() -> None:
    speeds_m_s = {Gait((hz,)): Estimate(hz / 1000.0, 0.0, 0.1) for hz in (14.0, 9.0, 21.0, 7.0)}
    optimizer = Mock(promising=lambda count: tuple(speeds_m_s)[:count])
    optimizer.predict = lambda gaits: [speeds_m_s[gait] for gait in gaits]
    (recommended, *_) = speeds_m_s
    last = replace(logged_trial(1), recommendation=Recommendation(recommended, speeds_m_s[recommended]))

    ranked = _rank(optimizer, [last])

    assert [gait.frequency_hz[0] for gait, _ in ranked] == [14.0, 21.0, 9.0, 7.0]
    (_, best), *others = ranked
    assert "21.00 Hz, is expected to be 7.0 mm/s faster. The two intervals overlap" in _compare(best, others)
    assert "9.00 Hz, is expected to be 5.0 mm/s slower. The two intervals overlap" in _compare(best, others[1:])


def test_trials_that_all_went_backwards_lie_within_the_axes() -> None:
    observed = np.array([-0.02, -0.01, -0.005])
    left_out = LeftOut((), observed, observed, observed - 0.001, observed + 0.001, np.zeros(3))

    low, high = draw_left_out(left_out).axes[0].get_ylim()

    assert low < -20.0 and high > -5.0


def test_the_mean_of_the_first_trials_lies_within_the_axes_however_wrong_it_was(tmp_path: Path) -> None:
    trials = [logged_trial(1), logged_trial(2), logged_trial(3)]
    means = (0.3, -0.2, 0.04)
    told = [Recommendation(it.trial.gait, Estimate(m, m - 2.0, m + 2.0)) for it, m in zip(trials, means, strict=True)]
    told[-1] = replace(told[-1], estimate=Estimate(0.04, 0.03, 0.05))
    trials = [replace(it, recommendation=best) for it, best in zip(trials, told, strict=True)]

    low, high = (
        draw_convergence(RunFindings(tmp_path, Run(None, trials=tuple(trials)), None, None, None, (), None))
        .axes[0]
        .get_ylim()
    )

    assert -300.0 < low < -200.0
    assert 300.0 < high < 400.0


def test_each_of_many_motors_is_drawn_with_a_mark_of_its_own(tmp_path: Path) -> None:
    trials = [
        replace(logged_trial(number), applied=AppliedFrequencies((9.0,) * 60, measured=True)) for number in (1, 2)
    ]
    trials = [replace(it, trial=replace(it.trial, gait=Gait((9.0 + it.trial.number,) * 60))) for it in trials]
    found = RunFindings(tmp_path, Run(None, trials=tuple(trials)), None, None, None, (), None)

    figure = draw_motors(found)

    assert figure is not None
    marks = [(line.get_marker(), line.get_color()) for line in figure.axes[0].lines if line.get_marker() != "None"]
    assert len(marks) == len(set(marks)) == 60
    assert len(figure.axes[0].get_legend().get_texts()) == 60


def test_leaving_each_trial_out_predicts_it_with_an_honest_interval() -> None:
    left_out = _leave_each_out(SPACE, smooth_trials(60))
    errors = left_out.observed_m_s - left_out.median_m_s
    assert np.std(errors) < 0.5 * np.std(left_out.observed_m_s)
    assert 0.85 <= left_out.coverage <= 1.0


def test_a_trial_does_not_predict_itself() -> None:
    trials = smooth_trials(40)
    before = _leave_each_out(SPACE, trials)
    moved = [*trials[:-1], replace(trials[-1], score=trials[-1].score + 0.003)]
    after = _leave_each_out(SPACE, moved)
    assert abs(after.median_m_s[-1] - before.median_m_s[-1]) < 0.001


def test_a_robot_that_became_slower_is_said_to_have() -> None:
    assert (
        _leave_each_out(SPACE, smooth_trials(60)).drift.low < 0.0 < _leave_each_out(SPACE, smooth_trials(60)).drift.high
    )
    assert _leave_each_out(SPACE, smooth_trials(60, drift=-0.01)).drift.high < 0.0


def test_the_interval_of_a_drift_that_is_none_holds_0_in_19_of_20_short_runs() -> None:
    draws, nothing = np.random.default_rng(0), np.zeros(8)

    drifts = [LeftOut((), *[nothing] * 4, draws.normal(0.0, 1.0, 8)).drift for _ in range(2000)]

    assert 0.94 < np.mean([drift is not None and drift.low <= 0.0 <= drift.high for drift in drifts]) < 0.96


def test_coverage_is_the_share_within_the_interval() -> None:
    ones = np.ones(4)
    left_out = LeftOut((), np.array([0.0, 1.0, 1.5, 3.0]), ones, 0.5 * ones, 2.0 * ones, ones)
    assert left_out.coverage == 0.5


def test_the_command_writes_beside_the_run_and_refuses_what_is_for_a_campaign(runs: Path) -> None:
    assert main(["report", str(runs / "flat"), "--quiet"]) == 0
    assert (runs / "flat" / "report.html").exists()
    assert main(["report", str(runs / "flat" / LOG_NAME), "--markdown"]) == 2
