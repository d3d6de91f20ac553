"""`vvvaltr calibrate`: the command -> Hz curve of each motor, kept in the robot's file."""

from __future__ import annotations

import json
import math
import sys
import tomllib
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.controller.cli.answer import Answer, Command
from vvvaltr.controller.cli.options import number, whole
from vvvaltr.controller.core.errors import UserError

if TYPE_CHECKING:
    from vvvaltr.controller.robot.commissioning.calibrate import Reading
    from vvvaltr.controller.robot.robot_file import RobotFile

_QUESTION = "frequency in Hz (empty if the motor did not turn): "
_TIMES_ASKED = 3
_GREATEST_HZ = 1000.0  # no vibration motor is near it; what is above was mistyped


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--robot", type=Path, required=True, metavar="FILE", help="the robot's file")
    parser.add_argument("--points", type=whole(2), default=6, metavar="N", help="commands per motor (default 6)")
    parser.add_argument("--seconds", type=number(low=0.5), default=3.0, metavar="S", help="for each (default 3)")
    parser.add_argument("--ask", action="store_true", help="ask for each frequency, measured by other means")


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.robot.commissioning.calibrate import fitted, with_curves
    from vvvaltr.controller.robot.robot_file import load_robot_file

    robot_file = load_robot_file(arguments.robot)
    seen = _measure(robot_file, arguments)
    curves = [
        fitted([reading for reading in seen if reading.motor == motor], table.curve)
        for motor, table in enumerate(robot_file.motors)
    ]
    _keep(arguments.robot, with_curves(robot_file, curves))
    prose = [
        f"motor {motor}: " + ", ".join(f"{command:g} -> {hz:.2f} Hz" for command, hz in curve)
        for motor, curve in enumerate(curves, start=1)
    ]
    data = {"robot": str(arguments.robot), "curves": curves}
    return Answer("\n".join([*prose, f"kept in {arguments.robot}"]), data)


def _measure(robot_file: RobotFile, arguments: Namespace) -> list[Reading]:
    from tqdm import tqdm

    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.robot.commissioning.calibrate import readings, without_curves
    from vvvaltr.controller.robot.hardware import open_hardware

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
    """Ask on standard error, for standard output is the answer's, and ask again for what is no frequency."""
    frequency = number(low=0.0, high=_GREATEST_HZ)
    complaint = ""  # on a line of its own, as the question: they stand below the progress bar
    for _ in range(_TIMES_ASKED):
        print(f"\n{complaint}{_QUESTION}", end="", file=sys.stderr, flush=True)
        text = sys.stdin.readline()
        if not text:
            raise UserError("--ask: the answers ended too early, nothing was kept: give one line for each question")
        try:
            return frequency(text.strip()) if text.strip() else math.nan
        except ArgumentTypeError as error:
            complaint = f"{error}\n"
    raise UserError(f"--ask: {complaint.strip()}; nothing was kept: begin again")


def _keep(path: Path, robot_file: RobotFile) -> None:
    """Write the robot's file in one step, if it can be read again. Raises UserError."""
    import msgspec

    from vvvaltr.controller.core.disk import write_whole
    from vvvaltr.controller.robot.commissioning.calibrate import rewritten
    from vvvaltr.controller.robot.robot_file import robot_file_from

    if path.suffix == ".json":
        text = json.dumps(msgspec.to_builtins(robot_file), indent=2) + "\n"
    else:
        text = rewritten(path.read_text(encoding="utf-8"), robot_file)
    try:
        robot_file_from(json.loads(text) if path.suffix == ".json" else tomllib.loads(text), str(path))
    except UserError as error:
        raise UserError(f"nothing was kept, for this was measured: {error}; measure again or edit it") from None
    write_whole(path.resolve(), text)


COMMAND = Command(
    help="measure each motor's command -> Hz curve, and keep it in the robot's file",
    example="vvvaltr calibrate --robot qik0.toml",
    add_arguments=_add_arguments,
    execute=_execute,
)
