"""`vvvaltr stop`: stop the motors of a run, or of all runs of this machine, from any terminal."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from vvvaltr.controller.cli.answer import Answer, Subcommand


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", nargs="*", type=Path, metavar="RUN", help="directory of a run (default: all that are "
                        "under way on this machine)")  # fmt: skip


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.core.errors import UserError
    from vvvaltr.controller.runs.underway import Underway, find_all, find_run

    problems: list[str] = []
    running = [find_run(run) for run in arguments.run] if arguments.run else find_all()
    for act in (Underway.stop, Underway.wait):  # all are told before one is waited for
        for each in running:
            try:
                act(each)
            except UserError as error:
                problems.append(str(error))
    stopped = [each.what for each in running]
    if problems:
        raise UserError("; ".join(problems))
    lines = [f"stopped    {what}: motors at rest, all is saved" for what in stopped]
    return Answer("\n".join(lines) or "nothing is under way on this machine", {"stopped": stopped})


COMMAND = Subcommand(
    help="stop the motors of a run, or of all runs of this machine, and end it saved",
    example="vvvaltr stop",
    add_arguments=_add_arguments,
    execute=_execute,
)
