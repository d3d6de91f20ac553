"""`vvvaltr track`: what a robot's tracker shows, and what it is worth."""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser, Namespace
from contextlib import closing
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import add_robot_file_arguments, chosen_robot_file, number
from vvvaltr.controller.cli.telling import can_repaint, say
from vvvaltr.controller.core.errors import NotUnderstood, TrackingLost

if TYPE_CHECKING:
    from vvvaltr.controller.core.protocols import Tracker
    from vvvaltr.controller.robot.commissioning.track import Look, Sight
    from vvvaltr.controller.robot.robot_file import RobotFile

_PURPOSE = "shows what the tracker of a real robot sees"
_LINE_S, _WINDOW_S = 0.2, 1.0


def _add_arguments(parser: ArgumentParser) -> None:
    add_robot_file_arguments(parser)
    parser.add_argument(
        "--duration",
        dest="duration_s",
        type=number(low=0.5, high=86400.0),
        default=10.0,
        metavar="S",
        help="time to look, in s; let the robot lie still (default 10)",
    )
    parser.add_argument(
        "--response",
        action="store_true",
        help="afterwards start the motors five times, and tell how long it takes until the robot is seen to move",
    )


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.robot.commissioning.track import problems
    from vvvaltr.controller.robot.robot_file import load_robot_file
    from vvvaltr.drivers.trackers.registry import open_tracker

    path = chosen_robot_file(arguments, "track", _PURPOSE)
    if path is None:
        raise NotUnderstood(f"track {_PURPOSE}: name its file, as in vvvaltr track robot.toml")
    robot = load_robot_file(path)
    with one_line_errors(), closing(open_tracker(robot.tracker)) as tracker:
        seen = _watch(tracker, arguments)
    found = problems(seen)
    if not seen.poses:
        raise TrackingLost(f"{found[0].what}; {found[0].cure}")
    response_s = _measure_response(robot, arguments) if arguments.response else math.nan
    data = _data(
        seen,
        response_s,
        [{"problem": problem.what, "cure": problem.cure, "warning": problem.is_warning} for problem in found],
    )
    prose = [_line(seen), *(f"{problem.what}: {problem.cure}" for problem in found)]
    if arguments.response:
        prose.append(f"the robot is seen to move {1000.0 * response_s:.0f} ms after a set-point")
    return Answer("\n".join(prose), data)


def _watch(tracker: Tracker, arguments: Namespace) -> Sight:
    """Look at the tracker, and show on a terminal what it saw in the last second."""
    from vvvaltr.controller.robot.commissioning.track import look, sight

    looks: list[Look] = []
    is_live = can_repaint() and not arguments.quiet
    next_line_s = -math.inf
    for seen in look(tracker, arguments.duration_s):
        looks.append(seen)
        if is_live and seen.at_s >= next_line_s:
            next_line_s = seen.at_s + _LINE_S
            recent = [past for past in looks[-2000:] if past.at_s > seen.at_s - _WINDOW_S]
            print(f"\r\033[K{_line(sight(recent, tracker))}", end="", file=sys.stderr, flush=True)
    if is_live:
        print("\r\033[K", end="", file=sys.stderr, flush=True)
    return sight(looks, tracker)


def _measure_response(robot: RobotFile, arguments: Namespace) -> float:
    from vvvaltr.controller.core.gaits import make_lively_gait
    from vvvaltr.controller.robot.commissioning.track import response_s
    from vvvaltr.controller.robot.hardware import open_hardware

    say(arguments, "the motors will turn")
    # As fast as the search drives them: slower ones may shake the robot by less than the tracker sees.
    fastest_hz = max(map(abs, robot.range_hz))
    gait = make_lively_gait([min(motor.max_hz, fastest_hz) for motor in robot.motors])
    with closing(open_hardware(robot)) as hardware:
        return response_s(hardware, gait)


def _line(seen: Sight) -> str:
    if not seen.poses:
        return seen.reason
    x_m, y_m, z_m = seen.position_m
    told = "" if math.isnan(seen.uncertainty_m) else f" (tracker says {1000.0 * seen.uncertainty_m:.2f} mm)"
    lost = f"  lost {100.0 * seen.lost_share:.1f} %" if seen.lost_share else ""
    return (
        f"x {x_m:+.3f}  y {y_m:+.3f}  z {z_m:+.3f} m  yaw {math.degrees(seen.yaw_rad):+.1f} deg  "
        f"{seen.rate_hz:.0f} Hz  gap {1000.0 * seen.longest_gap_s:.0f} ms  jitter {1000.0 * seen.jitter_s:.0f} ms  "
        f"scatter {1000.0 * seen.noise_m:.2f} mm{told}, {math.degrees(seen.noise_rad):.2f} deg{lost}"
    )


def _data(seen: Sight, response_s: float, found: list[dict[str, str | bool]]) -> dict[str, Any]:
    from dataclasses import asdict

    told = {**asdict(seen), "response_s": response_s}
    del told["doubts"], told["cure"]  # they are among the problems
    numbers = {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in told.items()}
    return {**numbers, "problems": found}


COMMAND = Subcommand(
    help="show what a robot's tracker sees: rate, gaps, jitter and scatter of its poses",
    example="vvvaltr track qik0.toml --duration 20",
    add_arguments=_add_arguments,
    execute=_execute,
)
