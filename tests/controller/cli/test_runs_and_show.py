"""`vvvaltr runs`, `vvvaltr show`, and how a run tells of its trials."""

from __future__ import annotations

import json
import os
import pty
import re
import shutil
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from sample_run import sample_run

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.values import Estimate, Recommendation
from vvvaltr.controller.runs.listing import State, describe_run, list_runs
from vvvaltr.controller.runs.log import LOG_NAME, RunLog
from vvvaltr.controller.runs.run import RunDirectory
from vvvaltr.controller.view.terminal import lay_out_columns, plot_speeds

RUN = sample_run(trials=12)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with a complete run, one that learned from it, and one by hand."""
    folder = tmp_path_factory.mktemp("runs")
    learn = ("learn", "--robot", "planar", "--duration", "1", "--no-recording", "--quiet")
    assert main([*learn, "--trials", "3", "--out", str(folder / "flat")]) == 0
    assert main([*learn, "--trials", "2", "--world", "hills", "--source", str(folder / "flat"),
                 "--out", str(folder / "hills")]) == 0  # fmt: skip
    assert main(["trial", "9", "9", "9", "--duration", "1", "--quiet", "--out", str(folder / "tried")]) == 0
    return folder


def test_runs_lists_what_each_run_is_and_has_found(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", str(runs), "--json"]) == 0
    found = {Path(run["run"]).name: run for run in json.loads(capsys.readouterr().out)["runs"]}
    assert found["flat"]["state"] == found["hills"]["state"] == "complete"
    assert found["flat"]["trials"] == 3
    assert found["hills"]["world"] == "hills"
    assert found["hills"]["method"] == "guarded"
    assert [Path(source).name for source in found["hills"]["sources"]] == ["flat"]
    assert found["flat"]["low_m_s"] <= found["flat"]["mean_m_s"] <= found["flat"]["high_m_s"]
    assert found["tried"]["state"] == "by hand"
    assert found["tried"]["mean_m_s"] is None


@pytest.mark.parametrize("width", [40, 60, 80])
def test_no_line_is_wider_than_the_terminal(
    runs: Path, width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    assert main(["runs", str(runs)]) == 0
    table = capsys.readouterr().out.splitlines()
    assert main(["show", str(runs / "hills")]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert max(map(len, [*table, *shown])) <= width
    assert "mm/s" in table[0]


def test_a_run_is_shown_however_narrow_the_terminal_says_that_it_is(
    runs: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "1")

    assert main(["show", str(runs / "flat")]) == 0
    assert "o measured" in capsys.readouterr().out


def test_trials_of_a_reference_do_not_make_a_run_complete(tmp_path: Path) -> None:
    run = tmp_path / "run"
    asked = "--robot planar --method random --duration 0.5 --trials 3 --reference 12,-14,9:1"
    assert main(["learn", *asked.split(), "--out", str(run), "--no-recording", "--quiet"]) == 0
    found = describe_run(run)
    assert (found.trials, found.wanted, found.state) == (5, 3, State.COMPLETE)

    config, summary = run / "run.toml", run / "summary.json"  # as of a run that was stopped after these trials
    config.write_text(config.read_text().replace("trials = 3", "trials = 4"))
    summary.write_text(summary.read_text().replace('"complete": true', '"complete": false'))
    assert describe_run(run).state is State.STOPPED


def test_a_run_whose_log_is_open_is_running_and_one_that_ended_early_is_stopped(runs: Path) -> None:
    config, summary = (runs / "flat" / "run.toml").read_text(), (runs / "flat" / "summary.json").read_text()
    (runs / "flat" / "run.toml").write_text(config.replace("trials = 3", "trials = 9"))
    (runs / "flat" / "summary.json").write_text(summary.replace('"complete": true', '"complete": false'))
    try:
        assert describe_run(runs / "flat").state is State.STOPPED
        with RunLog.recover(runs / "flat" / LOG_NAME)[0]:
            assert describe_run(runs / "flat").state is State.RUNNING
    finally:
        (runs / "flat" / "run.toml").write_text(config)
        (runs / "flat" / "summary.json").write_text(summary)


def test_a_run_that_ends_by_its_own_rule_is_complete(tmp_path: Path) -> None:
    run = tmp_path / "run"
    learn = ["learn", "--no-recording", "--quiet"]
    asked = "--robot planar --method plain --duration 0.5 --trials 30 --stop-when 1000 --seed 1"
    assert main([*learn, *asked.split(), "--out", str(run)]) == 0
    assert (describe_run(run).trials or 0) < 30
    assert describe_run(run).state is State.COMPLETE


def test_a_run_that_is_prolonged_is_not_complete_any_more(runs: Path, tmp_path: Path) -> None:
    run = tmp_path / "flat"
    shutil.copytree(runs / "flat", run)

    with closing(RunDirectory.resume(run, {"trials": 9})) as prolonged:
        next(iter(prolonged.learn()))

    assert describe_run(run).state is State.STOPPED


@pytest.mark.parametrize(
    ("config", "summary", "trials", "wanted", "state"),
    [
        ('method = "repertoire"\ntrials = 12', {"trials": 12, "outcomes": {"completed": 12}}, 12, 12, State.COMPLETE),
        ('method = "repertoire"\ntrials = 12', {"trials": 9, "outcomes": {"completed": 9}}, 9, 12, State.STOPPED),
        ('method = "repertoire"\ntrials = 12\nsources = ["a"]', None, None, None, State.ASKED),
        ('method = "go"\ntrials = 1', {"reached": True, "primitives": 7}, 7, None, State.COMPLETE),
        ('method = "go"\ntrials = 1', {"reached": False, "primitives": 7}, 7, None, State.STOPPED),
        ('method = "go"\ntrials = 1', None, None, None, State.STOPPED),  # killed
        ('method = "jog"\ntrials = 1', {"trials": 3}, 3, None, State.ASKED),
    ],
)
def test_runs_that_steer_are_complete_by_what_they_are_made_for(
    tmp_path: Path, config: str, summary: dict[str, Any] | None, trials: int | None, wanted: int | None, state: State
) -> None:
    (tmp_path / "run.toml").write_text(config)
    (tmp_path / LOG_NAME).touch()
    if summary is not None:
        (tmp_path / "summary.json").write_text(json.dumps(summary))

    listed = describe_run(tmp_path)

    assert (listed.trials, listed.wanted, listed.state) == (trials, wanted, state)


@pytest.mark.parametrize("text", ["trials = [", "[1]", "robot = 3", "\xff"])
def test_a_damaged_file_does_not_hide_the_other_runs(tmp_path: Path, text: str) -> None:
    for name in ("whole", "damaged"):
        (tmp_path / name).mkdir()
        RunLog.create(tmp_path / name / LOG_NAME, None).close()
    (tmp_path / "damaged" / "run.toml").write_text(text, encoding="latin-1")
    (tmp_path / "damaged" / "summary.json").write_text("[")
    states = {run.path.name: run.state for run in list_runs(tmp_path)}
    assert states == {"whole": State.ASKED, "damaged": State.UNREADABLE}


@pytest.mark.parametrize(
    "summary",
    [
        '{"trials": "x"}', '{"trials": 1e400}', '{"recommended": {"mean_m_s": "fast", "low_m_s": 0, "high_m_s": 1}}',
        '{"best_observed": {"score_m_s": [1]}}', '{"outcomes": {"completed": "3"}}', '{"a": ' + "[" * 100_000, "NaN",
    ],
)  # fmt: skip
def test_an_absurd_summary_does_not_hide_the_other_runs(tmp_path: Path, summary: str) -> None:
    for name in ("whole", "damaged"):
        (tmp_path / name).mkdir()
        RunLog.create(tmp_path / name / LOG_NAME, None).close()
    (tmp_path / "damaged" / "summary.json").write_text(summary)

    assert main(["runs", str(tmp_path)]) == 0
    assert {run.path.name: run.state for run in list_runs(tmp_path)}["damaged"] is State.UNREADABLE


@pytest.mark.parametrize("name", ["run.toml", "summary.json", LOG_NAME])
@pytest.mark.parametrize("special", ["pipe", "folder", "device"])
def test_what_is_no_file_is_not_waited_for(
    runs: Path, tmp_path: Path, name: str, special: str, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(runs / "flat", tmp_path / "flat")
    place = tmp_path / "flat" / name
    place.unlink()
    {"pipe": os.mkfifo, "folder": Path.mkdir, "device": lambda it: it.symlink_to("/dev/zero")}[special](place)

    assert main(["runs", str(tmp_path)]) == 0
    assert main(["show", str(tmp_path / "flat")]) == (0 if name == "summary.json" else 1)
    assert len(capsys.readouterr().err.splitlines()) <= 1


def test_a_directory_without_runs_says_what_makes_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", str(tmp_path)]) == 0
    assert "vvvaltr learn makes one" in capsys.readouterr().out
    assert main(["runs", str(tmp_path / "missing")]) == 1


def test_show_tells_the_best_gait_as_a_command_that_works(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(runs / "flat")]) == 0
    out = capsys.readouterr().out
    command = re.search(r"vvvaltr (trial .*?)\n\S", out, re.S)[1].split()
    assert main([*command, "--duration", "1", "--quiet"]) == 0
    assert "95 % interval" in out
    assert "3 completed" in out


def test_show_opens_a_bare_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with RunLog.create(tmp_path / "any.mcap", RUN.structure) as log:
        for logged in RUN.trials:
            log.append(logged)
    assert main(["show", str(tmp_path / "any.mcap")]) == 0
    out = capsys.readouterr().out
    assert "11 completed, 1 tracking lost" in out
    assert "suspect    trials 1, 3, 4" in out


def test_the_plot_has_a_mark_for_each_trial() -> None:
    plot = plot_speeds(RUN.trials, width=80)
    marks = [line.partition("|")[2] for line in plot.splitlines()[1:-1]]
    assert sum(line.count("o") for line in marks) == 11
    assert sum(line.count("x") for line in marks) == 1
    fastest = max(1000 * logged.score for logged in RUN.trials if logged.score is not None)
    assert marks[0].strip()
    assert float(plot.splitlines()[1].partition("|")[0]) >= fastest - 0.1
    assert plot.isascii()


def test_a_first_mean_that_is_vague_does_not_squeeze_the_trials() -> None:
    first, *others = RUN.trials
    vague = replace(first, recommendation=Recommendation(first.trial.gait, Estimate(9.0, 0.0, 90.0)))

    assert plot_speeds([vague, *others], width=80).splitlines()[1] == plot_speeds(RUN.trials, width=80).splitlines()[1]


def test_a_long_run_shares_the_columns_of_a_narrow_plot() -> None:
    assert max(map(len, plot_speeds(sample_run(trials=300, poses=2).trials, width=60).splitlines())) <= 60


def test_columns_go_one_by_one_until_the_table_fits() -> None:
    rows = [("a" * 10, "b" * 10, "c" * 10)]
    assert lay_out_columns(("x", "y", "z"), rows, 40, ("y", "z")).splitlines()[0].split() == ["x", "y", "z"]
    assert lay_out_columns(("x", "y", "z"), rows, 25, ("y", "z")).splitlines()[0].split() == ["x", "z"]
    assert lay_out_columns(("x", "y", "z"), rows, 6, ("y", "z")).splitlines() == ["x", "aaaaaa"]


LEARN = ("learn", "--duration", "1", "--trials", "3", "--no-recording")


def test_away_from_a_terminal_each_trial_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*LEARN, "--out", str(tmp_path / "run")]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("trial")]
    assert [line.split(":")[0] for line in lines] == ["trial 1, 1 of 3", "trial 2, 2 of 3", "trial 3, 3 of 3"]
    best = r"best (not known yet|[\d.]+ \(-?\d+ to \d+\))"
    assert re.fullmatch(rf"trial 2, 2 of 3: [\d.]+ mm/s, {best}; 0:0\d left", lines[1])


def test_an_interval_that_reaches_far_beyond_its_mean_is_no_best_gait_yet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["learn", "--trials", "1", "--seed", "2", "--no-recording", "--out", str(tmp_path / "run")]) == 0
    assert re.search(r"trial 1, 1 of 1: [\d.]+ mm/s, best not known yet\n", capsys.readouterr().err)


def test_on_a_terminal_a_bar_within_its_width_tells_best_and_time_left(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "vvvaltr", *LEARN, "--out", str(tmp_path / "run")]
    environment = {**os.environ, "COLUMNS": "72", "NO_COLOR": "1"}
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs, env=environment)
    os.close(theirs)
    text, deadline_s = b"", time.monotonic() + 60.0
    while time.monotonic() < deadline_s:
        try:
            text += os.read(ours, 65536)
        except OSError:  # the program has closed its end
            break
    os.close(ours)
    assert process.wait(20.0) == 0
    last = text.decode().replace("\r", "\n").rstrip().splitlines()[-1]
    assert len(last) <= 72
    assert "3/3" in last
    assert "left" in last
    assert "best" in last
    assert "\x1b[3" not in text.decode()  # no colour
