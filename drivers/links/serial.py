"""A serial line, by pyserial: a device file or a pty; other addresses that pyserial knows only where allowed."""

from __future__ import annotations

import select
import termios
from contextlib import suppress

import serial

from vvvaltr.controller.core.errors import LinkLost
from vvvaltr.drivers.links.link import lost_link
from vvvaltr.drivers.links.local import PORTS

# What an unplugged line raises besides OSError: `flush` and set-up; a file number that has become None.
_SYMPTOMS = (serial.SerialException, termios.error, TypeError)
_WRITE_TIMEOUT_S = 0.2  # pyserial also counts the time for which this process itself was held up


class SerialLink:
    """A serial line with eight data bits, no parity, one stop bit.

    Args:
        port: device file; see ``local`` for addresses.
        baud: bits per second.

    Raises:
        NotUnderstood: the port is not a serial port of this computer.
        LinkLost: there is no such port, it may not be opened, or another program has it.
    """

    def __init__(self, port: str, baud: int) -> None:
        self._name = port
        with lost_link(port, *_SYMPTOMS):
            PORTS.check_port(port)
            open_port = serial.serial_for_url if "://" in port else serial.Serial
            self._serial = open_port(port, baud, timeout=0, write_timeout=_WRITE_TIMEOUT_S, exclusive=True)

    @property
    def name(self) -> str:
        """The port."""
        return self._name

    def write(self, data: bytes) -> None:
        """Send all of ``data``. A line that does not take it within 0.2 s is lost. Raises LinkLost."""
        # A write that times out may have been accepted, so it is never repeated from here.
        with lost_link(self._name, *_SYMPTOMS):
            self._serial.write(data)

    def read(self, size: int, timeout_s: float) -> bytes:
        """Return what has come in, ``size`` bytes at most, waiting for the first of them. Raises LinkLost."""
        with lost_link(self._name, *_SYMPTOMS):
            if not select.select([self._serial.fileno()], [], [], timeout_s)[0]:
                return b""
        # A line that is ready to be read but has no data has been closed at its other end.
        with suppress(OSError, *_SYMPTOMS):
            if data := self._serial.read(size):
                return bytes(data)
        raise LinkLost(f"{self._name}: the device was unplugged or switched off")

    def close(self) -> None:
        """Release the port. Idempotent."""
        with suppress(OSError, *_SYMPTOMS):
            self._serial.close()
