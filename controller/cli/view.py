"""`vvvaltr view`: a run in Rerun."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from vvvaltr.controller.cli.answer import Answer, Command
from vvvaltr.controller.cli.rerun_extra import require_rerun
from vvvaltr.controller.core.errors import UserError


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", type=Path, metavar="RUN", help="directory of the run")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--save", type=Path, metavar="FILE.rrd", help="write the recording to a file instead")
    how.add_argument("--web", action="store_true", help="show the run in the web browser")


def _execute(arguments: Namespace) -> Answer:
    require_rerun()
    return _save(arguments.run, arguments.save) if arguments.save else _show(arguments.run, web=arguments.web)


def _save(run: Path, recording: Path) -> Answer:
    from vvvaltr.controller.view.showing import save_run

    if recording.exists():
        raise UserError(f"--save {recording} exists: choose another name, or move it away")
    recording.parent.mkdir(parents=True, exist_ok=True)
    save_run(run, recording)
    return Answer(f"{recording}: open it with rerun {recording}", {"recording": str(recording)})


def _show(run: Path, web: bool) -> Answer:
    from vvvaltr.controller.view.showing import show_run

    show_run(run, web=web)
    return Answer(f"{run} was shown", {"run": str(run)})


COMMAND = Command(
    help="show a run in Rerun",
    example="vvvaltr view runs/flat",
    add_arguments=_add_arguments,
    execute=_execute,
)
