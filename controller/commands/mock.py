"""`vvvaltr mock`: a device to plug the controller into, with a robot that moves."""

from __future__ import annotations

import json
import os
import random
import select
import signal
import socket
import tempfile
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Literal

from controller.commands.answer import Answer, Command
from controller.interface import Robot, UserError

if TYPE_CHECKING:
    from controller.config import LineTable
    from drivers.mock.device import Device
    from drivers.mock.faults import Fault
    from drivers.mock.plugged import PluggedDevice
    from drivers.mock.port import Port

_MARK = "# Written by vvvaltr mock, which removes it when it ends."
_STATUS_S = 0.05
_STDIN, _STDOUT = 0, 1
_HOST = "127.0.0.1"
_MOTORS, _MAX_HZ, _SEARCH_HZ = 3, 16.5, (4.0, 16.0)  # as far as the twins' motors go


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("device", choices=("qik", "odrive", "node"), help="what to be")
    parser.add_argument("--robot", choices=("planar", "spatial"), default="planar", help="the twin that it moves")
    parser.add_argument("--link", type=Path, metavar="PATH", help="name of the port (default: in a new directory)")
    parser.add_argument(
        "--faults",
        metavar="FILE",
        help="what goes wrong, and when: TOML or JSON; - for one JSON object a line, as it comes",
    )
    group = parser.add_argument_group("odrive on a CAN bus instead of slcan")
    group.add_argument("--interface", help="as python-can names it: socketcan, udp_multicast")
    group.add_argument("--channel", help="as python-can names it: vcan0")


def _execute(arguments: Namespace) -> Answer | None:
    from controller.assembly import one_line_errors
    from controller.document import load_document
    from drivers.mock.faults import FaultScript
    from drivers.mock.motion import Motion
    from drivers.mock.plugged import PluggedDevice
    from drivers.trackers.stream import PoseSender

    takes_faults = arguments.faults == "-"
    script = load_document(Path(arguments.faults), FaultScript) if arguments.faults and not takes_faults else None
    is_over = _EndingSignal()
    with ExitStack() as leaving:
        link = (arguments.link or Path(leaving.enter_context(tempfile.TemporaryDirectory()), "port")).absolute()
        robot_file = link.with_name(f"{link.name}.toml")
        _refuse_overwriting(robot_file)
        tracker_port = _free_udp_port()
        motion = Motion(_twin(arguments.robot), PoseSender(_HOST, tracker_port))
        with one_line_errors():
            port, device, line = _MOCKS[arguments.device](arguments, link)
        plugged = PluggedDevice(device, port, motion, script.fault if script else ())
        leaving.callback(plugged.close)
        leaving.callback(robot_file.unlink, missing_ok=True)
        robot_file.write_text(_robot_file(arguments.robot, line, tracker_port), encoding="utf-8")
        with suppress(BrokenPipeError):  # nobody reads on: whoever started the mock has ended
            _say({"port": port.name, "robot_file": str(robot_file), "tracker": f"{_HOST}:{tracker_port}"})
            _run(plugged, is_over, takes_faults)
    return None


def _run(plugged: PluggedDevice, is_over: Callable[[], bool], takes_faults: bool) -> None:
    """Run until the end, and say 20 times a second what the device does."""
    status = _Status(plugged)
    faults = _FaultLines() if takes_faults else None

    def each_time(now_s: float) -> bool:
        status.report(now_s)
        for fault in faults.read() if faults else ():
            plugged.befall(fault)
        return is_over()

    plugged.run(each_time)


def _qik(arguments: Namespace, link: Path) -> tuple[Port, Device, LineTable]:
    from controller.config import QikLineTable, QikMotorTable
    from drivers.mock.port import PtyPort
    from drivers.mock.qik import CURVE, QikDevice

    places: tuple[tuple[int, Literal[0, 1]], ...] = ((0, 0), (0, 1), (1, 0))
    motors = tuple(
        QikMotorTable(board=board, output=output, max_hz=CURVE.highest_hz, curve=CURVE.points)
        for board, output in places
    )
    return PtyPort(link, is_paced=True), QikDevice(places), QikLineTable(port=str(link), motor=motors)


