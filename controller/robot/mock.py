"""Mock devices, each with its port and the robot's file that fits it."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import msgspec

from vvvaltr.controller.core.document import to_toml
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.robot.robot_file import RobotFile, SearchTable
from vvvaltr.drivers.mocking.device import Device
from vvvaltr.drivers.mocking.faults import Fault
from vvvaltr.drivers.mocking.motion import Motion
from vvvaltr.drivers.mocking.plugged import PluggedDevice
from vvvaltr.drivers.mocking.port import Port, PtyPort
from vvvaltr.drivers.node.table import NodeLineTable, NodeMotorTable
from vvvaltr.drivers.odrive.table import OdriveLineTable, OdriveMotorTable
from vvvaltr.drivers.qik.table import QikLineTable, QikMotorTable
from vvvaltr.drivers.table import LineTable, TrackerTable
from vvvaltr.drivers.trackers.registry import TRACKERS, MockFeed

if TYPE_CHECKING:
    from vvvaltr.twin.presets import Preset

_MARK = "# Written by vvvaltr mock, which removes it when it ends."
_MOTORS, _MAX_HZ, _SEARCH_HZ = 3, 16.5, (4.0, 16.0)  # as far as the twins' motors go


@dataclass(frozen=True, slots=True)
class Mock:
    """A device on its port, the robot that it moves, and the file by which a controller finds them.

    Args:
        plugged: to be run, and closed after use.
        port: what a controller opens.
        robot_file: where the file is; removed by ``close``.
        tracker: where poses are sent to, as host:port.
    """

    plugged: PluggedDevice
    port: str
    robot_file: Path
    tracker: str

    def close(self) -> None:
        """Leave nothing behind."""
        self.plugged.close()
        self.robot_file.unlink(missing_ok=True)


def open_mock(
    device: str,
    link: Path,
    twin: str = "planar",
    faults: tuple[Fault, ...] = (),
    bus: tuple[str, str] | None = None,
    tracker: str = "stream",
) -> Mock:
    """Plug in a mock and write its robot's file beside ``link``.

    Args:
        device: qik, odrive or node.
        link: name of the port.
        twin: the robot that it moves, planar or spatial.
        faults: what goes wrong.
        bus: python-can's interface and channel for an odrive that is not to be on slcan.
        tracker: the kind of tracker that sees the robot.

    Raises:
        UserError: the file would overwrite one of yours, or there is no mock of this tracker.
        ValueError: the port's name is taken.
    """
    robot_file = link.with_name(f"{link.name}.toml")
    if robot_file.exists() and not robot_file.read_bytes().startswith(_MARK.encode()):
        raise UserError(f"{robot_file} is not a mock's file and would be overwritten; choose another --link")
    with ExitStack() as undo:
        port, logic, line = _odrive_on_bus(*bus) if bus else _MOCKS[device](link)
        undo.callback(port.close)
        feed = _make_feed(tracker)
        undo.callback(feed.feed.close)
        motion = Motion(_twin(twin).make(), feed.feed)
        undo.callback(motion.close)
        mock = Mock(PluggedDevice(logic, port, motion, faults), port.name, robot_file, feed.address)
        undo.callback(robot_file.unlink, missing_ok=True)
        robot_file.write_text(f"{_MARK}\n\n{_robot_file(twin, line, feed.table)}", encoding="utf-8")
        undo.pop_all()
    return mock


def _make_feed(tracker: str) -> MockFeed:
    make_feed = TRACKERS.named(tracker).make_feed
    if make_feed is None:
        raise UserError(f"there is no mock of the tracker {tracker!r}; choose another --tracker")
    return make_feed()


def _qik(link: Path) -> tuple[Port, Device, LineTable]:
    from vvvaltr.drivers.qik.mock import CURVE, QikDevice

    places: tuple[tuple[int, Literal[0, 1]], ...] = ((0, 0), (0, 1), (1, 0))
    motors = tuple(
        QikMotorTable(board=board, output=output, max_hz=CURVE.highest_hz, curve=CURVE.points)
        for board, output in places
    )
    return PtyPort(link, is_paced=True), QikDevice(places), QikLineTable(port=str(link), motor=motors)


def _odrive(link: Path) -> tuple[Port, Device, LineTable]:
    from vvvaltr.drivers.mocking.can_adapter import SlcanAdapter
    from vvvaltr.drivers.odrive.mock import OdriveDevice

    # A USB adapter's line is as fast as USB, whatever its baud rate.
    return PtyPort(link, is_paced=False), SlcanAdapter(OdriveDevice(_MOTORS)), _odrive_line("slcan", str(link))


def _odrive_on_bus(interface: str, channel: str) -> tuple[Port, Device, LineTable]:
    from vvvaltr.drivers.mocking.can_adapter import BusPort, SlcanAdapter
    from vvvaltr.drivers.odrive.mock import OdriveDevice

    line = _odrive_line(interface, channel)
    return BusPort(interface, channel, line.bitrate), SlcanAdapter(OdriveDevice(_MOTORS), is_open=True), line


def _odrive_line(interface: str, channel: str) -> OdriveLineTable:
    motors = tuple(OdriveMotorTable(node=node, max_hz=_MAX_HZ) for node in range(_MOTORS))
    return OdriveLineTable(interface=interface, channel=channel, motor=motors)


def _node(link: Path) -> tuple[Port, Device, LineTable]:
    from vvvaltr.drivers.node.mock import NodeDevice

    device = NodeDevice(_MOTORS, _MAX_HZ, lambda: random.getrandbits(30), time.monotonic())
    line = NodeLineTable(port=str(link), motor=(NodeMotorTable(max_hz=_MAX_HZ),) * _MOTORS)
    return PtyPort(link, is_paced=True), device, line


_MOCKS: dict[str, Callable[[Path], tuple[Port, Device, LineTable]]] = {"qik": _qik, "odrive": _odrive, "node": _node}
DEVICES = tuple(_MOCKS)


def _twin(name: str) -> Preset:
    from vvvaltr.twin.presets import TWINS

    return TWINS[name]


def _robot_file(twin: str, line: LineTable, tracker: TrackerTable) -> str:
    robot = RobotFile(
        line=(line,),
        tracker=tracker,
        search=SearchTable(low_hz=_SEARCH_HZ[0], high_hz=_SEARCH_HZ[1]),
    )
    return to_toml({**msgspec.to_builtins(robot), "body": _twin(twin).body})
