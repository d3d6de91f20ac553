"""The command line, nothing else: finds the command, prints its answer, turns errors into one line and a status."""

from __future__ import annotations

import argparse
import errno
import importlib
import json
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Any

from vvvaltr import __version__
from vvvaltr.controller.cli.answer import Answer, Command
from vvvaltr.controller.cli.parser import Details, Parser
from vvvaltr.controller.cli.telling import add_telling_arguments, log_to_standard_error
from vvvaltr.controller.core.errors import DeviceError, NotUnderstood, TrackingLost, UserError
from vvvaltr.controller.core.signals import interrupt_on_signals

GROUPS = {
    "find a gait": ("learn", "trial", "landscape", "experiment"),
    "drive the robot": ("repertoire", "go", "jog"),
    "look at what was measured": ("view", "report", "export", "import"),
    "set a robot up": ("check", "calibrate", "camera", "track", "mock"),
    "this program": ("completion",),
}
COMMANDS = tuple(name for names in GROUPS.values() for name in names)
MODULES = {"import": "import_trials"}  # a module cannot be called by a keyword


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns 0 done, 1 failed, 2 not understood, 130 interrupted."""
    interrupt_on_signals()
    # Before numpy is imported: at these sizes its threads gain nothing, and their number would change the last bits.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    parsed = argparse.Namespace(debug=False)
    try:
        parsed = make_parser().parse_args(arguments)
        log_to_standard_error(parsed)
        _permit_urls(parsed)
        return _print(parsed.execute(parsed), as_json=parsed.json)
    except KeyboardInterrupt as interrupt:
        return _fail(f"interrupted ({interrupt})" if str(interrupt) else "interrupted", 130)
    except NotUnderstood as error:
        return _fail(str(error), 2)
    except (UserError, DeviceError, TrackingLost) as error:
        return _fail(str(error), 1)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output has ended; the interpreter would complain at exit
        return 1
    except OSError as error:
        return _fail(_refusal(error), 1)
    except Exception as error:  # the last boundary: a defect of ours, told in one line
        return _fail(_defect(error, show_traceback=parsed.debug), 1)


def make_parser(commands_help: str = argparse.SUPPRESS) -> Parser:
    """Return the parser of the whole command line; its help lists the commands by group, unless told otherwise."""
    parser = Parser(
        prog="vvvaltr",
        description="Finds good gaits for a vibration-driven tensegrity robot, and carries what it learned "
        "to the next ground, body or robot. Each command explains itself: vvvaltr COMMAND --help",
        example="vvvaltr learn --robot planar --trials 40 --seed 1",
        details=_commands_by_group,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(prog="vvvaltr", metavar="COMMAND", required=True, help=commands_help)
    for name in COMMANDS:
        command = _command(name)
        command_parser = commands.add_parser(
            name,
            help=command.help,
            description=_sentence(command.help),
            example=command.example,
            details=command.details,
        )
        command.add_arguments(command_parser)
        add_telling_arguments(command_parser)
        command_parser.set_defaults(execute=command.execute)
    return parser


def _command(name: str) -> Command:
    command: Command = importlib.import_module(f"vvvaltr.controller.cli.{MODULES.get(name, name)}").COMMAND
    return command


def _permit_urls(parsed: argparse.Namespace) -> None:
    if getattr(parsed, "allow_url", False):
        from vvvaltr.drivers.links.local import PORTS

        PORTS.allow_url = True


def _commands_by_group() -> Details:
    return {title: {name: _command(name).help for name in names} for title, names in GROUPS.items()}


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        print(f"vvvaltr {__version__}")
        parser.exit()


def _print(answer: Answer | None, as_json: bool) -> int:
    if answer is None:
        return 0
    print(json.dumps(answer.data) if as_json else answer.text, flush=True)
    return answer.status


def _fail(line: str, status: int) -> int:
    print("vvvaltr: " + " ".join(line.split()), file=sys.stderr, flush=True)
    return status


def _refusal(error: OSError) -> str:
    said = error.strerror or str(error)
    if error.errno == errno.ENOSPC:
        said += "; free some space, then continue: a run by --resume, anything else by the same command"
    return f"{error.filename}: {said}" if error.filename else said


def _defect(error: Exception, show_traceback: bool) -> str:
    if show_traceback:
        traceback.print_exception(error)
    where = traceback.extract_tb(error.__traceback__)[-1]
    return (
        f"unexpected {type(error).__name__}: {error} ({where.filename}:{where.lineno}); "
        "a defect of vvvaltr: please report it with the output of --debug"
    )
