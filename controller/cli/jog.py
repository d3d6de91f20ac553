"""`vvvaltr jog`: drive the robot by the arrow keys."""

from __future__ import annotations

import os
import select
import sys
import termios
import time
import tty
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import add_robot_arguments, asked_robot
from vvvaltr.controller.cli.telling import say
from vvvaltr.controller.core.errors import NotUnderstood, UserError

if TYPE_CHECKING:
    from vvvaltr.controller.loop.jog import Key


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--repertoire", action="append", type=Path, metavar="RUN",
                        help="run whose movements to use; repeatable")  # fmt: skip
    add_robot_arguments(parser)
    group = parser.add_argument_group("run")
    group.add_argument("--out", type=Path, metavar="DIR", help="new directory for the run (default runs/DATE-jog)")


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.studies.jogging import JogRun

    if not arguments.repertoire:
        raise NotUnderstood("jog needs movements: name a run by --repertoire, or learn some by vvvaltr repertoire")
    if not sys.stdin.isatty():
        raise UserError("jog reads keys from a terminal, and there is none here: over ssh, ask for one by ssh -t")
    out = arguments.out or Path("runs") / f"{time.strftime('%Y%m%d-%H%M%S')}-jog"
    run = JogRun.create(out, asked_robot(arguments), arguments.seed or 0, arguments.repertoire)
    try:
        say(arguments, f"arrow keys: {', '.join(run.keys)}; space stops; q leaves")
        with raw_keyboard(sys.stdin.fileno()) as keyboard:
            for logged in run.jog(keyboard):
                trial = logged.trial
                if trial.outcome.is_valid:
                    say(arguments, f"{logged.suggestion.origin.partition(': ')[2]} for {trial.duration_s:.1f} s")
                else:
                    say(arguments, f"{trial.outcome}: {trial.reason}")
    finally:
        run.close()
    result = run.summarise()
    return Answer(_prose(result), result)


class TerminalKeys:
    """The keys that come from a terminal."""

    def __init__(self, terminal: int) -> None:
        self._terminal = terminal
        self._rest = b""

    def __call__(self, wait_s: float) -> list[Key]:
        """Return the keys that have come, after waiting for one for at most ``wait_s``."""
        from vvvaltr.controller.loop.jog import Key

        if not select.select([self._terminal], [], [], wait_s)[0]:
            return []
        came = os.read(self._terminal, 1024)
        if not came:
            return [Key.QUIT]  # the terminal is gone
        keys, self._rest = decode_keys(self._rest + came)
        return keys


def decode_keys(text: bytes) -> tuple[list[Key], bytes]:
    """Return the keys of what a terminal sent, and the beginning of one that is not complete yet."""
    from vvvaltr.controller.loop.jog import Key

    arrows = {b"A": Key.FORWARD, b"B": Key.BACK, b"C": Key.RIGHT, b"D": Key.LEFT}
    plain = {b" ": Key.STOP, b"q": Key.QUIT, b"Q": Key.QUIT, b"\x04": Key.QUIT}
    keys: list[Key] = []
    while text:
        if text[:1] == b"\x1b":
            if text in (b"\x1b", b"\x1b[", b"\x1bO"):
                return keys, text
            if text[1:2] in (b"[", b"O"):
                keys += [arrows[text[2:3]]] if text[2:3] in arrows else []
                text = text[3:]
                continue
        keys += [plain[text[:1]]] if text[:1] in plain else []
        text = text[1:]
    return keys, b""


@contextmanager
def raw_keyboard(terminal: int) -> Iterator[TerminalKeys]:
    """Have a terminal send each key at once and unseen, until the block is left. Ctrl-C still interrupts."""
    before = termios.tcgetattr(terminal)
    try:
        tty.setcbreak(terminal)
        yield TerminalKeys(terminal)
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def _prose(result: dict[str, Any]) -> str:
    return f"driven     {result['duration_s']:.1f} s in {result['trials']} trials\nrun        {result['run']}"


COMMAND = Subcommand(
    help="drive the robot by the arrow keys, with movements that were learned",
    example="vvvaltr jog --repertoire runs/moves --robot robot.toml",
    add_arguments=_add_arguments,
    execute=_execute,
    details=lambda: {
        "keys": {
            "up, down": "drive forward or back while the key is held",
            "left, right": "turn while the key is held",
            "space": "stop",
            "q": "leave",
            "release": "a terminal tells of no release: a tap drives for 0.6 s, and a held key ends 0.25 s after its "
            "last repetition",
        }
    },
)
