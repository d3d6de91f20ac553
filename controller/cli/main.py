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
from vvvaltr.controller.core.errors import DeviceError, TrackingLost, UserError
from vvvaltr.controller.core.signals import interrupt_on_signals

COMMANDS = ("learn", "run", "landscape", "view", "mock", "check", "calibrate", "experiment", "report", "import")
MODULES = {"import": "import_trials"}  # a module cannot be called by a keyword


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns 0 done, 1 failed, 2 wrong usage, 130 interrupted."""
    interrupt_on_signals()
    # Before numpy is imported: at these sizes its threads gain nothing, and their number would change the last bits.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    parsed = argparse.Namespace(debug=False)
    try:
        parsed = _parser().parse_args(arguments)
        return _print(parsed.execute(parsed), as_json=parsed.json)
    except KeyboardInterrupt as interrupt:
        return _fail(f"interrupted ({interrupt})" if str(interrupt) else "interrupted", 130)
    except (UserError, DeviceError, TrackingLost) as error:
        return _fail(str(error), 1)
    except BrokenPipeError:
        sys.stderr.close()  # nobody reads on; the interpreter would complain at exit
        return 1
    except OSError as error:
        return _fail(_refusal(error), 1)
    except Exception as error:  # the last boundary: a defect of ours, told in one line
        return _fail(_defect(error, show_traceback=parsed.debug), 1)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="vvvaltr",
        description="Finds good gaits for a vibration-driven tensegrity robot, and carries them to the next condition.",
        epilog="example: vvvaltr learn --robot planar --trials 40 --seed 1",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name in COMMANDS:
        command: Command = importlib.import_module(f"vvvaltr.controller.cli.{MODULES.get(name, name)}").COMMAND
        command_parser = commands.add_parser(
            name,
            help=command.help,
            description=command.help,
            epilog=f"example: {command.example}",
            allow_abbrev=False,
        )
        command.add_arguments(command_parser)
        command_parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
        command_parser.add_argument("--debug", action="store_true", help="show where an unexpected error came from")
        command_parser.set_defaults(execute=command.execute)
    return parser


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
        said += "; free some space, then go on: with a run by --resume, with anything else by the same command"
    return f"{error.filename}: {said}" if error.filename else said


def _defect(error: Exception, show_traceback: bool) -> str:
    if show_traceback:
        traceback.print_exception(error)
    where = traceback.extract_tb(error.__traceback__)[-1]
    return (
        f"unexpected {type(error).__name__}: {error} ({where.filename}:{where.lineno}); "
        "a defect of vvvaltr: please report it with the output of --debug"
    )
