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
from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.parser import Details, Parser
from vvvaltr.controller.cli.telling import add_telling_arguments, logs_on_standard_error, to_whoever_listens
from vvvaltr.controller.core.errors import DeviceError, NotUnderstood, TrackingLost, UserError
from vvvaltr.controller.core.printable import printable
from vvvaltr.controller.core.signals import interrupt_on_signals

GROUPS = {
    "find a gait": ("learn", "trial", "compare", "landscape", "experiment"),
    "drive the robot": ("repertoire", "go", "jog", "stop"),
    "look at what was measured": ("runs", "show", "view", "report", "export", "import", "foxglove-layout"),
    "set a robot up": ("init", "check", "calibrate", "camera", "track", "floor", "mock"),
    "this program": ("completion",),
}
COMMANDS = tuple(name for names in GROUPS.values() for name in names)
MODULES = {"import": "import_trials", "foxglove-layout": "foxglove_layout"}  # names that no module can have


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns 0 done, 1 failed, 2 not understood, 130 interrupted."""
    interrupt_on_signals()
    # Before numpy is imported: at these sizes its threads gain nothing, and their number would change the last bits.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    parsed = argparse.Namespace(debug=False)
    try:
        _refuse_broken_names(sys.argv[1:] if arguments is None else arguments)
        parsed = make_parser().parse_args(arguments)
        _permit_urls(parsed)
        with logs_on_standard_error(parsed):
            return _print(parsed.execute(parsed), as_json=parsed.json)
    except (KeyboardInterrupt, Exception) as error:
        return _tell_end(error, show_traceback=parsed.debug)


def _tell_end(error: BaseException, show_traceback: bool) -> int:
    """Tell in one line what ended the command; return the exit status."""
    if (interrupt := _find_interrupt(error)) is not None:
        return _fail(f"interrupted ({interrupt})" if str(interrupt) else "interrupted", 130)
    match error:
        case NotUnderstood():
            return _fail(str(error), 2)
        case UserError() | DeviceError() | TrackingLost():
            return _fail(str(error), 1)
        case BrokenPipeError():
            sys.stderr.close()  # the reader of our output has ended; the interpreter would complain at exit
            return 1
        case OSError():
            return _fail(_refusal(error), 1)
        case UnicodeEncodeError():
            return _fail(_broken_name(error), 2)
    return _fail(_defect(error, show_traceback), 1)  # the last boundary: a defect of ours


def _find_interrupt(error: BaseException | None) -> KeyboardInterrupt | None:
    """Return the interrupt that an error is or was caused by: where a class is made, Python wraps it."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return error
        error = error.__cause__ or error.__context__
    return None


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


def _command(name: str) -> Subcommand:
    command: Subcommand = importlib.import_module(f"vvvaltr.controller.cli.{MODULES.get(name, name)}").COMMAND
    return command


def _refuse_broken_names(arguments: Sequence[str]) -> None:
    """Raise NotUnderstood for a name that no file of ours could hold."""
    for argument in arguments:
        if not argument.isascii() and any("\ud800" <= letter <= "\udfff" for letter in argument):
            raise NotUnderstood(_broken(argument))


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
    print(json.dumps(answer.data) if as_json else printable(answer.text), flush=True)
    return answer.status


def _fail(line: str, status: int) -> int:
    with to_whoever_listens():
        print(printable("vvvaltr: " + " ".join(line.split())), file=sys.stderr, flush=True)
    return status


def _refusal(error: OSError) -> str:
    said = error.strerror or str(error)
    if error.errno == errno.ENOSPC:
        said += "; free some space, then continue: a run by --resume, anything else by the same command"
    return f"{error.filename}: {said}" if error.filename else said


def _broken_name(error: UnicodeEncodeError) -> str:
    words = error.object[: error.start].split("\n")[-1] + error.object[error.start :].split("\n")[0]
    return _broken(f"{words}: a name in it")


def _broken(name: str) -> str:
    """Return what is wrong with a name that Python could not decode, and the cure."""
    if (encoding := sys.getfilesystemencoding()) != "utf-8":
        return f"{name} is not {encoding}, as this environment says that names are: set PYTHONUTF8=1"
    return f"{name} is not UTF-8: rename that file or folder"


def _defect(error: BaseException, show_traceback: bool) -> str:
    if show_traceback:
        traceback.print_exception(error)
    where = traceback.extract_tb(error.__traceback__)[-1]
    return (
        f"unexpected {type(error).__name__}: {error} ({where.filename}:{where.lineno}); "
        "a defect of vvvaltr: please report it with the output of --debug"
    )
