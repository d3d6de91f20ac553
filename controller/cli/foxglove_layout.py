"""`vvvaltr foxglove-layout`: a layout file for Foxglove."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from pathlib import Path

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import refuse_to_replace, whole, write_file


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE.json", help="layout to write; an existing one is replaced")
    parser.add_argument("--motors", type=whole(1), default=3, metavar="N", help="number of motors (default 3)")


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.view.foxglove import make_layout

    refuse_to_replace(arguments.file, ".json")
    write_file(arguments.file, json.dumps(make_layout(arguments.motors), indent=2) + "\n")
    how = "in Foxglove, open a run's trials.mcap, then import this file from the menu of layouts"
    return Answer(f"{arguments.file}: {how}", {"layout": str(arguments.file)})


COMMAND = Subcommand(
    help="write a layout file with which Foxglove shows a log",
    example="vvvaltr foxglove-layout vvvaltr.json",
    add_arguments=_add_arguments,
    execute=_execute,
)
