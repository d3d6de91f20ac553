"""`vvvaltr compare`: which of two gaits or more is better."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.gaits import allow_negative_gaits, is_gait, read_gait
from vvvaltr.controller.cli.options import (
    add_robot_arguments,
    add_trial_arguments,
    asked_robot,
    asked_settings,
    number,
    score_details,
    whole,
)
from vvvaltr.controller.cli.telling import bar

if TYPE_CHECKING:
    from vvvaltr.controller.robot.choice import RobotChoice
    from vvvaltr.controller.robot.opening import Rig
    from vvvaltr.controller.studies.compare import Comparison


def _add_arguments(parser: ArgumentParser) -> None:
    allow_negative_gaits(parser)
    parser.add_argument("gaits", nargs="+", metavar="RUN|GAIT",
                        help="a run, for the gait it recommends, or frequencies in Hz: 12,-14,9")  # fmt: skip
    parser.add_argument("--confidence", type=number(above=0.5, high=0.999), default=0.95, metavar="P",
                        help="probability at which a gait is named the best (default 0.95)")  # fmt: skip
    parser.add_argument("--trials", type=whole(4), default=60, metavar="N",
                        help="greatest number of valid trials (default 60)")  # fmt: skip
    parser.add_argument("--out", type=Path, metavar="DIR", help="new directory for the trials, as a run to view")
    add_robot_arguments(parser)
    add_trial_arguments(parser)


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.robot.opening import open_rig
    from vvvaltr.controller.studies.compare import Comparison, Contest

    gaits = tuple(map(read_gait, arguments.gaits))
    with one_line_errors():
        contest = Contest(gaits, arguments.trials, arguments.confidence, arguments.score or "net", arguments.seed or 0)
    choice = _choose(arguments)
    rig = open_rig(choice, arguments.seed or 0)
    comparison = Comparison(contest)
    with closing(rig.robot):
        with one_line_errors():
            for gait in gaits:
                rig.robot.limits.check(gait)
        _compare(rig, comparison, choice.name, arguments)
    result = comparison.describe()
    if arguments.out is not None:
        result["run"] = str(arguments.out)
    return Answer(_prose(result), result)


def _choose(arguments: Namespace) -> RobotChoice:
    """Return the robot that was asked for; else the first run's own."""
    from vvvaltr.controller.robot.opening import choose_robot
    from vvvaltr.controller.runs.config import CONFIG_NAME, load_config, resumed_config

    asked = asked_robot(arguments)
    runs = [Path(text) for text in arguments.gaits if not is_gait(text) and (Path(text) / CONFIG_NAME).exists()]
    return resumed_config(runs[0], load_config(runs[0]), None).robot if runs and not asked else choose_robot(asked)


def _compare(rig: Rig, comparison: Comparison, robot: str, arguments: Namespace) -> None:
    from vvvaltr.controller.runs.measured import measuring
    from vvvaltr.controller.studies.compare import compare

    settings = asked_settings(rig.settings, arguments)
    with (
        measuring(arguments.out, rig.robot, robot, arguments.seed or 0, comparison.describe) as record,
        bar(arguments, total=arguments.trials, unit="trial", desc="comparing") as progress,
    ):
        for logged in compare(rig.robot, settings, comparison, record):
            progress.update(logged.score is not None)


def _prose(result: dict[str, Any]) -> str:
    first = result["gaits"][0]
    head = (
        f"better  {_hz(result['better'])}, at {100 * result['confidence']:g} % confidence"
        if result["better"]
        else f"not clear after {result['rounds']} rounds which is better; give more --trials, or take either"
    )
    lines = [f"{head} ({result['rounds']} rounds)" if result["better"] else head]
    for gait in result["gaits"]:
        stood = f"; stood still in {gait['stood_still']} of {gait['trials']} trials" if gait["stood_still"] else ""
        lines.append(f"  {_hz(gait['gait_hz']):24} {1000 * gait['mean_m_s']:6.1f} mm/s{stood}")
    for other in result["differences"]:
        lines.append(f"{_hz(first['gait_hz'])} is faster than {_hz(other['gait_hz'])} by {_interval(other)}")
    return "\n".join(lines)


def _interval(other: dict[str, Any]) -> str:
    mean = f"{1000 * other['slower_by_m_s']:.1f} mm/s"
    if other["low_m_s"] is None:
        return f"{mean}, of which nothing is certain yet"
    return f"{mean}, interval {1000 * other['low_m_s']:.1f} to {1000 * other['high_m_s']:.1f}"


def _hz(gait_hz: list[float]) -> str:
    return " ".join(f"{hz:g}" for hz in (round(it, 2) for it in gait_hz)) + " Hz"


COMMAND = Subcommand(
    help="drive gaits in turns until one is better, or the trials are used up",
    example="vvvaltr compare 12,-14,9 9,15,-7 --robot planar --confidence 0.95 --trials 60",
    add_arguments=_add_arguments,
    execute=_execute,
    details=score_details,
)
