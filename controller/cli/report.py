"""`vvvaltr report`: what a campaign found, as figures and one HTML file."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from importlib.util import find_spec
from pathlib import Path

from vvvaltr.controller.cli.answer import Answer, Command
from vvvaltr.controller.core.errors import UserError


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("campaign", type=Path, metavar="DIR", help="directory of the campaign (see vvvaltr experiment)")
    parser.add_argument("--markdown", action="store_true", help="print the tables in Markdown instead of writing files")


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.transfer.experiments.findings import as_json
    from vvvaltr.transfer.experiments.report import require_findings, to_markdown, write_report
    from vvvaltr.transfer.experiments.store import Store

    if not arguments.markdown and find_spec("matplotlib") is None:
        raise UserError('the figures need matplotlib: pip install "vvvaltr[report]"')
    store = Store.open(arguments.campaign)
    found = require_findings(store)
    if arguments.markdown:
        return Answer(to_markdown(found), {"experiments": as_json(found), "out": str(arguments.campaign)})
    page = write_report(store)
    return Answer(f"{page}: open it in a browser", {"report": str(page), "experiments": as_json(found)})


COMMAND = Command(
    help="write figures and one HTML file of the results of vvvaltr experiment",
    example="vvvaltr report runs/thesis",
    add_arguments=_add_arguments,
    execute=_execute,
)
