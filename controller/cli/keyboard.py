"""Keys from a terminal, each at once: for driving by hand and for the operator of a run."""

from __future__ import annotations

import os
import re
import select
import sys
import termios
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress

GONE = "gone"
"""Stands for the key of a terminal that was closed."""

_ESCAPE_S = 0.02  # within which the rest of an arrow key follows its first byte
_SEQUENCE = re.compile(rb"\x1b(?:\[([0-?]*[$@-~])|O([@-~]))")  # of one key; ECMA-48, and $ as rxvt sends it
_BEGUN = re.compile(rb"\x1b(?:\[[0-?]*|O)?")
_ARROWS = {b"A": "up", b"B": "down", b"C": "right", b"D": "left"}


class Keyboard:
    """The keys of a terminal, by name: ``up``, ``down``, ``left``, ``right``, ``GONE``, or the character itself.

    Args:
        terminal: its file descriptor.
    """

    def __init__(self, terminal: int) -> None:
        self._terminal = terminal
        self._rest, self._came_s = b"", 0.0  # the beginning of a key, and when it came

    def read(self, wait_s: float) -> list[str]:
        """Return the keys that have come, after waiting for one for at most ``wait_s``."""
        if not select.select([self._terminal], [], [], wait_s)[0]:
            if time.monotonic() <= self._came_s + _ESCAPE_S:
                return []
            rest, self._rest = self._rest, b""  # nothing has followed: the next key, which may be a stop, is its own
            return ["\x1b"] if rest == b"\x1b" else []
        try:
            came = os.read(self._terminal, 1024)
        except OSError:  # as of a pseudo-terminal whose other end is closed
            came = b""
        if not came:
            return [GONE]
        keys, self._rest = decode_keys(self._rest + came)
        self._came_s = time.monotonic()
        return keys


def decode_keys(text: bytes) -> tuple[list[str], bytes]:
    """Return the keys of what a terminal sent, and the beginning of one that is not complete yet."""
    keys: list[str] = []
    while text:
        if _BEGUN.fullmatch(text):
            return keys, text
        if found := _SEQUENCE.match(text):
            name = found[1] or found[2]
            keys += [_ARROWS[name]] if name in _ARROWS else []
            text = text[found.end() :]
            continue
        length = _length(text[0])
        if len(text) < length and all(0x80 <= byte < 0xC0 for byte in text[1:]):
            return keys, text
        try:
            keys.append(text[:length].decode())
            text = text[length:]
        except UnicodeDecodeError:
            text = text[1:]
    return keys, b""


def _length(first: int) -> int:
    """Return how many bytes a character of UTF-8 has, by its first byte."""
    return 4 if first >= 0xF0 else 3 if first >= 0xE0 else 2 if first >= 0xC0 else 1


@contextmanager
def raw_keyboard(terminal: int) -> Iterator[Keyboard]:
    """Have a terminal send each key at once and unseen, until the block is left. Ctrl-C still interrupts."""
    before = termios.tcgetattr(terminal)
    try:
        tty.setcbreak(terminal)
        yield Keyboard(terminal)
    finally:
        with suppress(termios.error):  # of a terminal that is closed
            termios.tcflush(terminal, termios.TCIFLUSH)  # what was typed too late must not reach the shell
            termios.tcsetattr(terminal, termios.TCSANOW, before)  # at once, even where nobody reads the output


def is_at_keyboard() -> bool:
    """Return whether a person can be asked: both ways lead to a terminal, and this program is in its foreground."""
    try:
        is_terminal = sys.stdin.isatty() and sys.stderr.isatty()
        return is_terminal and os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (OSError, ValueError):  # a terminal of another session; a closed standard input
        return False
