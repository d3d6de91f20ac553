"""What is told on standard error: by default progress, with --verbose each step, with --quiet errors alone."""

import io
import json
import logging
import math
import os
import pty
import select
import signal
import subprocess
import sys
import time
from argparse import Namespace
from pathlib import Path

import pytest

from vvvaltr.controller.cli import floor, telling
from vvvaltr.controller.cli.main import main
from vvvaltr.controller.cli.telling import logs_on_standard_error
from vvvaltr.controller.core.errors import UserError

TRIAL = ("trial", "12", "-14", "9", "--duration", "0.2", "--repeats", "2")
VVVALTR = (sys.executable, "-m", "vvvaltr")


def told(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> str:
    assert main([*arguments, "--json"]) == 0
    out, err = capsys.readouterr()
    json.loads(out.splitlines()[-1])
    return err


class Terminal(io.StringIO):
    """What a person types."""

    def isatty(self) -> bool:
        return True


def test_a_question_leaves_standard_output_to_the_results(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "stdin", Terminal("\n"))
    turn = floor._ask_to_turn(Namespace(quiet=False))

    turn(1, 0.0)
    with pytest.raises(UserError, match="the input ended before an answer to: press Enter when it lies still"):
        turn(2, math.pi)

    out, err = capsys.readouterr()
    assert out == ""
    assert "trial 2: turn the robot to about 180 degrees" in err


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take standard error for a terminal."""
    monkeypatch.setattr(telling, "can_repaint", lambda: True)


@pytest.mark.usefixtures("terminal")
def test_by_default_the_progress_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    err = told(TRIAL, capsys)

    assert "repeating" in err
    assert "opening planar" not in err


@pytest.mark.parametrize(
    "command",
    [TRIAL, ("compare", "9,9,9", "12,-14,9", "--trials", "4"), ("repertoire", "--gaits", "1", "--duration", "2")],
)
def test_in_a_file_there_is_no_progress_bar(
    command: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    err = told((*command, "--out", str(tmp_path / "run")), capsys)

    assert "\r" not in err
    assert "%|" not in err


@pytest.mark.usefixtures("terminal")
def test_verbose_tells_each_step_above_the_progress_bar(capsys: pytest.CaptureFixture[str]) -> None:
    err = told((*TRIAL, "--verbose"), capsys)

    assert "opening planar" in err
    assert "trial 2: completed" in err
    assert "repeating" in err


def test_quiet_tells_nothing_of_what_goes_well(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert told((*TRIAL, "--quiet"), capsys) == ""
    assert told(("learn", "--duration", "1", "--trials", "2", "--quiet", "--out", str(tmp_path / "run")), capsys) == ""


def test_quiet_still_tells_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(tmp_path / "missing.toml"), "--quiet"]) == 1
    assert "there is no such file" in capsys.readouterr().err


def mock_on_a_terminal(*more: str, folder: Path, until: str) -> str:
    """Return what a mock writes to a terminal until ``until`` has come, and for 0.3 s after it."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen([*VVVALTR, "mock", "qik", "--link", "qik0", *more], cwd=folder, stdout=theirs)
    os.close(theirs)
    text, end_s = "", time.monotonic() + 30.0
    try:
        while time.monotonic() < end_s:
            if select.select([ours], [], [], 0.1)[0]:
                text += os.read(ours, 65536).decode()
            if until in text:
                end_s, until = min(end_s, time.monotonic() + 0.3), "nothing more"
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(20.0) == 0
        os.close(ours)
    return text


def test_on_a_terminal_the_mock_says_what_to_do_next_and_no_more(tmp_path: Path) -> None:
    lines = mock_on_a_terminal(folder=tmp_path, until="next").splitlines()

    assert len(lines) == 2
    assert lines[1] == "next, in another terminal: vvvaltr check qik0.toml"


def test_on_a_terminal_with_json_the_mock_writes_what_the_device_does(tmp_path: Path) -> None:
    first, second, *_ = mock_on_a_terminal("--json", folder=tmp_path, until="applied_hz").splitlines()

    assert set(json.loads(first)) == {"port", "robot_file", "tracker"}
    assert json.loads(second)["applied_hz"] == [0.0, 0.0, 0.0]


def test_a_command_leaves_the_logging_of_its_program_as_it_was(tmp_path: Path) -> None:
    logger = logging.getLogger("vvvaltr")
    before = (logger.level, list(logger.handlers))

    main(["runs", str(tmp_path), "--quiet"])

    assert (logger.level, list(logger.handlers)) == before


def test_a_danger_that_is_found_at_each_opening_is_told_once_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    log = logging.getLogger("vvvaltr.drivers")
    for _ in range(2):
        with logs_on_standard_error(Namespace(verbose=False, quiet=False)):
            for strut in ("A", "A", "B"):
                log.warning("strut %s has no watchdog", strut, extra={"once": True})

    of_a_command = ["vvvaltr: strut A has no watchdog", "vvvaltr: strut B has no watchdog"]
    assert capsys.readouterr().err.splitlines() == 2 * of_a_command
