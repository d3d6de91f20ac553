"""Arguments that several commands share. What is not given stays None, so that defaults are filled in one place."""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError, Namespace, _ArgumentGroup
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.parser import Details
from vvvaltr.controller.core.errors import NotUnderstood, UserError
from vvvaltr.controller.core.spelling import unknown
from vvvaltr.controller.loop.scoring import SCORES

if TYPE_CHECKING:
    from vvvaltr.controller.loop.trial_runner import TrialSettings

TWINS = ("planar", "spatial")
LAWS = ("eccentric", "constant")
ANY_ROBOT = "a twin, planar or spatial, or a robot's file FILE.toml (default planar)"
ANY_TWIN = "a twin, planar or spatial (default planar)"
DURATION = "time that the motors are driven in a trial, in s (default 5, or what the robot's file says)"
TWIN_RANGE = "default 4 to 16.7 on planar, 5 to 50 on spatial"


def number(low: float = -math.inf, above: float = -math.inf, high: float = math.inf) -> Callable[[str], float]:
    """Return an argument type: a finite number, at least ``low``, greater than ``above`` and at most ``high``."""

    def convert(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and low <= value <= high and value > above):
            bounds = (
                f" greater than {above:g}" if above > -math.inf else f" of at least {low:g}" if low > -math.inf else ""
            )
            most = f" and at most {high:g}" if high < math.inf else ""
            raise ArgumentTypeError(f"{text!r} is not a number{bounds}{most}")
        return value

    return convert


def whole(low: int) -> Callable[[str], int]:
    """Return an argument type: a whole number of at least ``low``."""

    def convert(text: str) -> int:
        try:
            value = int(text)
        except ValueError:  # of too many digits, too
            value = low - 1
        if value < low:
            raise ArgumentTypeError(f"{text!r} is not a whole number of at least {low}")
        return value

    return convert


def one_of(*kinds: str) -> Callable[[str], tuple[str, ...]]:
    """Return an argument type: one or more of ``kinds``, separated by commas."""

    def convert(text: str) -> tuple[str, ...]:
        chosen = tuple(text.split(","))
        if wrong := [kind for kind in chosen if kind not in kinds]:
            raise ArgumentTypeError(unknown("value", wrong[0], kinds))
        return tuple(kind for kind in kinds if kind in chosen)

    return convert


trial_duration = number(low=0.1, high=3600.0)
"""The argument type of a trial's duration in s: long enough to see the robot move, and as long as a run's can be."""


def heading_limit(text: str) -> float:
    """Convert an argument: a number above 0, or inf."""
    return math.inf if text == "inf" else number(above=0)(text)


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file that a person named, or replace it. Raises UserError where it cannot be written."""
    from vvvaltr.controller.core.disk import write_whole

    try:
        write_whole(path, content)
    except OSError as error:
        raise UserError(f"{path} cannot be written: {error.strerror}; name another file") from error


def refuse_to_replace(path: Path, *endings: str) -> None:
    """Raise UserError where a file of another kind is there, as the log or robot's file that was meant to be read.

    A file without an ending may be of this kind, too.
    """
    if not path.parent.is_dir():
        raise UserError(f"{path} cannot be written: {path.parent} is no directory; make it, or name another file")
    if path.is_file() and path.suffix.lower() not in ("", *endings):
        raise UserError(f"{path} exists and is no {endings[0]} file: name another file, or move it away")


def add_robot_arguments(parser: ArgumentParser, kinds: str = ANY_ROBOT) -> None:
    """Declare which robot, of ``kinds``, and a twin's condition."""
    group = parser.add_argument_group("robot")
    group.add_argument(
        "--robot",
        metavar="NAME",
        help=kinds,
    )
    group.add_argument("--seed", type=whole(0), metavar="N", help="seed of every random stream (default 0)")
    _add_permission(group)
    twin = parser.add_argument_group("condition of a twin")
    twin.add_argument("--body", metavar="NAME", help="prism3 (default of planar) or icosahedron6 (default of spatial)")
    twin.add_argument(
        "--law", choices=LAWS, metavar="NAME", help="force law of the motors: eccentric (default) or constant"
    )
    twin.add_argument(
        "--world",
        metavar="GROUND",
        help="flat, hills or slope; settings as in hills:height_m=0.006 (default flat)",
    )
    twin.add_argument(
        "--gravity", dest="gravity_m_s2", metavar="M_S2", type=number(above=0), help="gravity in m/s^2 (default 9.81)"
    )
    twin.add_argument(
        "--friction", metavar="MU", type=number(low=0), help="Coulomb coefficient of the ground (default 0.5)"
    )
    twin.add_argument(
        "--scatter",
        metavar="CAUSES",
        help="what differs from trial to trial: careful (default), hurried, none or frequency; settings as in "
        "hurried:incline_rad=0.05,not_starting=0",
    )
    twin.add_argument(
        "--tracker-noise",
        dest="tracker_noise_mm",
        metavar="MM",
        type=number(low=0),
        help="noise of each coordinate of the tracker in mm, of the angles in proportion (default 0.2)",
    )
    twin.add_argument(
        "--damage",
        action="append",
        metavar="WHAT",
        help="snap:4,18 (springs), lighten:3:0.5 (strut, factor) or disable:2 (motor), all counted from 1; repeatable",
    )


