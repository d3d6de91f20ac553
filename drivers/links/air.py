"""Radio links to mock struts over a local socket: packets of a kind, the number of a strut and a text.

From here: ``?`` who is in the air, ``C`` connect to an address, ``D`` disconnect, ``W`` a text to be acknowledged and
``w`` one that is not. From the mock: ``A`` address and name of each in the air, a line each, ``C`` connected, ``N``
notification, ``W`` a text acknowledged, ``D`` the link is lost.
"""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Sequence
from contextlib import suppress

from vvvaltr.controller.core.errors import DeviceError, DeviceTimeout, LinkLost
from vvvaltr.drivers.links.gatt import Wanted, Word, are_all_found, find_addresses

GREETING = b"vvvaltr air 1"
LONGEST = 512
_GREETING_S, _SCAN_S, _CONNECT_S = 1.0, 1.0, 2.0


def scan_air(path: str) -> dict[str, str]:
    """Return name by address of the struts in the air of a mock. Raises LinkLost."""
    air = _Air(path)
    try:
        return air.scan()
    finally:
        air.close()


class AirLink:
    """Satisfies ``GattLink``.

    Args:
        path: the mock's socket.
        wanted: the struts.

    Raises:
        LinkLost: there is no mock.
        DeviceTimeout: a strut is not in the air, or does not let itself be connected.
        DeviceFault: two have one name.
    """

    def __init__(self, path: str, wanted: Sequence[Wanted]) -> None:
        self._names = tuple(strut.strut for strut in wanted)
        self._air = _Air(path)
        self._lost: set[int] = set()
        try:
            self._connect(self._find(wanted))
        except DeviceError:
            self.close()
            raise

    @property
    def name(self) -> str:
        """The mock's socket."""
        return self._air.path

    def write(self, strut: int, text: bytes, is_acknowledged: bool) -> None:
        """Send a text. Raises LinkLost."""
        if strut in self._lost:
            raise self._loss(strut)
        self._air.send(b"W" if is_acknowledged else b"w", strut, text)

    def read(self, timeout_s: float) -> Word | None:
        """Return what came next. Raises LinkLost."""
        if self._lost:
            raise self._loss(min(self._lost))
        packet = self._air.receive(timeout_s)
        if packet is None:
            return None
        kind, strut, text = packet
        if strut >= len(self._names) or kind not in b"NWD":
            return None  # garbled
        if kind == b"D":
            self._lost.add(strut)
            raise self._loss(strut)
        return Word(strut, time.monotonic(), text, acknowledges=kind == b"W")

    def close(self) -> None:
        """Disconnect, and release the socket."""
        with suppress(LinkLost):
            for strut in range(len(self._names)):
                self._air.send(b"D", strut)
        self._air.close()

    def _find(self, wanted: Sequence[Wanted]) -> tuple[str, ...]:
        end_s = time.monotonic() + _SCAN_S
        while not are_all_found(wanted, seen := self._air.scan()) and time.monotonic() < end_s:
            time.sleep(0.05)
        return find_addresses(wanted, seen)

    def _connect(self, addresses: Sequence[str]) -> None:
        for strut, address in enumerate(addresses):
            self._air.send(b"C", strut, address.encode())
        missing = set(range(len(addresses)))
        end_s = time.monotonic() + _CONNECT_S
        while missing:
            packet = self._air.receive(max(0.0, end_s - time.monotonic()))
            if packet is not None and packet[0] == b"C":
                missing.discard(packet[1])
            elif packet is None and time.monotonic() >= end_s:
                raise DeviceTimeout(
                    f"strut {self._names[min(missing)]} does not let itself be connected; switch it off and on"
                )

    def _loss(self, strut: int) -> LinkLost:
        return LinkLost(
            f"{self.name}: the radio link to strut {self._names[strut]} is lost; bring it nearer, check its battery"
        )


class _Air:
    """The socket. Nothing is sent before the mock has greeted, so that no other program's socket is written to."""

    def __init__(self, path: str) -> None:
        self.path = path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_CLOEXEC)
        self._socket.settimeout(_GREETING_S)
        try:
            self._socket.connect(path)
            greeting = self._socket.recv(LONGEST)
        except OSError as error:
            self.close()
            raise LinkLost(
                f"{path}: no mock of struts answers there ({error.strerror or error}); start one by vvvaltr "
                "mock struts, end another program that uses it, or correct adapter"
            ) from None
        if greeting != GREETING:
            self.close()
            raise LinkLost(f"{path} is not the socket of a mock of struts; correct adapter")
        self._socket.settimeout(None)

    def scan(self) -> dict[str, str]:
        """Return name by address."""
        self.send(b"?", 0)
        end_s = time.monotonic() + _SCAN_S
        while (packet := self.receive(max(0.0, end_s - time.monotonic()))) is not None:
            if packet[0] == b"A":
                lines = [line.partition(" ") for line in packet[2].decode(errors="replace").splitlines()]
                return {address: name for address, _, name in lines}
        return {}

    def send(self, kind: bytes, strut: int, text: bytes = b"") -> None:
        """Send a packet. Raises LinkLost."""
        try:
            self._socket.send(kind + bytes([strut]) + text, socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)
        except OSError as error:
            raise self._gone() from error

    def receive(self, timeout_s: float) -> tuple[bytes, int, bytes] | None:
        """Return the next packet; None if none came. Raises LinkLost."""
        try:
            if not select.select([self._socket], [], [], timeout_s)[0]:
                return None
            packet = self._socket.recv(LONGEST)
        except (OSError, ValueError) as error:
            raise self._gone() from error
        if not packet:
            raise self._gone()
        return (packet[:1], packet[1], packet[2:]) if len(packet) > 1 else (b"\0", 0, b"")

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()

    def _gone(self) -> LinkLost:
        return LinkLost(f"{self.path}: the adapter is gone; plug it in again")
