"""`vvvaltr floor`: whether the floor is inclined, and how much that moves the robot."""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.gaits import allow_negative_gaits, read_gait
from vvvaltr.controller.cli.options import DURATION, TWINS, add_robot_arguments, asked_robot, trial_duration, whole
from vvvaltr.controller.cli.telling import ask, bar, say
from vvvaltr.controller.core.errors import NotUnderstood

if TYPE_CHECKING:
    from vvvaltr.controller.core.gaits import Gait
    from vvvaltr.controller.core.records import LoggedTrial
    from vvvaltr.controller.robot.choice import RobotChoice
    from vvvaltr.controller.robot.opening import Rig
    from vvvaltr.controller.studies.floor import TurnedTwin

Turn = Callable[[int, float], None]

_TRIALS = 8
_LIVELY = 0.8  # of the highest frequency, for the gait that is driven unless another is given


def _add_arguments(parser: ArgumentParser) -> None:
    allow_negative_gaits(parser)
    parser.add_argument("what", nargs="?", metavar="ROBOT|RUN",
                        help="spatial or a robot's file, to drive; or a run, to look at what it logged")  # fmt: skip
    parser.add_argument("--gait", metavar="RUN|GAIT", help="what to drive: frequencies in Hz, 12,-14,9, or what "
                        "a run recommends (default: 80, 72 and 64 %% of full speed)")  # fmt: skip
    parser.add_argument("--trials", type=whole(2), metavar="N", help="valid trials to make (default 8)")
    parser.add_argument("--duration", dest="duration_s", metavar="S", type=trial_duration, help=DURATION)
    parser.add_argument("--out", type=Path, metavar="DIR", help="new directory for the trials, as a run to view")
    add_robot_arguments(parser, "the same as ROBOT, as an option")


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.runs.log import LOG_NAME, read_run
    from vvvaltr.controller.studies.floor import describe_drift, find_drift

    path = Path(arguments.what or "")
    if arguments.what and (path / LOG_NAME).exists():
        _refuse_driving(arguments, path)
        trials = list(read_run(path / LOG_NAME).trials)
    else:
        trials = _drive(arguments)
    drift = find_drift(trials)
    return _answer(describe_drift(drift, sum(logged.score is not None for logged in trials)))


def _refuse_driving(arguments: Namespace, path: Path) -> None:
    """Raise NotUnderstood for what is asked of trials: a run has its own."""
    driving = (arguments.seed is not None, arguments.gait, arguments.duration_s, arguments.trials, arguments.out)
    if asked_robot(arguments) or any(driving):
        raise NotUnderstood(f"{path} is a run, which is looked at, not driven: leave out all options of trials")


def _drive(arguments: Namespace) -> list[LoggedTrial]:
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.core.gaits import make_lively_gait
    from vvvaltr.controller.robot.opening import choose_robot, open_rig
    from vvvaltr.controller.studies.floor import open_turned_twin

    asked = asked_robot(arguments)
    if arguments.what is not None:
        if arguments.what not in TWINS and not arguments.what.endswith(".toml"):
            raise NotUnderstood(f"{arguments.what} is neither a robot nor a run: name spatial or FILE.toml")
        if arguments.robot is not None:
            raise NotUnderstood(f"floor takes one robot: leave out {arguments.what} or --robot {arguments.robot}")
        asked["name"] = arguments.what
    choice, seed = choose_robot(asked), arguments.seed or 0
    if choice.name == "planar":
        raise NotUnderstood("the planar twin has no heading, so nothing tells its floor from itself: name spatial")
    turn = _ask_to_turn(arguments)
    if choice.is_twin:
        rig, twin = open_turned_twin(choice, seed)
        turn = partial(_turn_twin, twin)
    else:
        rig = open_rig(choice, seed)
    with closing(rig.robot):
        usual = make_lively_gait([_LIVELY * rig.range_hz[1]] * rig.robot.motors.motor_count)
        gait = read_gait(arguments.gait) if arguments.gait else usual
        with one_line_errors():
            rig.robot.limits.check(gait)
        return _survey(rig, choice, gait, turn, arguments)


def _survey(rig: Rig, choice: RobotChoice, gait: Gait, turn: Turn, arguments: Namespace) -> list[LoggedTrial]:
    from vvvaltr.controller.runs.measured import measuring
    from vvvaltr.controller.studies.floor import survey_floor

    settings = replace(rig.settings, duration_s=arguments.duration_s or rig.settings.duration_s)
    with measuring(arguments.out, rig.robot, choice.name, arguments.seed or 0) as record:
        total = arguments.trials or _TRIALS
        trials = survey_floor(rig.robot, gait, settings, total, turn, record)
        return list(bar(arguments, trials, total=total, desc="driving", unit="trial", is_needed=choice.is_twin))


def _turn_twin(twin: TurnedTwin, number: int, heading_rad: float) -> None:
    twin.heading_rad = heading_rad


def _ask_to_turn(arguments: Namespace) -> Turn:
    """Return what asks the operator to turn a robot, and waits where somebody can answer."""

    def turn(number: int, heading_rad: float) -> None:
        degrees = math.degrees(heading_rad)
        say(arguments, f"trial {number}: turn the robot to about {degrees:.0f} degrees from where it headed first")
        if sys.stdin.isatty():
            ask("press Enter when it lies still: ")

    return turn


def _answer(found: dict[str, Any]) -> Answer:
    speed_mm_s, sd_mm_s = 1000.0 * found["speed_m_s"], 1000.0 * found["sd_m_s"]
    towards = f"towards {math.degrees(found['azimuth_rad']):.0f} degrees from the tracker's x axis"
    if found["is_inclined"]:
        head = f"floor   inclined: it carries the robot by {speed_mm_s:.1f} +- {sd_mm_s:.1f} mm/s, {towards}"
        cure = "put the robot back to one heading for each trial, or level the floor"
    else:
        head = f"floor   level as far as {found['trials']} trials tell: {speed_mm_s:.1f} +- {sd_mm_s:.1f} mm/s"
        cure = "more --trials tell more"
    return Answer(f"{head}\ncertain {100 * found['probability']:.0f} % that there is a drift\n{cure}", found)


COMMAND = Subcommand(
    help="measure whether the floor is inclined, and where it carries the robot",
    example="vvvaltr floor spatial --scatter hurried --trials 8",
    add_arguments=_add_arguments,
    execute=_execute,
)
