"""`vvvaltr repertoire`: learn movements, or put together what runs have logged."""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import (
    DURATION,
    TWIN_RANGE,
    add_robot_arguments,
    asked_robot,
    number,
    trial_duration,
    whole,
)
from vvvaltr.controller.cli.telling import bar, counted, say_above
from vvvaltr.controller.core.errors import NotUnderstood, UserError

if TYPE_CHECKING:
    from vvvaltr.controller.studies.repertoire import RepertoireRun
    from vvvaltr.transfer.steering.repertoire import Repertoire


def _add_arguments(parser: ArgumentParser) -> None:
    add_robot_arguments(parser)
    group = parser.add_argument_group("movements")
    group.add_argument("--gaits", dest="trials", type=whole(1), metavar="N",
                       help="number of valid trials, of new gaits and repeats of good ones (default 40)")  # fmt: skip
    group.add_argument(
        "--duration",
        dest="duration_s",
        metavar="S",
        type=trial_duration,
        help=DURATION,
    )
    group.add_argument("--range", dest="range_hz", nargs=2, type=number(), metavar=("LOW", "HIGH"),
                       help="range of frequencies to try, in Hz; positive ones are tried in both senses of rotation "
                       f"({TWIN_RANGE}, or what the robot's file says)")  # fmt: skip
    group.add_argument("--from", dest="sources", action="append", type=Path, metavar="RUN",
                       help="take the movements from this run instead of driving; repeatable")  # fmt: skip
    group.add_argument("--picture", type=Path, metavar="FILE",
                       help="also draw where each movement leads, as .png, .pdf or .svg")  # fmt: skip
    where = parser.add_argument_group("run").add_mutually_exclusive_group()
    where.add_argument(
        "--out", type=Path, metavar="DIR", help="new directory for the run (default runs/DATE-repertoire)"
    )
    where.add_argument("--resume", type=Path, metavar="DIR", help="continue the run in this directory")


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.studies.repertoire import describe, put_together

    out = arguments.out or Path("runs") / f"{time.strftime('%Y%m%d-%H%M%S')}-repertoire"
    if arguments.picture is not None:
        _refuse_bad_picture(arguments.picture)
    if arguments.sources:
        driving = (arguments.trials, arguments.resume, arguments.range_hz, arguments.duration_s)
        if asked_robot(arguments) or any(driving):
            raise NotUnderstood("--from makes no trials: leave out --robot, --gaits, --duration, --range and --resume")
        repertoire = put_together(arguments.sources, out)
        return _answer(out, describe(repertoire), repertoire, arguments.picture)
    run = _open(arguments, out)
    try:
        with closing(run):
            _learn(run, arguments)
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt(f"{interrupt}; the run is saved, continue it by --resume {run.run.path}") from None
    finally:
        result = describe(run.repertoire)
        outcomes = dict(Counter(logged.trial.outcome.value for logged in run.run.trials))
        run.run.summarise({"run": str(run.run.path), "outcomes": outcomes, **result})
    return _answer(run.run.path, result, run.repertoire, arguments.picture)


def _refuse_bad_picture(path: Path) -> None:
    from importlib.util import find_spec

    if find_spec("matplotlib") is None:
        raise UserError('the picture needs matplotlib: pip install "vvvaltr[report]"')
    if path.suffix not in (".png", ".pdf", ".svg"):
        raise NotUnderstood(f"--picture {path}: the name of a picture ends in .png, .pdf or .svg")


def _open(arguments: Namespace, out: Path) -> RepertoireRun:
    from vvvaltr.controller.studies.repertoire import RepertoireRun

    asked = asked_robot(arguments)
    if arguments.resume is not None:
        robot_file = asked.pop("name", None)
        if asked or arguments.range_hz or arguments.duration_s or arguments.seed is not None:
            raise NotUnderstood("--resume goes on with the run's own robot; leave out all but --gaits and --robot FILE")
        return RepertoireRun.resume(arguments.resume, arguments.trials, robot_file)
    if arguments.range_hz is not None:
        asked["range_hz"] = tuple(arguments.range_hz)
    return RepertoireRun.create(out, asked, arguments.seed or 0, arguments.trials or 40, arguments.duration_s)


def _learn(run: RepertoireRun, arguments: Namespace) -> None:
    done = sum(logged.score is not None for logged in run.run.trials)
    total = run.run.config.trials
    with bar(arguments, total=total, initial=done, unit="trial", desc="learning movements") as progress:
        for logged in run.learn():
            if logged.score is None:
                say_above(progress, f"trial {logged.trial.number}: {logged.trial.ending}")
            else:
                progress.set_postfix_str(logged.suggestion.origin, refresh=False)
                progress.update()


def _answer(path: Path, result: dict[str, Any], repertoire: Repertoire, picture: Path | None) -> Answer:
    if not repertoire.movements:
        raise UserError(f"{path}: no trial shows a movement; make longer ones, by a new run with --duration 5")
    if picture is not None:
        from vvvaltr.controller.view.repertoire_picture import draw_repertoire

        draw_repertoire(repertoire, str(path), picture)
    lines = [
        f"movements  {counted(result['gaits'], 'gait')} in {counted(result['trials'], 'trial')}",
        f"fastest    {1000 * result['fastest_m_s']:.1f} mm/s",
        f"turning    {result['turn_left_rad_s']:.2f} rad/s to the left, {result['turn_right_rad_s']:.2f} to the right",
        f"floor      carries the robot by {_write_drift(result['drift_m_s'])} mm/s, as far as these trials tell",
        f"run        {path}",
        *([f"picture    {picture}"] if picture else []),
    ]
    return Answer("\n".join(lines), {"run": str(path), **result})


def _write_drift(drift_m_s: Sequence[float]) -> str:
    return " ".join(f"{axis} {1000 * speed_m_s:+.1f}" for axis, speed_m_s in zip("xy", drift_m_s, strict=True))


COMMAND = Subcommand(
    help="learn movements to steer by: forward, left and turn of tried gaits",
    example="vvvaltr repertoire --robot spatial --gaits 40 --out runs/moves",
    add_arguments=_add_arguments,
    execute=_execute,
)
