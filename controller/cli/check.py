"""`vvvaltr check`: whether a robot is fit to learn, and if not, what to do about it."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from vvvaltr.controller.cli.answer import Answer, Command


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "--robot", type=Path, metavar="FILE", help="the robot's file; without it, the ports found are listed"
    )


def _execute(arguments: Namespace) -> Answer:
    return _list_ports() if arguments.robot is None else _check(arguments.robot)


def _check(path: Path) -> Answer:
    from dataclasses import asdict

    from vvvaltr.controller.robot.commissioning.check import check
    from vvvaltr.controller.robot.robot_file import load_robot_file

    robot = load_robot_file(path)
    print("the motors will turn", file=sys.stderr, flush=True)
    findings = []
    for finding in check(robot):
        findings.append(finding)
        verdict = "pass" if finding.passed else "FAIL"
        print(f"{verdict}  {finding.name}: {finding.detail}", file=sys.stderr, flush=True)
    failed = [finding for finding in findings if not finding.passed]
    data: dict[str, Any] = {"passed": not failed, "checks": [asdict(finding) for finding in findings]}
    lines = [f"{finding.name}: {finding.cure}" for finding in failed]
    prose = "\n".join(lines) if failed else f"{path} is ready"
    return Answer(prose, data, status=1 if failed else 0)


def _list_ports() -> Answer:
    from serial.tools import list_ports

    ports = [{"port": port.device, "description": port.description} for port in list_ports.comports()]
    interfaces = _can_interfaces()
    lines = [f"{port['port']}: {port['description']}" for port in ports] or ["no serial ports found"]
    lines += [f"{name}: CAN interface" for name in interfaces] or ["no CAN interfaces found"]
    lines.append("name one of them in a robot's file, and check that: vvvaltr check --robot FILE.toml")
    return Answer("\n".join(lines), {"serial_ports": ports, "can_interfaces": interfaces})


def _can_interfaces() -> list[str]:
    kind_of_can = "280"  # ARPHRD_CAN
    return sorted(
        kind.parent.name for kind in Path("/sys/class/net").glob("*/type") if kind.read_text().strip() == kind_of_can
    )


COMMAND = Command(
    help="test a robot's links, motors, watchdogs and tracker; without a file, list what is plugged in",
    example="vvvaltr check --robot qik0.toml",
    add_arguments=_add_arguments,
    execute=_execute,
)
