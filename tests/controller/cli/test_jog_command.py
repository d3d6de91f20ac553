"""`jog` at a terminal: keys as bytes, and what it does where there is no terminal."""

import os
import pty
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.controller.cli.jog import TerminalKeys, decode_keys, raw_keyboard
from vvvaltr.controller.cli.main import main
from vvvaltr.controller.loop.jog import Key
from vvvaltr.controller.runs.log import read_run

VVVALTR = (sys.executable, "-c", "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main())")


@pytest.mark.parametrize(
    ("sent", "keys"),
    [
        (b"\x1b[A", [Key.FORWARD]),
        (b"\x1bOB", [Key.BACK]),
        (b"\x1b[C\x1b[D", [Key.RIGHT, Key.LEFT]),
        (b" q", [Key.STOP, Key.QUIT]),
        (b"xyz", []),
        (b"\x1b[H\x1b[A", [Key.FORWARD]),
    ],
)
def test_a_terminals_bytes_are_keys(sent: bytes, keys: list[Key]) -> None:
    assert decode_keys(sent) == (keys, b"")


@given(st.binary(max_size=40), st.integers(0, 40))
def test_bytes_that_come_in_two_parts_are_the_same_keys(sent: bytes, cut: int) -> None:
    first, rest = decode_keys(sent[:cut])
    second, _ = decode_keys(rest + sent[cut:])

    assert first + second == decode_keys(sent)[0]


def test_a_terminal_that_is_gone_quits() -> None:
    read, write = os.pipe()
    os.close(write)

    assert TerminalKeys(read)(0.1) == [Key.QUIT]
    os.close(read)


def test_the_terminal_is_as_before_afterwards() -> None:
    import termios

    master, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)

    with raw_keyboard(terminal) as keyboard:
        os.write(master, b"\x1b[A")
        assert keyboard(1.0) == [Key.FORWARD]
        assert termios.tcgetattr(terminal) != before

    assert termios.tcgetattr(terminal) == before
    os.close(master)
    os.close(terminal)


def test_without_a_terminal_jog_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    moves = tmp_path / "moves"
    assert main(["repertoire", "--gaits", "8", "--duration", "2", "--out", str(moves)]) == 0
    capsys.readouterr()

    assert main(["jog", "--repertoire", str(moves)]) == 1
    assert "terminal" in capsys.readouterr().err


def test_a_person_at_a_terminal_drives_the_planar_twin(tmp_path: Path) -> None:
    moves, out = tmp_path / "moves", tmp_path / "jog"
    assert main(["repertoire", "--gaits", "8", "--duration", "2", "--out", str(moves)]) == 0
    master, terminal = pty.openpty()
    command = [*VVVALTR, "jog", "--repertoire", str(moves), "--out", str(out)]
    with subprocess.Popen(command, stdin=terminal, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as program:
        os.close(terminal)
        assert program.stderr is not None
        assert b"arrow keys" in program.stderr.readline()
        os.write(master, b"\x1b[A")
        time.sleep(1.5)
        with suppress(OSError):
            os.write(master, b"q")
        assert program.wait(20) == 0
    os.close(master)

    (logged,) = read_run(out).trials
    assert logged.suggestion.origin == "jog: forward"
    assert 0.4 <= logged.trial.duration_s <= 1.2
