"""The command as a process: signals at any instant, missing streams, a terminal that goes away."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from benchmarks.signals import COMMANDS, campaign

VVVALTR = (sys.executable, "-m", "vvvaltr")
LEARN = ("learn", "--robot", "planar", "--duration", "0.5", "--no-recording", "--json")


@pytest.mark.parametrize("name", COMMANDS)
def test_a_signal_at_any_instant_is_one_line_and_nothing_is_left(name: str) -> None:
    statuses, complaints = campaign(name, count=8, seed=1)

    assert complaints == []
    assert statuses[130] > 0


def test_a_closed_standard_error_changes_nothing(tmp_path: Path) -> None:
    command = " ".join([*VVVALTR, *LEARN, "--trials", "2", "--out", str(tmp_path / "run"), "2>&-"])

    done = subprocess.run(command, shell=True, stdout=subprocess.PIPE, text=True)

    assert done.returncode == 0
    assert json.loads(done.stdout)["trials"] == 2
    assert (tmp_path / "run" / "trials.mcap").read_bytes().endswith(b"\x89MCAP0\r\n")


def test_a_standard_error_that_cannot_be_written_changes_nothing(tmp_path: Path) -> None:
    ours, theirs = os.pipe()
    os.close(ours)  # whoever read it has ended

    with open("/dev/full", "w") as full, os.fdopen(theirs, "w") as unread:
        for number, stream in enumerate((full, unread)):
            command = [*VVVALTR, *LEARN, "--trials", "2", "--out", str(tmp_path / f"{number}")]
            done = subprocess.run(command, stdout=subprocess.PIPE, stderr=stream, text=True)

            assert (done.returncode, json.loads(done.stdout)["trials"]) == (0, 2)


def test_errors_never_come_out_of_standard_output() -> None:
    done = subprocess.run(" ".join([*VVVALTR, "learn --robot nope 2>&-"]), shell=True, stdout=subprocess.PIPE)

    assert (done.returncode, done.stdout) == (2, b"")


def test_closed_streams_do_not_become_files_of_the_run(tmp_path: Path) -> None:
    command = " ".join([*VVVALTR, *LEARN, "--trials", "2", "--out", str(tmp_path / "run"), "<&- >&- 2>&-"])

    assert subprocess.run(command, shell=True).returncode == 0

    assert b"learning" not in b"".join(path.read_bytes() for path in (tmp_path / "run").iterdir())


@pytest.mark.parametrize("is_ignored", [True, False])
def test_a_run_under_nohup_outlasts_its_terminal(tmp_path: Path, is_ignored: bool) -> None:
    how, trials = (["nohup"], "12") if is_ignored else ([], "5000")  # more than it can make before the signal
    command = [*how, *VVVALTR, *LEARN, "--trials", trials, "--out", str(tmp_path / "run")]
    log = tmp_path / "run" / "trials.mcap"

    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        while not log.exists() and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(signal.SIGHUP)
        process.communicate(timeout=60)

    assert process.returncode == (0 if is_ignored else 130)


def test_letters_that_the_terminal_lacks_do_not_end_a_run(tmp_path: Path) -> None:
    done = subprocess.run(
        [*VVVALTR, *LEARN[:-1], "--trials", "1", "--out", str(tmp_path / "Übung")],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
    )

    assert done.returncode == 0
    assert rb"\xdcbung" in done.stdout


def test_a_name_that_is_not_utf_8_is_refused_by_name(tmp_path: Path) -> None:
    out = os.fsencode(tmp_path) + b"/caf\xe9"
    done = subprocess.run([*VVVALTR, *LEARN, "--trials", "1", "--out", out], capture_output=True)

    assert done.returncode == 2
    assert rb"/caf\xe9 is not UTF-8: rename that file or folder" in done.stderr


def test_a_name_in_utf_8_is_not_blamed_where_the_environment_allows_ascii_alone(tmp_path: Path) -> None:
    out, ascii_alone = str(tmp_path / "Übung"), {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run([*VVVALTR, "show", out], env={**os.environ, **ascii_alone}, capture_output=True)

    assert done.returncode == 2
    assert done.stderr.endswith(
        rb"bung is not ascii, as this environment says that names are: set PYTHONUTF8=1" + b"\n"
    )


def test_a_folder_around_that_is_not_utf_8_does_not_matter(tmp_path: Path) -> None:
    folder = os.fsencode(tmp_path) + b"/caf\xe9"
    os.mkdir(folder)

    for command in ([*LEARN, "--trials", "1", "--out", "a"], [*LEARN, "--trials", "1", "--out", "b", "--source", "a"]):
        assert subprocess.run([*VVVALTR, *command], cwd=folder, capture_output=True).returncode == 0


def test_control_characters_of_a_name_do_not_reach_the_terminal() -> None:
    done = subprocess.run([*VVVALTR, "check", "a\x1b[31m\u202eb.toml"], capture_output=True, text=True)

    assert done.stderr.startswith("vvvaltr: a\\x1b[31m\\u202eb.toml: there is no such file; ")
