"""Logs whose checksums are right and whose contents are absurd: refused in one line, at once."""

from __future__ import annotations

import json
import math
import os
import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from sample_run import sample_run

from benchmarks.fuzz_logs import read, write
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.records import Piece
from vvvaltr.controller.loop.movement import measure_pieces
from vvvaltr.controller.runs.log import LOG_NAME, RunLog, read_run
from vvvaltr.controller.runs.schema import vvvaltr_pb2 as pb

SECRET = "do not touch"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / LOG_NAME
    run = sample_run()
    with RunLog.create(path, run.structure, run.sources) as made:
        for logged in run.trials:
            made.append(logged)
    return path


@pytest.mark.parametrize(
    ("topic", "change", "complaint"),
    [
        ("/trial", pb.Trial(score_m_s=math.nan), "score_m_s is nan"),
        ("/trial", pb.Trial(score_m_s=66.0), "a speed of 66 m/s is not plausible"),
        ("/trial", pb.Trial(gait=pb.Gait(frequency_hz=[9.0] * 100_000)), "frequency_hz has 100003 values"),
        ("/trial", pb.Trial(duration_s=1e300), "duration_s is 1e+300"),
        ("/trial", pb.Trial(reason="x" * 1_000_000), "reason has 1000000 letters"),
        ("/trial", pb.Trial(recommendation=pb.Recommendation(gait=pb.Gait(frequency_hz=[9.0]))), "motors"),
        ("/run", pb.Run(structure=pb.Structure(terrain=pb.Terrain(x_m=[1e12]))), "x_m is 1e+12"),
        ("/run", pb.Run(structure=pb.Structure(springs=[pb.Edge(first=4_000_000)])), "strut end that does not exist"),
        ("/run", pb.Run(structure=pb.Structure(motor_struts=[77])), "strut that does not exist"),
        ("/run", pb.Run(sources=[pb.Source(name="far", gaits=[pb.Gait()], scores_m_s=[66.0])]), "source far, trial 1"),
        ("/run", pb.Run(structure=pb.Structure(struts=[pb.Edge()] * 50_000)), "struts has"),
        ("/optimizer/suggestion", pb.Suggestion(expected=pb.Estimate(mean_m_s=math.inf)), "mean_m_s is inf"),
        ("/robot/tracking", pb.Tracking(t_s=1e12), "t_s is 1e+12"),
        ("/robot/tracking", pb.Tracking(x_m=1e30), "farther away than 100000 m"),
        ("/robot/tracking", pb.Tracking(markers_m=[0.0] * 300_000), "markers_m has"),
        ("/motors/state", pb.MotorState(current_a=[0.1] * 100_000), "current_a has"),
        ("/motors/command", pb.Command(hold_s=math.nan), "hold_s is nan"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_no_run_writes_is_damage(log: Path, topic: str, change: pb.Trial, complaint: str) -> None:
    entries = read(log)
    next(message for each, message in entries if each == topic).MergeFrom(change)
    write(entries, log)

    begin_s = time.perf_counter()
    with pytest.raises(UserError, match="is damaged") as caught:
        read_run(log)

    assert complaint in str(caught.value)
    assert time.perf_counter() - begin_s < 5.0


def test_absurd_logs_are_never_a_defect_of_any_command() -> None:
    # In a process of its own: its memory is measured, and this one has that of other tests.
    command = [sys.executable, "-m", "benchmarks.fuzz_logs", "--count", "12", "--seed", "7", "--json"]
    assert json.loads(subprocess.check_output(command)) == {"logs": 12, "wrong": 0, "examples": []}


def test_a_file_of_a_terabyte_is_refused_before_it_is_read(tmp_path: Path) -> None:
    log = tmp_path / LOG_NAME
    with log.open("wb") as file:
        file.write(b"\x89MCAP0\r\n")
        file.truncate(1 << 40)

    with pytest.raises(UserError, match="it has 1048576 MB"):
        read_run(log)


def test_a_large_file_that_is_none_costs_no_memory(tmp_path: Path) -> None:
    log = tmp_path / LOG_NAME
    with log.open("wb") as file:
        file.write(b"\x89MCAP0\r\n" + b"\x06" + (1 << 31).to_bytes(8, "little"))
        file.truncate(3 << 30)

    def little_memory() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))

    done = subprocess.run(
        [sys.executable, "-m", "vvvaltr", "export", str(tmp_path), "--csv", str(tmp_path / "a.csv")],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        preexec_fn=little_memory,
        timeout=20,
    )

    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("kind", ["fifo", "device", "directory", "socket"])
def test_what_is_no_file_is_refused_at_once(tmp_path: Path, kind: str) -> None:
    log = tmp_path / "run" / LOG_NAME
    log.parent.mkdir()
    match kind:
        case "fifo":
            os.mkfifo(log)
        case "device":
            log.symlink_to("/dev/zero")
        case "directory":
            log.mkdir()
        case "socket":
            os.mknod(log, 0o140644)

    with pytest.raises(UserError, match=r"it is a .*, not a file"):
        read_run(log.parent)


def test_recovery_writes_through_no_link(log: Path, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text(SECRET)
    log.write_bytes(log.read_bytes()[:-40])  # torn
    for name in (".new", ".torn"):
        log.with_name(log.name + name).symlink_to(secret)

    RunLog.recover(log)[0].close()

    assert secret.read_text() == SECRET
    assert not log.with_name(log.name + ".torn").is_symlink()


def test_what_was_left_over_goes_when_the_log_is_next_found_whole(log: Path) -> None:
    log.with_name(log.name + ".new").write_text("of a killed program")
    log.write_bytes(log.read_bytes()[:-40])
    RunLog.recover(log)[0].close()
    assert {path.name for path in log.parent.iterdir()} == {LOG_NAME, f"{LOG_NAME}.torn"}

    RunLog.recover(log)[0].close()

    assert [path.name for path in log.parent.iterdir()] == [LOG_NAME]


def test_a_log_whose_folder_is_deleted_takes_no_further_trial(log: Path) -> None:
    opened, run = RunLog.recover(log)
    log.unlink()

    with pytest.raises(UserError, match="the folder of the run was deleted"):
        opened.append(run.trials[0])
    opened.close()


def test_a_clock_before_1970_is_no_obstacle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "time_ns", lambda: -86_400 * 10**9)
    logged = sample_run().trials[0]
    first, *later = logged.trial.poses
    poses = (replace(first, t_s=-0.02), *later)
    logged = replace(logged, trial=replace(logged.trial, started_unix_s=-86_400.0, poses=poses))

    with RunLog.create(tmp_path / LOG_NAME, None) as made:
        made.append(logged)

    (read,) = read_run(tmp_path).trials
    assert (read.trial.started_unix_s, read.trial.poses) == (-86_400.0, poses)


def test_pieces_that_would_take_hours_to_learn_from_are_cut_from_the_poses_anew(tmp_path: Path) -> None:
    run = sample_run()
    known = run.trials[0]
    with RunLog.create(tmp_path / LOG_NAME, run.structure, run.sources) as made:
        made.append(replace(known, pieces=(Piece(1.0, (0.01, 0.0), (1.0, 0.0)),) * 9_000))

    (logged,) = read_run(tmp_path / LOG_NAME).trials

    assert logged.pieces == measure_pieces(known.trial)
