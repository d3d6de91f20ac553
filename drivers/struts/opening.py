"""The links to struts: over the computer's own radio, or, where the adapter is a path, to those of a mock."""

from __future__ import annotations

from collections.abc import Sequence

from vvvaltr.controller.core.errors import UserError
from vvvaltr.drivers.links.gatt import GattLink, Wanted
from vvvaltr.drivers.struts.table import StrutsLineTable


def wanted_of(table: StrutsLineTable) -> tuple[Wanted, ...]:
    """Return what is to be found for a line."""
    return tuple(Wanted(motor.strut, motor.characteristic) for motor in table.motor)


def open_links(adapter: str, wanted: Sequence[Wanted], reports: bool) -> GattLink:
    """Find all struts and connect to them together.

    Args:
        adapter: name of the adapter; empty for the first one; a path for a mock's socket.
        wanted: the struts.
        reports: whether they send anything.

    Raises:
        UserError: bleak is not installed.
        DeviceError: there is no Bluetooth; a strut is not there, there twice, or does not let itself be connected.
    """
    if "/" in adapter:
        from vvvaltr.drivers.links.air import AirLink

        return AirLink(adapter, wanted)
    _require_bleak()
    from vvvaltr.drivers.links.bluetooth import BluetoothLink

    return BluetoothLink(adapter, wanted, reports)


def scan(timeout_s: float = 5.0, adapter: str = "") -> list[tuple[str, str]]:
    """Return name and address of what is in the air with a name, by name. Raises as ``open_links`` does."""
    if "/" in adapter:
        from vvvaltr.drivers.links.air import scan_air

        seen = scan_air(adapter)
    else:
        _require_bleak()
        from vvvaltr.drivers.links.bluetooth import scan_bluetooth

        seen = scan_bluetooth(adapter, timeout_s)
    return sorted((name, address) for address, name in seen.items() if name)


def _require_bleak() -> None:
    try:
        import bleak  # noqa: F401
    except ModuleNotFoundError:
        raise UserError("radio struts need a Bluetooth library; run: pip install 'vvvaltr[ble]'") from None
