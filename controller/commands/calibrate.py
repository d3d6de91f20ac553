"""`vvvaltr calibrate`: the command -> Hz curve of each motor, kept in the robot's file."""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser, Namespace
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from controller.commands.answer import Answer, Command
from controller.commands.options import number, whole
from controller.interface import UserError

if TYPE_CHECKING:
    from controller.calibrate import Reading
    from controller.config import RobotFile


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--robot", type=Path, required=True, metavar="FILE", help="the robot's file")
    parser.add_argument("--points", type=whole(2), default=6, metavar="N", help="commands per motor (default 6)")
    parser.add_argument("--seconds", type=number(low=0.5), default=3.0, metavar="S", help="for each (default 3)")
    parser.add_argument("--ask", action="store_true", help="ask for each frequency, measured by other means")


def _execute(arguments: Namespace) -> Answer:
    from controller.calibrate import fitted, rewritten, with_curves
    from controller.config import load_robot_file

    robot_file = load_robot_file(arguments.robot)
    seen = _measure(robot_file, arguments)
    curves = [
        fitted([reading for reading in seen if reading.motor == motor], table.curve)
        for motor, table in enumerate(robot_file.motors)
    ]
    text = arguments.robot.read_text(encoding="utf-8")
    arguments.robot.write_text(rewritten(text, with_curves(robot_file, curves)), encoding="utf-8")
    prose = [
        f"motor {motor}: " + ", ".join(f"{command:g} -> {hz:.2f} Hz" for command, hz in curve)
        for motor, curve in enumerate(curves, start=1)
    ]
    data = {"robot": str(arguments.robot), "curves": curves}
    return Answer("\n".join([*prose, f"kept in {arguments.robot}"]), data)


def _measure(robot_file: RobotFile, arguments: Namespace) -> list[Reading]:
    from tqdm import tqdm

    from controller.assembly import one_line_errors
    from controller.calibrate import readings, without_curves
    from controller.hardware import open_hardware

    bare = without_curves(robot_file)
    greatest = bare.limits.max_hz
    print("the motors will turn, one after the other, up to full speed", file=sys.stderr, flush=True)
    with one_line_errors(), closing(open_hardware(bare)) as robot:
        ask = _asked_hz if arguments.ask else None
        run = readings(robot, greatest, arguments.points, arguments.seconds, ask)
        return list(
            tqdm(run, total=len(greatest) * arguments.points, desc="calibrating", unit="point", file=sys.stderr)
        )


def _asked_hz() -> float:
    text = input("frequency in Hz (empty if the motor did not turn): ").strip()
    try:
        return float(text) if text else math.nan
    except ValueError:
        raise UserError(f"{text!r} is not a number; nothing was kept") from None


COMMAND = Command(
    help="measure each motor's command -> Hz curve, and keep it in the robot's file",
    example="vvvaltr calibrate --robot qik0.toml",
    add_arguments=_add_arguments,
    execute=_execute,
)
