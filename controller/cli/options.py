"""Arguments that several commands share. What is not given stays None, so that defaults are filled in one place."""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable
from typing import Any


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


trial_duration = number(low=0.1)
"""The argument type of a trial's duration in s: long enough to see the robot move."""


def add_robot_arguments(parser: ArgumentParser) -> None:
    """Declare which robot, and a twin's condition."""
    group = parser.add_argument_group("robot")
    group.add_argument("--robot", metavar="NAME", help="planar, spatial, or a robot's file FILE.toml (default planar)")
    group.add_argument("--seed", type=whole(0), help="of every random stream (default 0)")
    twin = parser.add_argument_group("condition of a twin")
    twin.add_argument("--body", help="prism3 or icosahedron6 (default: planar prism3, spatial icosahedron6)")
    twin.add_argument("--law", choices=("eccentric", "constant"), help="force law of the motors (default eccentric)")
    twin.add_argument("--world", help="flat, hills or slope, with details as in hills:height_m=0.006 (default flat)")
    twin.add_argument("--gravity", dest="gravity_m_s2", metavar="M_S2", type=number(above=0), help="default 9.81")
    twin.add_argument("--friction", type=number(low=0), help="coefficient of the ground (default 0.5)")
    twin.add_argument(
        "--damage",
        action="append",
        metavar="WHAT",
        help="snap:4,18 (springs), lighten:3:0.5 (strut, factor) or disable:2 (motor), all counted from 1; repeatable",
    )


def add_trial_arguments(parser: ArgumentParser) -> None:
    """Declare how a trial is run and scored."""
    group = parser.add_argument_group("trial")
    group.add_argument("--duration", dest="duration_s", metavar="S", type=trial_duration, help="default 5")
    group.add_argument("--score", choices=("net", "path", "forward"), help="what counts as speed (default net)")


_ROBOT_KEYS = ("body", "law", "world", "gravity_m_s2", "friction", "damage")


def asked_robot(arguments: Namespace) -> dict[str, Any]:
    """Return what was asked of the robot, and no more, keyed as in RobotChoice."""
    asked = {key: value for key in _ROBOT_KEYS if (value := getattr(arguments, key)) is not None}
    if arguments.robot is not None:
        asked["name"] = arguments.robot
    if "damage" in asked:
        asked["damage"] = tuple(asked["damage"])
    return asked


def one_of(*kinds: str) -> Callable[[str], tuple[str, ...]]:
    """Return an argument type: one or more of ``kinds``, separated by commas."""

    def convert(text: str) -> tuple[str, ...]:
        chosen = tuple(text.split(","))
        if wrong := [kind for kind in chosen if kind not in kinds]:
            raise ArgumentTypeError(f"{wrong[0]!r} is not one of {', '.join(kinds)}")
        return tuple(kind for kind in kinds if kind in chosen)

    return convert
