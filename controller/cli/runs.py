"""`vvvaltr runs`: the runs in a directory."""

from __future__ import annotations

import shutil
import textwrap
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand

if TYPE_CHECKING:
    from vvvaltr.controller.runs.listing import Listed

_COLUMNS = ("run", "robot", "world", "method", "trials", "mm/s", "source", "date", "state")
_FIRST_TO_GO = ("source", "world", "method", "date", "robot", "state", "trials")


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, nargs="?", default=Path("runs"), metavar="DIR",
                        help="directory that holds the runs (default runs)")  # fmt: skip


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.runs.listing import list_runs
    from vvvaltr.controller.view.terminal import lay_out_columns

    found = list_runs(arguments.folder)
    if not found:
        return Answer(f"no run in {arguments.folder}: vvvaltr learn makes one", {"runs": []})
    width = shutil.get_terminal_size().columns
    table = lay_out_columns(_COLUMNS, [_row(run) for run in found], width, _FIRST_TO_GO)
    return Answer(
        f"{table}\n{textwrap.fill(_explain(found), max(width, 20))}", {"runs": [_as_data(run) for run in found]}
    )


def _row(run: Listed) -> tuple[str, ...]:
    trials = "" if run.trials is None else f"{run.trials}" + (f"/{run.wanted}" if run.wanted else "")
    return (
        run.path.name or str(run.path.resolve().name),
        Path(run.robot).stem,
        run.world,
        run.method,
        trials,
        _write_best(run),
        " ".join(Path(source).name for source in run.sources),
        f"{run.began:%Y-%m-%d %H:%M}",
        run.state.value,
    )


def _write_best(run: Listed) -> str:
    if run.best_m_s is not None:
        mean, low, high = (1000.0 * speed for speed in run.best_m_s)
        return f"{mean:.1f} ({low:.1f} to {high:.1f})"
    return "" if run.observed_m_s is None else f"{1000.0 * run.observed_m_s:.1f} once"


def _explain(found: Sequence[Listed]) -> str:
    has_once = any(run.best_m_s is None and run.observed_m_s is not None for run in found)
    once = "; once: the fastest single trial, which may be luck" if has_once else ""
    return f"mm/s: the best gait's posterior mean, with its 95 % interval{once}"


def _as_data(run: Listed) -> dict[str, Any]:
    mean, low, high = run.best_m_s or (None, None, None)
    return {
        "run": str(run.path),
        "robot": run.robot,
        "world": run.world,
        "method": run.method,
        "trials": run.trials,
        "wanted": run.wanted,
        "mean_m_s": mean,
        "low_m_s": low,
        "high_m_s": high,
        "observed_m_s": run.observed_m_s,
        "sources": list(run.sources),
        "began": run.began.isoformat(timespec="seconds"),
        "state": run.state.value,
    }


COMMAND = Subcommand(
    help="list the runs in a directory",
    example="vvvaltr runs runs",
    add_arguments=_add_arguments,
    execute=_execute,
)
