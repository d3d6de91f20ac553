"""What is plugged into this computer, with a guess of the driver for each: nothing is opened and nothing is sent."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from vvvaltr.controller.core.errors import DeviceError, UserError

_BY_ID = Path("/dev/serial/by-id")
_NETWORK = Path("/sys/class/net")
_KIND_OF_CAN = "280"  # ARPHRD_CAN
_SCAN_S = 3.0

# Vendor and product as USB numbers them; (driver, what it is). A driver of "" is none of ours.
_USB: dict[tuple[int, int | None], tuple[str, str]] = {
    (0x0403, None): ("qik", "FTDI serial adapter: qik boards, or a motor node?"),
    (0x2E8A, None): ("", "console of a Pico: a motor node answers on its pins, at an adapter or /dev/serial0"),
    (0x1209, 0x0D32): ("", "ODrive on USB: wire its CAN bus, which vvvaltr drives it over"),
    (0x1D50, 0x60C4): ("odrive", "CAN adapter (slcan): ODrive axes?"),
    (0x16D0, 0x117E): ("odrive", "CANable adapter (slcan): ODrive axes?"),
    (0x1D50, 0x606F): ("odrive", "CAN adapter (gs_usb): ODrive axes?"),
    (0x10C4, None): ("", "CP210x serial adapter: qik boards, or a board of its own?"),
    (0x1A86, None): ("", "CH340 serial adapter: qik boards, or a board of its own?"),
}


class SerialPort(Protocol):
    """A port as pyserial lists it."""

    @property
    def device(self) -> str:
        """Its name below /dev."""
        ...

    @property
    def description(self) -> str:
        """What it says that it is."""
        ...

    @property
    def vid(self) -> int | None:
        """USB number of the vendor."""
        ...

    @property
    def pid(self) -> int | None:
        """USB number of the product."""
        ...


@dataclass(frozen=True, slots=True)
class Candidate:
    """Something that motors may hang on.

    Args:
        address: what a robot's file names it by: a port, a CAN interface, a strut.
        driver: the likely driver; empty where nothing tells.
        what: what it is, in words.
        kind: serial, slcan, socketcan or bluetooth.
    """

    address: str
    driver: str
    what: str
    kind: str


def look_around(with_bluetooth: bool = True) -> tuple[list[Candidate], str]:
    """Return all candidates, the likely ones first, and why Bluetooth was not looked at; empty where it was."""
    from serial.tools import list_ports

    found = [*map(identify, list_ports.comports()), *find_can()]
    silence = "not looked at"
    if with_bluetooth:
        try:
            from vvvaltr.drivers.struts import scan

            found += name_struts(scan(_SCAN_S))
            silence = ""
        except (UserError, DeviceError) as error:
            silence = str(error)
    return sorted(found, key=lambda it: not it.driver), silence


def identify(port: SerialPort) -> Candidate:
    """Return what a serial port probably is, by its USB numbers and under the name that stays."""
    told = port.description if port.description != "n/a" else "serial port"
    driver, what = _USB.get((port.vid or 0, port.pid)) or _USB.get((port.vid or 0, None)) or ("", told)
    return Candidate(lasting_name(port.device), driver, what, "slcan" if driver == "odrive" else "serial")


def lasting_name(device: str, folder: Path = _BY_ID) -> str:
    """Return the name of a port below by-id, which stays when others are plugged in; the port itself if it has none."""
    target = Path(device).resolve()
    links = sorted(folder.iterdir()) if folder.is_dir() else []
    return next((str(link) for link in links if link.resolve() == target), device)


def find_can(network: Path = _NETWORK) -> list[Candidate]:
    """Return the CAN interfaces of this computer."""
    return [
        Candidate(kind.parent.name, "odrive", "CAN interface: ODrive axes?", "socketcan")
        for kind in sorted(network.glob("*/type"))
        if kind.read_text().strip() == _KIND_OF_CAN
    ]


def name_struts(devices: Iterable[tuple[str, str]]) -> list[Candidate]:
    """Return devices in the air as candidates; those that are called as the laboratory calls its struts are likely."""
    return [
        Candidate(name, "struts" if "vvvaltr" in name.lower() else "", f"Bluetooth LE at {address}", "bluetooth")
        for name, address in devices
    ]
