"""Mock devices, each with its port, its moving twin and the matching robot's file."""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from vvvaltr.controller.core.disk import read_text, write_whole
from vvvaltr.controller.core.document import to_toml
from vvvaltr.controller.core.errors import NotUnderstood, UserError
from vvvaltr.controller.core.spelling import unknown
from vvvaltr.controller.robot.robot_file import HandTable, RobotFile, SearchTable
from vvvaltr.drivers.mocking.faults import Fault
from vvvaltr.drivers.mocking.hand import MockHand
from vvvaltr.drivers.mocking.moving_twin import POSE_RATE_HZ, MovingTwin
from vvvaltr.drivers.mocking.plugged import PluggedDevice
from vvvaltr.drivers.registry import DRIVERS, MockLine
from vvvaltr.drivers.table import LineTable, TrackerTable
from vvvaltr.drivers.trackers.registry import TRACKERS, MockFeed

if TYPE_CHECKING:
    from vvvaltr.twin.presets import Preset

DEVICES = tuple(DRIVERS.built_in)
_MARK = "# Written by vvvaltr mock, which removes it when it ends."
_PROCESS = "# Process "  # that wrote it, on the second line
_SEARCH_HZ = (4.0, 16.0)  # as far as the planar twin's motors go


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
        """Remove the port and the robot's file."""
        self.plugged.close()
        self.robot_file.unlink(missing_ok=True)


def open_mock(
    device: str,
    link: Path,
    twin: str = "planar",
    faults: tuple[Fault, ...] = (),
    bus: tuple[str, str] | None = None,
    tracker: str = "stream",
    max_hz: float | None = None,
    firmware: str = "",
    pose_rate_hz: float = POSE_RATE_HZ,
) -> Mock:
    """Plug in a mock and write its robot's file beside ``link``.

    Args:
        device: name of a driver.
        link: name of the port.
        twin: the robot that it moves, planar or spatial.
        faults: what goes wrong.
        bus: python-can's interface and channel, for a device on a CAN bus instead of under ``link``.
        tracker: the kind of tracker that sees the robot.
        max_hz: what the motors reach; None for the mock's usual 16.5 Hz.
        firmware: what the device runs, where there is a choice; empty for the usual one.
        pose_rate_hz: how often the tracker is shown the robot; one with pictures has a rate of its own.

    Raises:
        UserError: the file would overwrite one of yours, or there is no such mock.
        ValueError: the port's name is taken.
    """
    from vvvaltr.twin.engine import Start

    robot_file = link.with_name(f"{link.name}.toml")
    if robot_file.exists() and not _is_mocks(robot_file):
        raise UserError(f"{robot_file} is not a mock's file and would be overwritten; choose another --link")
    _remove_leftover(link, robot_file)
    with ExitStack() as undo:
        line = _make_line(device, link, bus, max_hz, firmware)
        undo.callback(line.port.close)
        feed = _make_feed(tracker)
        undo.callback(feed.feed.close)
        moved = _twin(twin).make()
        hand = MockHand(lambda x_m, y_m, yaw_rad: moved.put_down(Start(x_m, y_m, yaw_rad)))
        motion = MovingTwin(moved, feed.feed, hand, pose_rate_hz)
        undo.callback(motion.close)
        mock = Mock(PluggedDevice(line.device, line.port, motion, faults), line.port.name, robot_file, feed.address)
        undo.callback(robot_file.unlink, missing_ok=True)
        head = f"{_MARK}\n{_PROCESS}{os.getpid()}\n\n"
        high_hz = max_hz or min(_SEARCH_HZ[1], *(motor.max_hz for motor in line.table.motor))
        content = _robot_file(twin, line.table, feed.table, high_hz, hand.port)
        write_whole(robot_file, head + content)
        undo.pop_all()
    return mock


def _is_mocks(robot_file: Path) -> bool:
    try:
        return read_text(robot_file).startswith(_MARK)
    except (OSError, UnicodeDecodeError):
        return False


def _remove_leftover(link: Path, robot_file: Path) -> None:
    """Remove the link of a mock that was killed: by now its pseudo-terminal may be another program's."""
    if not (link.is_symlink() and robot_file.exists()):
        return
    _, _, process = read_text(robot_file).partition(f"\n{_PROCESS}")
    number = process.partition("\n")[0]
    if number.isdecimal() and not Path("/proc", number).exists():
        link.unlink()


def _make_line(device: str, link: Path, bus: tuple[str, str] | None, max_hz: float | None, firmware: str) -> MockLine:
    driver = DRIVERS.named(device)
    if max_hz is not None:
        if driver.make_fast_mock is None or bus is not None:
            raise NotUnderstood(f"the motors of this mock {device} end where they do: leave out --max-hz")
        return driver.make_fast_mock(link, max_hz)
    if firmware:
        if driver.make_firmware_mock is None:
            raise NotUnderstood(f"the mock {device} has one firmware alone: leave out --firmware")
        if firmware not in driver.firmwares:
            raise NotUnderstood(unknown("firmware", firmware, driver.firmwares))
        return driver.make_firmware_mock(link, firmware)
    if bus is not None:
        if driver.make_bus_mock is None:
            raise NotUnderstood(f"the mock {device} has no CAN bus: leave out --interface and --channel")
        return driver.make_bus_mock(*bus)
    if driver.make_mock is None:
        raise UserError(f"the driver {device!r} has no mock; choose one of {', '.join(DEVICES)}")
    return driver.make_mock(link)


def _make_feed(tracker: str) -> MockFeed:
    make_feed = TRACKERS.named(tracker).make_feed
    if make_feed is None:
        raise UserError(f"there is no mock of the tracker {tracker!r}; choose another --tracker")
    return make_feed()


def _twin(name: str) -> Preset:
    from vvvaltr.twin.presets import TWINS

    return TWINS[name]


def _robot_file(twin: str, line: LineTable, tracker: TrackerTable, high_hz: float, hand_port: int) -> str:
    robot = RobotFile(
        line=(line,),
        tracker=tracker,
        hand=HandTable(udp_port=hand_port),
        search=SearchTable(low_hz=_SEARCH_HZ[0], high_hz=high_hz),
    )
    return to_toml({**msgspec.to_builtins(robot), "body": _twin(twin).body})
