"""`vvvaltr export`: a run as a table, one line per trial."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import refuse_to_replace
from vvvaltr.controller.cli.telling import counted
from vvvaltr.controller.core.errors import NotUnderstood


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", type=Path, metavar="RUN", help="directory of the run")
    parser.add_argument(
        "--csv", required=True, metavar="FILE", help="table to write; an existing one is replaced; - is standard output"
    )


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.runs.log import read_run
    from vvvaltr.controller.runs.table import to_csv, write_csv

    if arguments.csv == "-" and arguments.json:
        raise NotUnderstood("--csv - and --json both write to standard output: choose one")
    table = read_run(arguments.run).table()
    if arguments.csv == "-":
        return Answer(to_csv(table).rstrip("\n"), {})
    refuse_to_replace(Path(arguments.csv), ".csv", ".tsv", ".txt")
    write_csv(table, Path(arguments.csv))
    return Answer(f"{counted(len(table), 'trial')} in {arguments.csv}", {"csv": arguments.csv, "trials": len(table)})


COMMAND = Subcommand(
    help="write the trials of a run as a table, for a spreadsheet or statistics",
    example="vvvaltr export runs/flat --csv flat.csv",
    add_arguments=_add_arguments,
    execute=_execute,
)
