"""`vvvaltr learn --events`: a program follows a run."""

import json
import os
import threading
from datetime import UTC, datetime
from pathlib import Path

import pytest

from vvvaltr import __version__
from vvvaltr.controller.cli.main import main
from vvvaltr.controller.runs.log import read_run

QUICK = ["learn", "--trials", "3", "--duration", "0.3", "--no-recording"]


def test_each_trial_is_a_line_between_begin_and_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*QUICK, "--out", str(tmp_path / "run"), "--events", str(tmp_path / "events")]) == 0

    lines = [json.loads(line) for line in (tmp_path / "events").read_text().splitlines()]
    logged = read_run(tmp_path / "run").trials
    assert [line["event"] for line in lines] == ["begin", "trial", "trial", "trial", "end"]
    assert [line["score_m_s"] for line in lines[1:4]] == [each.score for each in logged]
    assert lines[1]["outcome"] == "completed"
    assert lines[1]["gait_hz"] == list(logged[0].trial.gait.frequency_hz)
    assert lines[3]["displacement"]["forward_m"] == logged[2].movement.displacement.forward_m
    assert lines[3]["recommended"]["mean_m_s"] == logged[2].recommendation.estimate.mean
    assert lines[4] == {"event": "end", "text": "complete"}


def test_a_resumed_run_adds_to_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    events = tmp_path / "events"
    main([*QUICK, "--out", str(tmp_path / "run"), "--events", str(events)])

    assert (
        main(["learn", "--resume", str(tmp_path / "run"), "--trials", "4", "--no-recording", "--events", str(events)])
        == 0
    )

    lines = [json.loads(line) for line in events.read_text().splitlines()]
    assert lines[5] == {"event": "begin", "text": "3 trials made, 4 valid ones wanted"}
    assert [line["trial"] for line in lines if line["event"] == "trial"] == [1, 2, 3, 4]


def test_a_number_is_an_open_descriptor(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    reader, writer = os.pipe()
    try:
        assert main([*QUICK, "--out", str(tmp_path / "run"), "--events", str(writer)]) == 0
        os.close(writer)  # it is still open: the program that opened it closes it
        with os.fdopen(reader, "rb", closefd=False) as lines:
            assert [json.loads(line)["event"] for line in lines] == ["begin", "trial", "trial", "trial", "end"]
    finally:
        os.close(reader)


def test_a_reader_that_goes_away_does_not_end_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    first: list[bytes] = []

    def read_one_line() -> None:
        with pipe.open("rb") as lines:
            first.append(lines.readline())

    reader = threading.Thread(target=read_one_line)
    reader.start()
    status = main(["learn", "--trials", "30", "--duration", "0.3", "--no-recording",
                   "--out", str(tmp_path / "run"), "--events", str(pipe)])  # fmt: skip
    reader.join()

    assert status == 0
    assert json.loads(first[0])["event"] == "begin"
    assert len(read_run(tmp_path / "run").trials) == 30
    assert [record.message for record in caplog.records] == [
        "EventStream failed and is told nothing more: BrokenPipeError: [Errno 32] Broken pipe"
    ]


@pytest.mark.parametrize("name", ["/nowhere/events", "987654", "99999999999999999999"])
def test_a_file_that_cannot_be_written_is_refused_before_the_run_begins(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*QUICK, "--out", str(tmp_path / "run"), "--events", name]) == 1

    assert capsys.readouterr().err.startswith(f"vvvaltr: --events {name} cannot be written: ")
    assert not (tmp_path / "run").exists()


def test_the_summary_is_up_to_date_after_each_trial(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from vvvaltr.controller.runs.run import RunDirectory

    run = RunDirectory.create(tmp_path / "run", {"trials": 3, "duration_s": 0.3})
    try:
        for logged in run.learn():
            assert json.loads((run.path / "summary.json").read_text())["trials"] == logged.trial.number
    finally:
        run.close()


def test_the_log_of_a_run_says_what_made_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main([*QUICK, "--seed", "5", "--out", str(tmp_path / "run")])

    about = read_run(tmp_path / "run").about
    assert (about["version"], about["robot"], about["seed"]) == (__version__, "planar", "5")
    assert datetime.fromisoformat(about["date"]).tzinfo is UTC
