"""Struts on the air: boards with one motor each, over Bluetooth Low Energy."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.drivers.registry import Driver, MockLine
from vvvaltr.drivers.struts.table import StrutsLineTable

if TYPE_CHECKING:
    from vvvaltr.drivers.motor_line import MotorLine


def scan(timeout_s: float = 5.0, adapter: str = "") -> list[tuple[str, str]]:
    """Return name and address of every Bluetooth LE device with a name that is in the air, by name.

    Args:
        timeout_s: how long to listen.
        adapter: name of the Bluetooth adapter; empty for the first one; a path for the socket of a mock.

    Raises:
        UserError: the extra ``ble`` is not installed.
        DeviceError: there is no Bluetooth, or it may not be used.
    """
    from vvvaltr.drivers.struts.opening import scan

    return scan(timeout_s, adapter)


def _open_line(table: StrutsLineTable) -> MotorLine:
    from vvvaltr.drivers.struts.line import open_line

    return open_line(table)


def _make_mock(link: Path) -> MockLine:
    from vvvaltr.drivers.struts.mock import make_mock

    return make_mock(link)


def _make_firmware_mock(link: Path, firmware: str) -> MockLine:
    from vvvaltr.drivers.struts.mock import make_mock

    return make_mock(link, firmware)


DRIVER = Driver(
    table=StrutsLineTable,
    open_line=_open_line,
    make_mock=_make_mock,
    make_firmware_mock=_make_firmware_mock,
    firmwares=("vvvaltr", "laboratory", "laboratory-pwm", "rfduino"),
)
