"""`jog` at a terminal, and what it does where there is none."""

import json
import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from vvvaltr.controller.cli.jog import JogKeys
from vvvaltr.controller.cli.keyboard import Keyboard
from vvvaltr.controller.cli.main import main
from vvvaltr.controller.loop.jog import Key
from vvvaltr.controller.runs.log import read_run

VVVALTR = (sys.executable, "-c", "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main())")


def test_arrows_drive_space_and_s_stop_and_q_quits() -> None:
    read, write = os.pipe()
    os.write(write, b"\x1b[A\x1b[Bs xq")

    assert JogKeys(Keyboard(read))(0.1) == [Key.FORWARD, Key.BACK, Key.STOP, Key.STOP, Key.QUIT]
    os.close(write)
    assert JogKeys(Keyboard(read))(0.1) == [Key.QUIT]  # the terminal is gone
    os.close(read)


def test_without_a_terminal_jog_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    moves = tmp_path / "moves"
    assert main(["repertoire", "--gaits", "8", "--duration", "2", "--out", str(moves)]) == 0
    capsys.readouterr()

    assert main(["jog", "--repertoire", str(moves)]) == 1
    assert "terminal" in capsys.readouterr().err


@contextmanager
def jogging(moves: Path, out: Path) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """A program that has told its keys, and the other end of its terminal."""
    assert main(["repertoire", "--gaits", "8", "--duration", "2", "--out", str(moves)]) == 0
    master, terminal = pty.openpty()
    command = [*VVVALTR, "jog", "--repertoire", str(moves), "--out", str(out)]
    with subprocess.Popen(command, stdin=terminal, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as program:
        os.close(terminal)
        assert program.stderr is not None
        assert b"arrow keys" in program.stderr.readline()
        yield program, master
    os.close(master)


def test_a_person_at_a_terminal_drives_the_planar_twin(tmp_path: Path) -> None:
    out = tmp_path / "jog"
    with jogging(tmp_path / "moves", out) as (program, master):
        os.write(master, b"\x1b[A")
        time.sleep(1.5)
        with suppress(OSError):
            os.write(master, b"q")
        assert program.wait(20) == 0

    (logged,) = read_run(out).trials
    assert logged.suggestion.origin == "jog: forward"
    assert 0.4 <= logged.trial.duration_s <= 1.2


def test_an_interrupt_says_where_what_was_driven_is_and_leaves_a_summary(tmp_path: Path) -> None:
    out = tmp_path / "jog"
    with jogging(tmp_path / "moves", out) as (program, _):
        assert program.stderr is not None
        program.send_signal(signal.SIGINT)
        told = program.stderr.read().decode()
        assert program.wait(20) == 130

    assert told.splitlines()[-1] == f"vvvaltr: interrupted (SIGINT; what was driven is saved in {out})"
    assert json.loads((out / "summary.json").read_text())["trials"] == 0
