"""ODrive axes on a CAN bus, by the CANSimple protocol."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.drivers.odrive.table import OdriveLineTable
from vvvaltr.drivers.registry import Driver, MockLine

if TYPE_CHECKING:
    from vvvaltr.drivers.odrive.line import OdriveLine


def _open_line(table: OdriveLineTable) -> OdriveLine:
    from vvvaltr.drivers.odrive.line import open_line

    return open_line(table)


def _make_mock(link: Path) -> MockLine:
    from vvvaltr.drivers.odrive.mock import make_mock

    return make_mock(link)


def _make_bus_mock(interface: str, channel: str) -> MockLine:
    from vvvaltr.drivers.odrive.mock import make_bus_mock

    return make_bus_mock(interface, channel)


def _make_fast_mock(link: Path, max_hz: float) -> MockLine:
    from vvvaltr.drivers.odrive.mock import make_mock

    return make_mock(link, max_hz)


DRIVER = Driver(OdriveLineTable, _open_line, _make_mock, _make_bus_mock, _make_fast_mock)
