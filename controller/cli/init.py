"""`vvvaltr init`: from what is plugged in to a first robot's file."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.keyboard import is_at_keyboard
from vvvaltr.controller.cli.options import whole, write_file
from vvvaltr.controller.cli.telling import ask, counted, say
from vvvaltr.controller.core.errors import DeviceError, UserError, one_line_errors

if TYPE_CHECKING:
    from vvvaltr.controller.robot.commissioning.plugged_in import Candidate


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("robot_file", nargs="?", type=Path, default=Path("robot.toml"), metavar="FILE",
                        help="the file to write (default robot.toml)")  # fmt: skip
    parser.add_argument("--driver", metavar="NAME", help="qik, odrive, node or struts (default: what is plugged in)")
    parser.add_argument("--port", metavar="NAME", help="serial port, CAN interface or Bluetooth adapter")
    parser.add_argument("--motors", type=whole(1), default=3, metavar="N", help="number of motors (default 3)")
    parser.add_argument("--tracker", default="camera", metavar="KIND",
                        help="camera, stream, qtm or natnet (default camera)")  # fmt: skip
    parser.add_argument("--no-probe", action="store_true", help="do not ask the device whether it is there")


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.robot.template import write_robot_file

    path: Path = arguments.robot_file
    if path.exists():
        raise UserError(f"{path} exists: name another file, or remove it")
    driver, port, struts = _choose(arguments)
    with one_line_errors():
        text = write_robot_file(driver, port, arguments.motors, arguments.tracker, struts)
    problem = "" if arguments.no_probe else _probe(text, path, arguments)
    write_file(path, text)
    line = f"{counted(arguments.motors, 'motor')} on {driver} {port}".rstrip()
    lines = [f"wrote      {path}: {line}, tracker {arguments.tracker}"]
    lines += [f"no answer  {problem}"] if problem else []
    lines.append(f"next       look through {path}, then: vvvaltr check {path}")
    answers = None if arguments.no_probe else not problem
    data = {"file": str(path), "driver": driver, "port": port, "answers": answers, "problem": problem}
    return Answer("\n".join(lines), data)


def _choose(arguments: Namespace) -> tuple[str, str, list[str]]:
    """Return driver, port and names of struts: what was asked for, and what is plugged in for the rest."""
    from vvvaltr.controller.robot.commissioning.plugged_in import look_around

    if arguments.driver and arguments.port is not None:
        return arguments.driver, arguments.port, []
    found, _ = look_around(with_bluetooth=arguments.driver in (None, "struts"))
    for candidate in found:
        say(arguments, describe(candidate))
    likely = [
        it
        for it in found
        if (it.driver == arguments.driver if arguments.driver else it.driver) and arguments.port in (None, it.address)
    ]
    struts = [it.address for it in likely if it.driver == "struts"]
    if struts and len(struts) == len(likely):
        return "struts", "", struts
    if len(likely) != 1:
        likely = [_ask(likely)]
    return likely[0].driver, likely[0].address, []


def _ask(likely: list[Candidate]) -> Candidate:
    """Return which of several the person means. Raises UserError where there is nothing to choose, or nobody to ask."""
    if not likely:
        raise UserError("no device was found that motors hang on: plug it in, or name it by --driver and --port")
    if not is_at_keyboard():
        names = ", ".join(f"--driver {it.driver} --port {it.address}" for it in likely)
        raise UserError(f"several devices may be meant; choose one: {names}")
    while True:
        answer = ask(f"which one drives the motors (1 to {len(likely)})? ")
        if answer.isdecimal() and 1 <= int(answer) <= len(likely):
            return likely[int(answer) - 1]


def _probe(text: str, path: Path, arguments: Namespace) -> str:
    """Open the line as ``learn`` would, with all motors at rest; return what went wrong, or nothing."""
    import tomllib

    from vvvaltr.controller.robot.robot_file import robot_file_from
    from vvvaltr.drivers.registry import open_line

    (line,) = robot_file_from(tomllib.loads(text), str(path)).line
    say(arguments, "asking the device; no motor turns")
    try:
        opened = open_line(line)
    except (DeviceError, UserError) as error:
        return str(error)
    opened.rest()
    opened.close()
    return ""


def describe(candidate: Candidate) -> str:
    """Return a device in one line."""
    return f"{candidate.address}: {candidate.what}" + (f" (driver {candidate.driver})" if candidate.driver else "")


def as_data(candidate: Candidate) -> dict[str, str]:
    """Return a device for programs."""
    return {"port": candidate.address, "description": candidate.what, "driver": candidate.driver}


COMMAND = Subcommand(
    help="write a first robot's file from what is plugged in",
    example="vvvaltr init robot.toml --tracker camera",
    add_arguments=_add_arguments,
    execute=_execute,
)
