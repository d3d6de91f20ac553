"""`vvvaltr jog`: drive the robot by the arrow keys."""

from __future__ import annotations

import sys
import time
from argparse import ArgumentParser, Namespace
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.keyboard import GONE, Keyboard, raw_keyboard
from vvvaltr.controller.cli.options import add_robot_arguments, asked_robot
from vvvaltr.controller.cli.telling import counted, say
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
        with closing(run), raw_keyboard(sys.stdin.fileno()) as keyboard:
            say(arguments, f"arrow keys: {', '.join(run.keys)}; space stops; q leaves")
            for logged in run.jog(JogKeys(keyboard)):
                trial = logged.trial
                if trial.outcome.is_valid:
                    say(arguments, f"{logged.suggestion.origin.partition(': ')[2]} for {trial.duration_s:.1f} s")
                else:
                    say(arguments, trial.ending)
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt(f"{interrupt}; what was driven is saved in {out}") from None
    finally:
        result = run.summarise()
    return Answer(_prose(result), result)


class JogKeys:
    """What the keys of a terminal ask for."""

    def __init__(self, keyboard: Keyboard) -> None:
        self._keyboard = keyboard

    def __call__(self, wait_s: float) -> list[Key]:
        """Return the keys that have come, after waiting for one for at most ``wait_s``."""
        from vvvaltr.controller.loop.jog import Key

        meanings = {
            "up": Key.FORWARD,
            "down": Key.BACK,
            "right": Key.RIGHT,
            "left": Key.LEFT,
            **dict.fromkeys((" ", "s"), Key.STOP),
            **dict.fromkeys(("q", "Q", "\x04", GONE), Key.QUIT),
        }
        return [meanings[key] for key in self._keyboard.read(wait_s) if key in meanings]


def _prose(result: dict[str, Any]) -> str:
    driven = f"{result['duration_s']:.1f} s in {counted(result['trials'], 'trial')}"
    return f"driven     {driven}\nrun        {result['run']}"


COMMAND = Subcommand(
    help="drive the robot by the arrow keys, with movements that were learned",
    example="vvvaltr jog --repertoire runs/moves --robot robot.toml",
    add_arguments=_add_arguments,
    execute=_execute,
    details=lambda: {
        "keys": {
            "up, down": "drive forward or back while the key is held",
            "left, right": "turn while the key is held",
            "space, s": "stop",
            "q": "leave",
            "release": "a terminal tells of no release: a tap drives for 0.6 s, and a held key ends 0.25 s after its "
            "last repetition",
        }
    },
)