def _odrive(arguments: Namespace, link: Path) -> tuple[Port, Device, LineTable]:
    from controller.config import OdriveLineTable, OdriveMotorTable
    from drivers.mock.can_adapter import BusPort, SlcanAdapter
    from drivers.mock.odrive import OdriveDevice
    from drivers.mock.port import PtyPort

    is_on_bus = arguments.interface is not None
    adapter = SlcanAdapter(OdriveDevice(_MOTORS), is_open=is_on_bus)
    line = OdriveLineTable(
        interface=arguments.interface or "slcan",
        channel=arguments.channel or str(link),
        motor=tuple(OdriveMotorTable(node=node, max_hz=_MAX_HZ) for node in range(_MOTORS)),
    )
    port: Port = BusPort(line.interface, line.channel, line.bitrate) if is_on_bus else PtyPort(link, is_paced=False)
    return port, adapter, line


def _node(arguments: Namespace, link: Path) -> tuple[Port, Device, LineTable]:
    from controller.config import NodeLineTable, NodeMotorTable
    from drivers.mock.node import NodeDevice
    from drivers.mock.port import PtyPort

    device = NodeDevice(_MOTORS, _MAX_HZ, lambda: random.getrandbits(32), time.monotonic())
    line = NodeLineTable(port=str(link), motor=(NodeMotorTable(max_hz=_MAX_HZ),) * _MOTORS)
    return PtyPort(link, is_paced=True), device, line


_MOCKS: dict[str, Callable[[Namespace, Path], tuple[Port, Device, LineTable]]] = {
    "qik": _qik,
    "odrive": _odrive,
    "node": _node,
}


def _twin(name: str) -> Robot:
    from controller.assembly import TWINS
    from twin import robot

    twin: Robot = getattr(robot, f"{name}_robot")(body=TWINS[name])
    return twin


def _robot_file(twin: str, line: LineTable, tracker_port: int) -> str:
    import msgspec

    from controller.assembly import TWINS
    from controller.config import RobotFile, SearchTable, StreamTable
    from controller.document import to_toml

    robot = RobotFile(
        line=(line,),
        tracker=StreamTable(host=_HOST, port=tracker_port),
        body=TWINS[twin],
        search=SearchTable(low_hz=_SEARCH_HZ[0], high_hz=_SEARCH_HZ[1]),
    )
    return f"{_MARK}\n\n{to_toml(msgspec.to_builtins(robot))}"


def _refuse_overwriting(robot_file: Path) -> None:
    if robot_file.exists() and not robot_file.read_text(encoding="utf-8").startswith(_MARK):
        raise UserError(f"{robot_file} is not a mock's file and would be overwritten; choose another --link")


def _free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((_HOST, 0))
        return int(probe.getsockname()[1])


def _say(status: dict[str, Any]) -> None:
    # A reader that is behind must not hold up the device: it misses some lines.
    if select.select((), (_STDOUT,), (), 0.0)[1]:
        os.write(_STDOUT, json.dumps(status).encode() + b"\n")


class _Status:
    """Says what a device does."""

    def __init__(self, plugged: PluggedDevice) -> None:
        self._plugged = plugged
        self._next_s = time.monotonic()

    def report(self, now_s: float) -> None:
        """Say it, if that is due."""
        if now_s < self._next_s:
            return
        self._next_s = max(self._next_s + _STATUS_S, now_s)
        _say(
            {
                "t_s": round(now_s, 6),
                "applied_hz": [round(hz, 6) for hz in self._plugged.applied_hz],
                "watchdog": self._plugged.watchdog,
                "faults": list(self._plugged.faults),
            }
        )


class _FaultLines:
    """Faults from standard input, one JSON object a line."""

    def __init__(self) -> None:
        self._text = b""

    def read(self) -> list[Fault]:
        """Return what has come."""
        import msgspec

        from drivers.mock.faults import Fault

        if not select.select((_STDIN,), (), (), 0.0)[0]:
            return []
        *lines, self._text = (self._text + os.read(_STDIN, 65536)).split(b"\n")
        try:
            return [msgspec.json.decode(line, type=Fault) for line in lines if line.strip()]
        except msgspec.DecodeError as error:
            raise UserError(f"standard input: a fault is one JSON object a line: {error}") from None


class _EndingSignal:
    """Notes that the mock is to end. A flag and no exception: the device ends between two steps, and cleans up."""

    def __init__(self) -> None:
        self._has_come = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._come)

    def __call__(self) -> bool:
        return self._has_come

    def _come(self, number: int, frame: FrameType | None) -> None:
        self._has_come = True


COMMAND = Command(
    help="be a device to plug the controller into, with a robot that moves",
    example="vvvaltr mock qik --robot planar --link qik0",
    add_arguments=_add_arguments,
    execute=_execute,
)
