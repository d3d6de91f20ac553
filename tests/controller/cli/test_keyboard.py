"""Keys from a terminal, as bytes, and what an operator's keys ask for."""

import os
import pty
import time
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.controller.cli.keyboard import GONE, Keyboard, decode_keys, raw_keyboard
from vvvaltr.controller.cli.operator import HINTS, KEYS, TerminalOperator
from vvvaltr.controller.core.attending import WISHES, Request, Stage, Wish


@pytest.mark.parametrize(
    ("sent", "keys"),
    [
        (b"\x1b[A", ["up"]),
        (b"\x1bOB", ["down"]),
        (b"\x1b[C\x1b[D", ["right", "left"]),
        (b" q", [" ", "q"]),
        (b"\x1b[H\x1b[A", ["up"]),
        (b"\x1b[3~\x1b[15~\x1b[1;5C\x1b[1;2S\x1b[3$\x1bOPq", ["q"]),  # Delete, F5, Ctrl-Right, Shift-F4, F1
        (b"\x1b[ ", ["\x1b", "[", " "]),  # no key begins so, and a stop is heard
        ("ä€".encode(), ["ä", "€"]),
        (b"\xff\xc3a", ["a"]),
    ],
)
def test_a_terminals_bytes_are_keys(sent: bytes, keys: list[str]) -> None:
    assert decode_keys(sent) == (keys, b"")


@given(st.binary(max_size=40), st.integers(0, 40))
def test_bytes_that_come_in_two_parts_are_the_same_keys(sent: bytes, cut: int) -> None:
    first, rest = decode_keys(sent[:cut])
    second, _ = decode_keys(rest + sent[cut:])

    assert first + second == decode_keys(sent)[0]


@pytest.mark.parametrize("begun", [b"\x1b[", b"\x1bO", b"\x1b[1;", b"\xe2"])
@pytest.mark.parametrize("waits", [True, False], ids=["waiting", "looking only"])
def test_a_stop_is_heard_after_the_beginning_of_a_key_that_never_came_whole(begun: bytes, waits: bool) -> None:
    read, write = os.pipe()
    keyboard = Keyboard(read)
    os.write(write, begun)
    assert keyboard.read(0.1) == []
    if not waits:  # as the loop does while motors turn
        time.sleep(0.03)
    assert keyboard.read(0.03 if waits else 0.0) == []
    os.write(write, b"s")
    assert keyboard.read(0.1) == ["s"]
    os.close(read)
    os.close(write)


def test_a_terminal_that_is_gone_says_so() -> None:
    read, write = os.pipe()
    os.close(write)

    assert Keyboard(read).read(0.1) == [GONE]
    os.close(read)


def test_the_terminal_is_as_before_afterwards_and_the_shell_gets_no_late_keys() -> None:
    import termios

    master, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)

    with raw_keyboard(terminal) as keyboard:
        os.write(master, b"\x1b[A")
        assert keyboard.read(1.0) == ["up"]
        assert termios.tcgetattr(terminal) != before
        os.write(master, b"rm\n")

    assert termios.tcgetattr(terminal) == before
    os.set_blocking(terminal, False)
    with pytest.raises(BlockingIOError):
        os.read(terminal, 100)
    os.close(master)
    os.close(terminal)


@pytest.fixture
def typing() -> Iterator[tuple[TerminalOperator, int]]:
    master, terminal = pty.openpty()
    with raw_keyboard(terminal) as keyboard:
        yield TerminalOperator(keyboard), master
    os.close(master)
    os.close(terminal)


def wishes(operator: TerminalOperator, master: int, keys: bytes) -> list[Request]:
    os.write(master, keys)
    return [*operator.listen(0.2), *operator.listen(0.0)]


@pytest.mark.parametrize("stage", list(Stage))
def test_every_wish_of_a_stage_has_a_key_and_its_hint_fits_60_columns(stage: Stage) -> None:
    assert set(WISHES[stage]) <= set(KEYS.values())
    assert len(HINTS[stage]) <= 60


