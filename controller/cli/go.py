"""`vvvaltr go`: drive the robot to a place."""

from __future__ import annotations

import math
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.following import add_following_arguments, open_events, open_live_view
from vvvaltr.controller.cli.options import add_robot_arguments, asked_robot, number
from vvvaltr.controller.cli.telling import bar, counted, say_above
from vvvaltr.controller.core.errors import NotUnderstood

if TYPE_CHECKING:
    from vvvaltr.controller.core.protocols import Observer
    from vvvaltr.controller.runs.errand import Errand
    from vvvaltr.controller.studies.going import GoRun


_PROGRESS = "{desc}: primitive {n_fmt} done, {elapsed}{postfix}"


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("x_m", nargs="?", type=number(), metavar="X", help="where to go, in m in the tracker's frame")
    parser.add_argument(
        "y_m",
        nargs="?",
        type=number(),
        metavar="Y",
        help="and y in m; leave it out on the planar twin, which moves along x",
    )
    parser.add_argument("--yaw", dest="yaw_rad", type=number(), metavar="RAD", help="heading to arrive with, in rad")
    parser.add_argument(
        "--path", type=Path, metavar="FILE.csv", help="way points instead, x, y and perhaps yaw in each line"
    )
    parser.add_argument("--within", dest="within_m", type=number(above=0), default=0.02, metavar="M",
                        help="distance at which the goal is reached, in m (default 0.02)")  # fmt: skip
    parser.add_argument("--within-yaw", dest="within_rad", type=number(above=0), default=0.2, metavar="RAD",
                        help="error of the heading that is accepted, in rad (default 0.2)")  # fmt: skip
    parser.add_argument("--time", dest="budget_s", type=number(above=0), default=200.0, metavar="S",
                        help="driving time after which a goal is given up, in s (default 200)")  # fmt: skip
    parser.add_argument("--repertoire", action="append", type=Path, metavar="RUN",
                        help="run whose movements to use; repeatable")  # fmt: skip
    add_robot_arguments(parser)
    group = parser.add_argument_group("run")
    where = group.add_mutually_exclusive_group()
    where.add_argument("--out", type=Path, metavar="DIR", help="new directory for the run (default runs/DATE-go)")
    where.add_argument(
        "--resume", type=Path, metavar="DIR", help="continue the run in this directory, from where the robot is"
    )
    add_following_arguments(group)


def _execute(arguments: Namespace) -> Answer:
    with ExitStack() as stack:
        observers = open_events(arguments, stack)
        run = _open(arguments)
        try:
            with closing(run):
                _go(run, observers, arguments)
        except KeyboardInterrupt as interrupt:
            raise KeyboardInterrupt(f"{interrupt}; the run is saved, continue it by --resume {run.run.path}") from None
        finally:
            result = run.summarise()
    return Answer(_prose(result), result, status=0 if result["reached"] else 1)


def _open(arguments: Namespace) -> GoRun:
    from vvvaltr.controller.studies.going import GoRun

    if arguments.resume is not None:
        if arguments.x_m is not None or arguments.path or arguments.repertoire:
            raise NotUnderstood(
                "--resume goes on with the run's own goals and movements; leave out X Y, --path, --repertoire"
            )
        return GoRun.resume(arguments.resume, arguments.robot)
    errand = _errand(arguments)
    if not arguments.repertoire:
        raise NotUnderstood("go needs movements: name a run by --repertoire, or learn some by vvvaltr repertoire")
    out = arguments.out or Path("runs") / f"{time.strftime('%Y%m%d-%H%M%S')}-go"
    return GoRun.create(out, asked_robot(arguments), arguments.seed or 0, arguments.repertoire, errand)


def _errand(arguments: Namespace) -> Errand:
    from vvvaltr.controller.runs.errand import Errand
    from vvvaltr.controller.studies.going import read_goals

    if (arguments.path is None) == (arguments.x_m is None):
        raise NotUnderstood("say where to go: either X Y, or way points by --path FILE.csv")
    if arguments.path is not None:
        if arguments.yaw_rad is not None:
            raise NotUnderstood("--yaw belongs to X Y; in a file of way points each has a heading of its own, or none")
        goals = read_goals(arguments.path)
    elif arguments.y_m is None and (arguments.robot or "planar") != "planar":
        raise NotUnderstood("Y is missing: only the planar twin moves along a line")
    else:
        goals = ((arguments.x_m, arguments.y_m or 0.0, arguments.yaw_rad),)
        if arguments.y_m is not None and (arguments.robot or "planar") == "planar":
            raise NotUnderstood("the planar twin moves along x only: leave out Y")
    return Errand(goals, arguments.within_m, arguments.within_rad, arguments.budget_s)


def _go(run: GoRun, observers: Sequence[Observer], arguments: Namespace) -> None:
    from vvvaltr.controller.view.showing import show_going

    with ExitStack() as stack:
        view = open_live_view(arguments, stack, lambda: show_going(run.run.path))
        progress = stack.enter_context(bar(arguments, desc="going", bar_format=_PROGRESS))
        for logged in run.go([*observers, *([view] if view else [])], view.watch if view else None):
            trial = logged.trial
            progress.update()
            if not trial.outcome.is_valid:
                say_above(progress, f"primitive {trial.number}: {trial.ending}")
            elif logged.steering is not None:
                x_m, y_m, _ = trial.poses[-1].position_m
                left_m = math.hypot(x_m - logged.steering.goal_m[0], y_m - logged.steering.goal_m[1])
                progress.set_postfix_str(f"{1000 * left_m:.0f} mm to go", refresh=False)


def _prose(result: dict[str, Any]) -> str:
    x_m, y_m = result["position_m"]
    begin = "reached" if result["reached"] else f"not reached: {result['reason'] or 'interrupted'}"
    return "\n".join(
        (
            begin,
            f"at         {x_m:.3f} {y_m:.3f} m, heading {result['yaw_rad']:z.2f} rad",
            f"off by     {1000 * result['error_m']:.0f} mm",
            f"driven     {result['duration_s']:.1f} s in {counted(result['primitives'], 'primitive')}",
            *([f"run        {result['run']}"] if result["run"] else []),
        )
    )


COMMAND = Subcommand(
    help="drive the robot to a place, or along way points, by movements that were learned",
    example="vvvaltr go 0.30 -0.20 --repertoire runs/moves --robot spatial --seed 2",
    add_arguments=_add_arguments,
    execute=_execute,
)
