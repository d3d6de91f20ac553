"""`vvvaltr check`: whether a robot is fit to learn, and if not, what to do about it."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import add_robot_file_arguments, chosen_robot_file
from vvvaltr.controller.cli.telling import say

if TYPE_CHECKING:
    from vvvaltr.controller.robot.commissioning.finding import Finding


def _execute(arguments: Namespace) -> Answer:
    path = chosen_robot_file(arguments, "check", "tests the links, motors, watchdogs and tracker of a real robot")
    return _list_ports() if path is None else _check(path, arguments)


def _check(path: Path, arguments: Namespace) -> Answer:
    from dataclasses import asdict

    from vvvaltr.controller.robot.commissioning.check import check
    from vvvaltr.controller.robot.robot_file import load_robot_file

    robot = load_robot_file(path)
    say(arguments, "the motors will turn")
    findings = []
    for finding in check(robot):
        findings.append(finding)
        say(arguments, f"{_verdict(finding)}  {finding.name}: {finding.detail}")
    failed = [finding for finding in findings if not finding.passed]
    data: dict[str, Any] = {"passed": not failed, "checks": [asdict(finding) for finding in findings]}
    lines = [f"{finding.name}: {finding.cure}" for finding in findings if finding.cure]
    prose = "\n".join(lines if failed else [*lines, f"{path} is ready"])
    return Answer(prose, data, status=1 if failed else 0)


def _verdict(finding: Finding) -> str:
    if not finding.passed:
        return "FAIL"
    return "warn" if finding.cure else "pass"


def _list_ports() -> Answer:
    from vvvaltr.controller.cli.init import as_data, describe
    from vvvaltr.controller.robot.commissioning.plugged_in import look_around

    found, silence = look_around()
    lines = [describe(candidate) for candidate in found]
    for kinds, nothing in ((("serial", "slcan"), "no serial port"), (("socketcan",), "no CAN interface")):
        lines += [] if any(it.kind in kinds for it in found) else [f"{nothing} found"]
    lines += [f"struts were not looked for: {silence}"] if silence else []
    lines.append("vvvaltr init writes a robot's file for the one with your motors, then: vvvaltr check robot.toml")
    data = {
        "serial_ports": [as_data(it) for it in found if it.kind in ("serial", "slcan")],
        "can_interfaces": [it.address for it in found if it.kind == "socketcan"],
        "struts": [it.address for it in found if it.kind == "bluetooth"],
    }
    return Answer("\n".join(lines), data)


COMMAND = Subcommand(
    help="test a robot's links, motors, watchdogs and tracker; without a file, list the ports",
    example="vvvaltr check qik0.toml",
    add_arguments=add_robot_file_arguments,
    execute=_execute,
)
