"""`vvvaltr view`: a run in Rerun, or several side by side."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import whole
from vvvaltr.controller.cli.rerun_extra import require_rerun
from vvvaltr.controller.core.errors import NotUnderstood, UserError


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN",
                        help="directory of a run, or a log (trials.mcap); several are shown side by side")  # fmt: skip
    parser.add_argument(
        "--trial", type=whole(1), metavar="N", help="show this trial only, with what was known after it"
    )
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--save", type=Path, metavar="FILE.rrd", help="write the recording to a file instead")
    how.add_argument("--web", action="store_true", help="show the run in the web browser")


def _execute(arguments: Namespace) -> Answer:
    if arguments.trial and len(arguments.runs) > 1:
        raise NotUnderstood("--trial shows a trial of one run: name one RUN, or leave out --trial")
    require_rerun()
    return _save(arguments) if arguments.save else _show(arguments)


def _save(arguments: Namespace) -> Answer:
    from vvvaltr.controller.view.showing import save_runs

    recording: Path = arguments.save
    if recording.exists():
        raise UserError(f"--save {recording} exists: choose another name, or move it away")
    recording.parent.mkdir(parents=True, exist_ok=True)
    save_runs(arguments.runs, recording, arguments.trial)
    return Answer(f"{recording}: open it with rerun {recording}", {"recording": str(recording)})


def _show(arguments: Namespace) -> Answer:
    from vvvaltr.controller.view.showing import show_runs

    show_runs(arguments.runs, arguments.web, arguments.trial)
    names = [str(run) for run in arguments.runs]
    return Answer(f"{', '.join(names)} {'was' if len(names) == 1 else 'were'} shown", {"run": names[0], "runs": names})


COMMAND = Subcommand(
    help="show a run in Rerun, or several side by side",
    example="vvvaltr view runs/flat",
    add_arguments=_add_arguments,
    execute=_execute,
)