def add_trial_arguments(parser: ArgumentParser) -> None:
    """Declare how a trial is run and scored."""
    group = parser.add_argument_group("trial")
    group.add_argument(
        "--duration",
        dest="duration_s",
        metavar="S",
        type=trial_duration,
        help=DURATION,
    )
    group.add_argument(
        "--heading-limit",
        dest="heading_limit_rad",
        metavar="RAD",
        type=heading_limit,
        help="end a trial when the robot has turned further, in rad (default inf, or what the robot's file says)",
    )
    group.add_argument(
        "--score",
        choices=tuple(SCORES),
        metavar="NAME",
        help=f"what counts as speed: {', '.join(SCORES)} (default net)",
    )


def asked_settings(usual: TrialSettings, arguments: Namespace) -> TrialSettings:
    """Return how a trial is run: as was asked by the options of ``add_trial_arguments``, else as usual."""
    return replace(
        usual,
        duration_s=arguments.duration_s or usual.duration_s,
        heading_limit_rad=arguments.heading_limit_rad or usual.heading_limit_rad,
    )


def score_details() -> Details:
    """Return the section of a help text that explains the scores."""
    return {"scores": {name: score.description for name, score in SCORES.items()}}


def method_details() -> Details:
    """Return the section of a help text that explains the methods."""
    from vvvaltr.transfer.methods.registry import METHODS

    return {"methods": {name: method.description for name, method in METHODS.items()}}


def add_robot_file_arguments(parser: ArgumentParser) -> None:
    """Declare the robot's file, by its place or as an option."""
    parser.add_argument("robot_file", nargs="?", type=Path, metavar="ROBOT.toml", help="the robot's file")
    parser.add_argument("--robot", type=Path, metavar="FILE", help="the same, as an option")
    _add_permission(parser)


def _add_permission(parser: ArgumentParser | _ArgumentGroup) -> None:
    parser.add_argument(
        "--allow-url",
        action="store_true",
        help="let the robot's file name other ports than this computer's, such as socket://HOST:PORT",
    )


def chosen_robot_file(arguments: Namespace, command: str, purpose: str) -> Path | None:
    """Return the robot's file, None if none is named; ``purpose`` says what the command is for.

    Raises:
        NotUnderstood: two are named, or a twin.
    """
    example = f"vvvaltr {command} robot.toml"
    path: Path | None = arguments.robot_file or arguments.robot
    if arguments.robot_file and arguments.robot:
        raise NotUnderstood(f"{command} takes one robot: leave out {path} or --robot {arguments.robot}")
    if path is not None and str(path) in TWINS and not path.exists():
        raise NotUnderstood(f"{path} is a twin; {command} {purpose}: name its file, as in {example}")
    return path


_ROBOT_KEYS = ("body", "law", "world", "gravity_m_s2", "friction", "scatter", "damage")


def asked_robot(arguments: Namespace) -> dict[str, Any]:
    """Return what was asked of the robot, and no more, keyed as in RobotChoice."""
    asked = {key: value for key in _ROBOT_KEYS if (value := getattr(arguments, key)) is not None}
    if arguments.robot is not None:
        asked["name"] = arguments.robot
    if arguments.tracker_noise_mm is not None:
        asked["tracker_noise_m"] = arguments.tracker_noise_mm / 1000.0
    if "damage" in asked:
        asked["damage"] = tuple(asked["damage"])
    return asked
