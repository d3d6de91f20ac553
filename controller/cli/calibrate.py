"""`vvvaltr calibrate`: the curve from command to Hz of each motor, saved in the robot's file."""

from __future__ import annotations

import json
import math
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import add_robot_file_arguments, chosen_robot_file, number, whole
from vvvaltr.controller.cli.telling import bar, say
from vvvaltr.controller.core.errors import NotUnderstood, UserError

if TYPE_CHECKING:
    from vvvaltr.controller.robot.commissioning.calibrate import Reach, Reading
    from vvvaltr.controller.robot.robot_file import RobotFile

_QUESTION = "frequency in Hz (empty if the motor did not turn): "
_PURPOSE = "measures the motors of a real robot"
_TIMES_ASKED = 3
_GREATEST_HZ = 1000.0  # no vibration motor comes near it: a greater reply was mistyped


def _add_arguments(parser: ArgumentParser) -> None:
    add_robot_file_arguments(parser)
    parser.add_argument(
        "--points", type=whole(2), default=6, metavar="N", help="number of commands to measure per motor (default 6)"
    )
    parser.add_argument(
        "--seconds",
        type=number(low=0.5),
        default=3.0,
        metavar="S",
        help="time for each command, in s (default 3)",
    )
    parser.add_argument(
        "--ask", action="store_true", help="ask you for each frequency, measured with a stroboscope or a microphone"
    )


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.robot.commissioning.calibrate import fit_curve, replace_curves
    from vvvaltr.controller.robot.robot_file import load_robot_file

    path = chosen_robot_file(arguments, "calibrate", _PURPOSE)
    if path is None:
        raise NotUnderstood(f"calibrate {_PURPOSE}: name its file, as in vvvaltr calibrate robot.toml")
    robot_file = load_robot_file(path)
    reach, seen = _measure(robot_file, arguments)
    curves = [
        fit_curve([reading for reading in seen if reading.motor == motor], table.curve)
        for motor, table in enumerate(robot_file.motors)
    ]
    _keep(path, replace_curves(robot_file, curves, reach.limit_hz))
    prose = [
        f"motor {motor}: " + ", ".join(f"{command:g} -> {hz:.2f} Hz" for command, hz in curve)
        for motor, curve in enumerate(curves, start=1)
    ]
    limit = reach.explain(robot_file)
    data = {"robot": str(path), "curves": curves, "limit_hz": reach.limit_hz if limit else None}
    return Answer("\n".join([*prose, *filter(None, [limit]), f"saved in {path}"]), data)


def _measure(robot_file: RobotFile, arguments: Namespace) -> tuple[Reach, list[Reading]]:
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.robot.commissioning.calibrate import Reach, find_reach, measure_motors, remove_curves
    from vvvaltr.controller.robot.hardware import open_hardware

    bare = remove_curves(robot_file)
    say(arguments, "the motors will turn, one after the other, up to full speed")
    with one_line_errors(), closing(open_hardware(bare)) as robot:
        reach = Reach() if arguments.ask else find_reach(robot)
        greatest = reach.greatest_commands(robot_file)
        if limit := reach.explain(robot_file):
            say(arguments, limit)
        ask = _asked_hz if arguments.ask else None
        look_s = max(arguments.seconds, reach.look_s)
        run = measure_motors(robot, greatest, arguments.points, look_s, reach, ask)
        points = len(greatest) * arguments.points
        return reach, list(bar(arguments, run, total=points, desc="calibrating", unit="point"))


def _asked_hz() -> float:
    """Ask on standard error, because the answer goes to standard output; ask again if the reply is not a frequency."""
    frequency = number(low=0.0, high=_GREATEST_HZ)
    complaint = ""  # on a line of its own, like the question: both stand below the progress bar
    for _ in range(_TIMES_ASKED):
        print(f"\n{complaint}{_QUESTION}", end="", file=sys.stderr, flush=True)
        text = sys.stdin.readline()
        if not text:
            raise UserError("--ask: the replies ended too early, nothing was saved: give one line for each question")
        try:
            return frequency(text.strip()) if text.strip() else math.nan
        except ArgumentTypeError as error:
            complaint = f"{error}\n"
    raise UserError(f"--ask: {complaint.strip()}; nothing was saved: start again")


def _keep(path: Path, robot_file: RobotFile) -> None:
    """Write the robot's file in one step, if it can be read again. Raises UserError."""
    import msgspec

    from vvvaltr.controller.core.disk import read_text, write_whole
    from vvvaltr.controller.core.document import parse_toml
    from vvvaltr.controller.robot.commissioning.calibrate import rewrite_robot_file
    from vvvaltr.controller.robot.robot_file import robot_file_from

    if path.suffix == ".json":
        text = json.dumps(msgspec.to_builtins(robot_file), indent=2) + "\n"
    else:
        text = rewrite_robot_file(read_text(path), robot_file)
    try:
        robot_file_from(json.loads(text) if path.suffix == ".json" else parse_toml(text), str(path))
    except UserError as error:
        raise UserError(f"nothing was saved: the curve does not fit the file: {error}; measure again") from None
    write_whole(path.resolve(), text)


COMMAND = Subcommand(
    help="measure each motor's curve from command to Hz, and save it in the robot's file",
    example="vvvaltr calibrate qik0.toml",
    add_arguments=_add_arguments,
    execute=_execute,
)
