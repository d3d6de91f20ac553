"""Ports of this computer. A robot's file may come from anybody, so that a port names a local device and nothing else.

pyserial and python-can also take addresses, which dial out (``socket://``), or write to files (``spy://``).
"""

from __future__ import annotations

import os
import re
import socket
import stat
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from vvvaltr.controller.core.errors import DeviceError, NotUnderstood

SERIAL_INTERFACES = frozenset({"slcan", "seeedstudio", "robotell", "serial"})
"""The CAN interfaces of python-can whose channel is a serial port."""

_LOCAL_INTERFACES = SERIAL_INTERFACES | {
    "socketcan", "virtual", "canalystii", "cantact", "etas", "gs_usb", "iscan", "ixxat", "kvaser", "neousys", "neovi",
    "nican", "nixnet", "pcan", "systec", "usb2can", "vector",
}  # fmt: skip
_PLAIN_TEXT = re.compile(r"[0-9A-Za-z_+-]{1,32}")
_LOADS_CODE = frozenset({"dll", "override_library_name"})
_TERMINALS = Path("/sys/class/tty")
_PTYS = Path("/dev/pts")


class LocalPorts:
    """What the person at this computer lets a robot's file name."""

    def __init__(self) -> None:
        self.allow_url = False

    def check_port(self, port: str) -> None:
        """Raise NotUnderstood, or DeviceError for what is not there, if ``port`` is not a local serial port."""
        if not port or "\0" in port:
            raise NotUnderstood(f"the port {port!r} names no device; write its name, as in /dev/ttyACM0")
        if self.allow_url and "://" in port:
            return
        if "://" in port:
            raise NotUnderstood(
                f"the port {port} is an address, not a device of this computer; name the device, as in /dev/ttyACM0, "
                "or allow addresses by --allow-url if you trust the robot's file"
            )
        if os.path.exists(port) and not _is_terminal(Path(port)):
            raise NotUnderstood(f"{port} is not a serial port{describe_ports()}; correct port in the robot's file")

    def check_bus(self, interface: str, channel: str, options: Mapping[str, Any]) -> None:
        """Raise NotUnderstood if a CAN bus is not one of this computer, or an option could lead elsewhere."""
        if self.allow_url:
            return
        if interface not in _LOCAL_INTERFACES:
            raise NotUnderstood(
                f"the CAN interface {interface} is none of this computer; choose one of "
                f"{', '.join(sorted(_LOCAL_INTERFACES))}, or allow it by --allow-url if you trust the robot's file"
            )
        if interface in SERIAL_INTERFACES:
            self.check_port(serial_port_of(channel))
        for key, value in options.items():
            if key in _LOADS_CODE or (isinstance(value, str) and not _PLAIN_TEXT.fullmatch(value)):
                raise NotUnderstood(
                    f"options.{key} is {value!r}, which is more than a setting of the CAN interface; leave it out, or "
                    "allow it by --allow-url if you trust the robot's file"
                )


PORTS = LocalPorts()
"""Set once, by the command line: the permission is the person's, not a robot's."""


def serial_port_of(channel: str) -> str:
    """Return the serial port that a channel names; a baud rate may follow it, as in ``/dev/tty0@115200``."""
    return channel.partition("@")[0]


def list_usb_ports() -> list[str]:
    """Return the serial ports of USB devices."""
    return sorted(map(str, [*Path("/dev").glob("ttyACM*"), *Path("/dev").glob("ttyUSB*")]))


def describe_ports() -> str:
    """Return which serial ports this computer has, as the end of a clause."""
    ports = list_usb_ports()
    return f" (there are {', '.join(ports)})" if ports else " (no USB serial port is plugged in)"


def describe_buses() -> str:
    """Return which CAN interfaces the kernel has, as the end of a clause."""
    kinds = Path("/sys/class/net").glob("*/type")
    names = sorted(kind.parent.name for kind in kinds if kind.read_text().strip() == "280")  # ARPHRD_CAN
    return f" (there are {', '.join(names)})" if names else " (this computer has no CAN interface)"


def find_user(port: str) -> str:
    """Return the name and number of another process that has ``port`` open, as far as it may be known; empty if not."""
    real = os.path.realpath(port)
    for process in Path("/proc").glob("[0-9]*"):
        if int(process.name) == os.getpid():
            continue
        with suppress(OSError):
            if any(os.readlink(file) == real for file in (process / "fd").iterdir()):
                return f"{(process / 'comm').read_text().strip()}, process {process.name}"
    return ""


def claim_bus(interface: str, channel: str) -> socket.socket | None:
    """Keep other programs from driving the same CAN bus until what is returned is closed.

    A name in the abstract namespace vanishes with its process and belongs, as CAN interfaces do, to the network
    namespace. A virtual bus lives within one program.

    Raises:
        DeviceError: another program drives it.
    """
    if interface == "virtual":
        return None
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
    try:
        claim.bind(f"\0vvvaltr-{interface}-{channel}"[:100])
    except OSError:
        claim.close()
        raise DeviceError(f"{interface}:{channel} is in use by another vvvaltr; end that one first") from None
    return claim


def claim_port(port: str) -> IO[bytes]:
    """Lock a serial port, as pyserial does, for a program that does not; until what is returned is closed.

    Raises:
        OSError: the port cannot be opened, or another program has locked it (BlockingIOError).
    """
    import fcntl

    file = os.fdopen(os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC), "rb", buffering=0)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise
    return file


def _is_terminal(port: Path) -> bool:
    """Return whether a path leads to a terminal: opening another device may do harm, as to a tape or a watchdog."""
    real = Path(os.path.realpath(port))
    if not stat.S_ISCHR(real.stat().st_mode):
        return False
    return real.parent == _PTYS or not _TERMINALS.exists() or (_TERMINALS / real.name).exists()
