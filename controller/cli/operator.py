"""The operator of a run, at a terminal: keys in, one line of what the run waits for out."""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Sequence
from contextlib import suppress

from vvvaltr.controller.cli.keyboard import GONE, Keyboard
from vvvaltr.controller.core.attending import WISHES, Request, Stage, Wish
from vvvaltr.controller.core.printable import printable

_STOPS = (" ", "s", "S")
_PASTED = 4  # keys that come at once from this many on were pasted, not pressed
_DEAF_S = 0.5  # after that
_REPAINT_S = 2.0  # on a terminal that can only append
_LONGEST_TEXT = 200
_CLEAR = "\r\x1b[K"  # the line that the cursor is on
_HELP = "?"

KEYS = {
    "\n": Wish.KEEP,
    "g": Wish.GO,
    "p": Wish.PAUSE,
    "n": Wish.SKIP,
    "r": Wish.REPEAT,
    "d": Wish.DISCARD,
    "t": Wish.NOTE,
    "b": Wish.NEW_BATTERY,
    "e": Wish.END,
    **dict.fromkeys(_STOPS, Wish.STOP),
}
HINTS = {
    Stage.WAITING: "g go, p pause, n next gait, b new battery, t note, e end",
    Stage.DRIVING: "space or s stop, p pause, e end after this trial, ? keys",
    Stage.REVIEW: "Enter keep, r repeat, d discard, t note, b new battery",
}
KEY_DETAILS = {
    "before a trial": HINTS[Stage.WAITING],
    "during it": HINTS[Stage.DRIVING],
    "after it": f"{HINTS[Stage.REVIEW]}; kept after 3 s",
}
"""The keys, for the help of a command."""

_ASKS = {Wish.DISCARD: "why (Enter: discard, Esc: no)", Wish.NOTE: "note (Enter: done, Esc: none)"}


class TerminalOperator:
    """A person at a terminal.

    Args:
        keyboard: where the keys come from.
        screen: where lines go; by default standard error.
    """

    def __init__(self, keyboard: Keyboard) -> None:
        self._keyboard = keyboard
        self._stage = Stage.WAITING
        self._shown = ""
        self._hinted: set[Stage] = set()
        self._shown_s = 0.0
        self._deaf_until_s = 0.0
        self._asking: Wish | None = None
        self._text = ""
        self._can_repaint = os.environ.get("TERM", "dumb") != "dumb"
        self._has_colour = self._can_repaint and not os.environ.get("NO_COLOR")

    @property
    def is_busy(self) -> bool:
        """Whether the operator is typing a reason or a note."""
        return self._asking is not None

    def show(self, stage: Stage, line: str) -> None:
        """Show one line in place of the last; the keys of a stage are shown when it first begins, and at ``?``."""
        self._stage = stage
        if stage is Stage.DRIVING:
            self._asking = None  # while motors turn, every key is what it is elsewhere
        if stage not in self._hinted:
            self._hinted.add(stage)
            self._print(f"{_CLEAR * self._can_repaint}{HINTS[stage]}\n")
            self._shown = ""
        self._paint(f"{_ASKS[self._asking]}: {self._text}" if self._asking else line)

    def listen(self, wait_s: float) -> Sequence[Request]:
        """Return the wishes that have come. Raises KeyboardInterrupt when the terminal has been closed."""
        keys = self._keyboard.read(wait_s)
        if GONE in keys:
            raise KeyboardInterrupt("the terminal was closed")
        if self._asking is not None:
            return self._type(keys)
        if len(keys) >= _PASTED and len(set(keys)) > 1:  # a key that is held down repeats itself
            self._deaf_until_s = time.monotonic() + _DEAF_S
        if time.monotonic() < self._deaf_until_s:
            keys = [key for key in keys if key in _STOPS]
        return self._understand(list(dict.fromkeys(keys)))

    def clear(self) -> None:
        """Remove the line that is shown, so that something else can be printed in its place."""
        if self._shown and self._can_repaint:
            self._print(_CLEAR)
        self._shown = ""

    def _understand(self, keys: list[str]) -> list[Request]:
        if _HELP in keys:
            self._hinted.clear()
        wishes = dict.fromkeys(wish for key in keys if (wish := KEYS.get(key)) in WISHES[self._stage])
        if Wish.STOP in wishes:
            return [Request(Wish.STOP)]
        requests = []
        for wish in wishes:
            if wish in _ASKS:
                self._asking, self._text = wish, ""
                break
            assert wish is not None
            if wish is Wish.NEW_BATTERY:
                self._acknowledge("new battery")
            requests.append(Request(wish))
        return requests

    def _type(self, keys: list[str]) -> list[Request]:
        """Take in what is typed for a reason or a note."""
        assert self._asking is not None
        for key in keys:
            if key in ("\n", "\r"):
                wish, self._asking = self._asking, None
                text = self._text.strip()
                if wish is Wish.NOTE and text:
                    self._acknowledge(text)
                return [Request(wish, text)]
            if key == "\x1b":
                self._asking = None
                return []
            if key in ("\x7f", "\b"):
                self._text = self._text[:-1]
            elif key.isprintable() and len(key) == 1 and len(self._text) < _LONGEST_TEXT:
                self._text += key
        return []

    def _acknowledge(self, text: str) -> None:
        """Show, on a line that stays, what goes into the log and changes nothing else that could be seen."""
        self._print(f"{_CLEAR * self._can_repaint}noted: {printable(text)}\n")
        self._shown = ""

    def _paint(self, line: str) -> None:
        line = printable(line)[: max(20, shutil.get_terminal_size().columns - 1)]
        now_s = time.monotonic()
        if line == self._shown or (not self._can_repaint and now_s - self._shown_s < _REPAINT_S):
            return
        bold, plain = ("\x1b[1m", "\x1b[0m") if self._has_colour else ("", "")
        self._print(f"{_CLEAR}{bold}{line}{plain}" if self._can_repaint else f"{line}\n")
        self._shown, self._shown_s = line, now_s

    def _print(self, text: str) -> None:
        with suppress(OSError):  # a terminal that was closed; the next listen says so
            sys.stderr.write(text)
            sys.stderr.flush()