def test_keys_that_mean_nothing_at_a_stage_do_nothing(typing: tuple[TerminalOperator, int]) -> None:
    operator, master = typing
    operator.show(Stage.DRIVING, "trial 1 drives")

    assert wishes(operator, master, b"g") == wishes(operator, master, b"d") == wishes(operator, master, b"x") == []
    assert wishes(operator, master, b"s") == wishes(operator, master, b" ") == [Request(Wish.STOP)]


def test_pasted_text_does_nothing_but_stop(typing: tuple[TerminalOperator, int]) -> None:
    operator, master = typing
    operator.show(Stage.WAITING, "trial 1: paused")

    assert wishes(operator, master, b"get the budget\n") == [Request(Wish.STOP)]  # it has a space
    assert wishes(operator, master, b"e") == []
    time.sleep(0.6)
    assert wishes(operator, master, b"pgneb") == []
    time.sleep(0.6)
    assert wishes(operator, master, b"gggggggg") == [Request(Wish.GO)]


def test_a_reason_is_typed_mended_and_given_up(typing: tuple[TerminalOperator, int]) -> None:
    operator, master = typing
    operator.show(Stage.REVIEW, "trial 1: 12.0 mm/s")

    assert wishes(operator, master, b"d") == []
    assert operator.is_busy
    assert wishes(operator, master, b"a cable s\x7fcaught") == []
    assert wishes(operator, master, b"\n") == [Request(Wish.DISCARD, "a cable caught")]
    assert wishes(operator, master, b"t") == []
    assert wishes(operator, master, b"never mind\x1b") == []
    assert operator.listen(0.05) == []
    assert not operator.is_busy


def test_what_goes_into_the_log_alone_is_acknowledged(
    typing: tuple[TerminalOperator, int], capsys: pytest.CaptureFixture[str]
) -> None:
    operator, master = typing
    operator.show(Stage.WAITING, "trial 1: paused")

    wishes(operator, master, b"b")
    wishes(operator, master, b"t")
    wishes(operator, master, b"windy\n")

    noted = [line for line in capsys.readouterr().err.split("\n") if "noted" in line]
    assert [line.rpartition("noted: ")[2] for line in noted] == ["new battery", "windy"]


def test_while_motors_turn_a_space_is_a_stop_whatever_was_being_typed(typing: tuple[TerminalOperator, int]) -> None:
    operator, master = typing
    operator.show(Stage.WAITING, "trial 1: paused")
    assert wishes(operator, master, b"t") == []

    operator.show(Stage.DRIVING, "trial 1 drives")

    assert wishes(operator, master, b" ") == [Request(Wish.STOP)]


def test_a_closed_terminal_interrupts() -> None:
    master, terminal = pty.openpty()
    with raw_keyboard(terminal) as keyboard:
        operator = TerminalOperator(keyboard)
        os.close(master)
        with pytest.raises(KeyboardInterrupt, match="the terminal was closed"):
            operator.listen(0.2)
    os.close(terminal)


@pytest.mark.parametrize(
    ("environment", "painted"),
    [
        ({"TERM": "xterm"}, "\r\x1b[K\x1b[1mtrial 1: waits\x1b[0m"),
        ({"TERM": "xterm", "NO_COLOR": "1"}, "\r\x1b[Ktrial 1: waits"),
        ({"TERM": "dumb"}, "trial 1: waits\n"),
    ],
)
def test_a_line_is_painted_as_the_terminal_can(
    environment: dict[str, str],
    painted: str,
    typing: tuple[TerminalOperator, int],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    operator = TerminalOperator(typing[0]._keyboard)

    operator.show(Stage.WAITING, "trial 1: waits")

    operator.show(Stage.WAITING, "trial 1: waits")  # nothing new
    told = capsys.readouterr().err
    assert told.endswith(f"{HINTS[Stage.WAITING]}\n{painted}")
    assert told.count("trial 1") == 1
