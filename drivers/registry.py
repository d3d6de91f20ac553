"""The motor devices by name: one row each.

A device is a folder beside ``qik/``: ``table.py``, ``line.py``, ``protocol.py``, ``mock.py``, and the row in
``__init__.py``, ``DRIVER = Driver(table=..., open_line=..., make_mock=...)``. The row may import ``table.py``; whatever
is slow is imported within the functions. Then the name is added to ``DRIVERS``; a package of its own adds itself by an
entry point of the group ``vvvaltr.drivers`` instead. docs/hardware.md shows how to write one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from vvvaltr.controller.core.plug_ins import Registry
from vvvaltr.controller.core.signals import interrupt_on_suspension
from vvvaltr.drivers.table import LineTable

if TYPE_CHECKING:
    from vvvaltr.drivers.mocking.device import Device
    from vvvaltr.drivers.mocking.port import Port
    from vvvaltr.drivers.motor_line import MotorLine

TableT = TypeVar("TableT", bound=LineTable)


@dataclass(frozen=True, slots=True)
class MockLine:
    """A mock device on its port.

    Args:
        port: where a controller is plugged in; to be closed after use.
        device: the device's logic.
        table: what stands under ``[[line]]`` in the robot's file for a controller that opens ``port``.
    """

    port: Port
    device: Device
    table: LineTable


@dataclass(frozen=True, slots=True)
class Driver(Generic[TableT]):
    """A kind of motor device.

    Args:
        table: the type of its table in a robot's file.
        open_line: opens the line of a table, finds the device, arms its watchdog and clears old faults. Raises
            DeviceError where that fails, UserError for a motor that must be calibrated first.
        make_mock: plugs in a mock device under a port of this name; None where there is none.
        make_bus_mock: the same on a CAN bus, by python-can's interface and channel.
        make_fast_mock: the same as ``make_mock``, with motors that reach so many Hz; None where they cannot.
        make_firmware_mock: the same with one of ``firmwares``.
        firmwares: names of the firmwares that a mock can play.
    """

    table: type[TableT]
    open_line: Callable[[TableT], MotorLine]
    make_mock: Callable[[Path], MockLine] | None = None
    make_bus_mock: Callable[[str, str], MockLine] | None = None
    make_fast_mock: Callable[[Path, float], MockLine] | None = None
    make_firmware_mock: Callable[[Path, str], MockLine] | None = None
    firmwares: tuple[str, ...] = ()


DRIVERS: Registry[Driver[Any]] = Registry(
    noun="driver",
    group="vvvaltr.drivers",
    kind=Driver,
    built_in=MappingProxyType(
        {
            "qik": "vvvaltr.drivers.qik:DRIVER",
            "odrive": "vvvaltr.drivers.odrive:DRIVER",
            "node": "vvvaltr.drivers.node:DRIVER",
            "struts": "vvvaltr.drivers.struts:DRIVER",
        }
    ),
)


def open_line(table: LineTable) -> MotorLine:
    """Open the line of a table. Raises as ``Driver.open_line`` does."""
    interrupt_on_suspension()
    return DRIVERS.named(str(table.__struct_config__.tag)).open_line(table)
