"""`vvvaltr show`: a run on one screen."""

from __future__ import annotations

import shutil
import textwrap
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.controller.cli.answer import Answer, Subcommand

if TYPE_CHECKING:
    from vvvaltr.controller.core.records import Run
    from vvvaltr.controller.runs.config import RunConfig
    from vvvaltr.controller.runs.listing import Listed


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("run", type=Path, metavar="RUN", help="directory of the run, or a log (trials.mcap)")


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.loop.summary import summarise
    from vvvaltr.controller.runs.listing import describe_run
    from vvvaltr.controller.runs.log import read_run

    path: Path = arguments.run
    run = read_run(path)
    listed = describe_run(path) if path.is_dir() else None
    width = max(20, min(shutil.get_terminal_size().columns, 100))
    return Answer(_write(path, run, listed, width), {"run": str(path), **dict(run.about), **summarise(run.trials)})


def _write(path: Path, run: Run, listed: Listed | None, width: int) -> str:
    from vvvaltr.controller.view.learned import reopen_config
    from vvvaltr.controller.view.terminal import plot_speeds

    facts = {"run": str(path), **_describe_making(run, listed), **_describe_result(run, reopen_config(path))}
    suspects = [str(logged.trial.number) for logged in run.trials if logged.review.is_suspect]
    if suspects:
        facts["suspect"] = f"trials {', '.join(suspects)}"
    lines = [
        textwrap.fill(f"{name:<11}{text}", width, subsequent_indent=" " * 11, break_on_hyphens=False)
        for name, text in facts.items()
        if text
    ]
    key = "o measured  x nothing measured  - posterior mean of the best gait"
    return "\n".join([*lines, "", plot_speeds(run.trials, width), textwrap.shorten(key, width)])


def _describe_making(run: Run, listed: Listed | None) -> dict[str, str]:
    about = run.about
    robot = (listed.robot if listed else "") or about.get("robot", "")
    method = listed.method if listed else ""
    version = f"vvvaltr {about['version']}" if "version" in about else ""
    return {
        "robot": " ".join(filter(None, (robot, listed.world if listed else ""))),
        "method": f"{method}, seed {about['seed']}" if method and "seed" in about else method,
        "sources": ", ".join(source.name for source in run.sources),
        "made": ", ".join(filter(None, (about.get("date", ""), version))),
        "state": listed.state.value if listed else "",
    }


def _describe_result(run: Run, config: RunConfig | None) -> dict[str, str]:
    from vvvaltr.controller.loop.summary import summarise, tell_causes
    from vvvaltr.controller.view.commands import write_trial_command

    found = summarise(run.trials)
    outcomes = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in found["outcomes"].items())
    facts = {"trials": f"{found['trials']} ({outcomes})" if outcomes else "none yet"}
    if best := found["recommended"]:
        mean, low, high = (1000.0 * best[key] for key in ("mean_m_s", "low_m_s", "high_m_s"))
        recommendation = next(it.recommendation for it in reversed(run.trials) if it.recommendation is not None)
        facts["best gait"] = f"{mean:.1f} mm/s (posterior mean), 95 % interval {low:.1f} to {high:.1f} mm/s"
        facts["drive it"] = write_trial_command(recommendation.gait, run.about.get("robot", ""), config)
    if once := found["best_observed"]:
        facts["fastest"] = f"trial {once['trial']}: {1000.0 * once['score_m_s']:.1f} mm/s; one trial alone may be luck"
    return facts | dict(tell_causes(found))


COMMAND = Subcommand(
    help="show a run on one screen: its best gait, its trials, and a plot of their speeds",
    example="vvvaltr show runs/flat",
    add_arguments=_add_arguments,
    execute=_execute,
)
