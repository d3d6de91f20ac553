"""`vvvaltr report`: what a run or a campaign found, as one HTML file."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from importlib.util import find_spec
from pathlib import Path

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import refuse_to_replace
from vvvaltr.controller.core.errors import NotUnderstood, UserError


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("path", type=Path, metavar="DIR", help="directory of a run or of a campaign, or a log")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--out", type=Path, metavar="FILE.html", help="page to write of a run (default DIR/report.html)")
    how.add_argument("--markdown", action="store_true",
                     help="print the tables of a campaign in Markdown instead of writing files")  # fmt: skip


def _execute(arguments: Namespace) -> Answer:
    path: Path = arguments.path
    is_run = path.is_file() or (path / "trials.mcap").exists()
    if not (is_run or (path / "campaign.toml").exists()):
        raise UserError(f"{path} is neither a run nor a campaign: name what vvvaltr learn or vvvaltr experiment wrote")
    if is_run and arguments.markdown:
        raise NotUnderstood("--markdown is for a campaign; vvvaltr export writes the trials of a run as a table")
    if not is_run and arguments.out is not None:
        raise NotUnderstood("--out is for a run; the report of a campaign is its report.html")
    if not arguments.markdown and find_spec("matplotlib") is None:
        raise UserError('the figures need matplotlib: pip install "vvvaltr[report]"')
    return _report_run(path, arguments.out) if is_run else _report_campaign(path, arguments.markdown)


def _report_run(path: Path, out: Path | None) -> Answer:
    from vvvaltr.controller.loop.summary import summarise
    from vvvaltr.controller.view.run_report import write_run_report

    page = out or (path / "report.html" if path.is_dir() else path.with_name("report.html"))
    refuse_to_replace(page, ".html", ".htm")
    try:
        found = write_run_report(path, page)
    except OSError as error:
        raise UserError(f"{page} cannot be written: {error.strerror}; name another file by --out") from error
    coverage = None if found.left_out is None else found.left_out.coverage
    data = {"report": str(page), "run": str(path), "coverage": coverage, **summarise(found.run.trials)}
    return Answer(f"{page}: open it in a browser", data)


def _report_campaign(path: Path, markdown: bool) -> Answer:
    from vvvaltr.transfer.experiments.findings import as_json
    from vvvaltr.transfer.experiments.report import require_findings, to_markdown, write_report
    from vvvaltr.transfer.experiments.store import Store

    store = Store.open(path)
    found = require_findings(store)
    if markdown:
        return Answer(to_markdown(found), {"experiments": as_json(found), "out": str(path)})
    page = write_report(store)
    return Answer(f"{page}: open it in a browser", {"report": str(page), "experiments": as_json(found)})


COMMAND = Subcommand(
    help="write one HTML file of what a run, or a campaign of vvvaltr experiment, found",
    example="vvvaltr report runs/flat",
    add_arguments=_add_arguments,
    execute=_execute,
)
