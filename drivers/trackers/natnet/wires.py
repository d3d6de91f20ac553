"""The sockets of a NatNet client."""

from __future__ import annotations

import select
import socket
from collections.abc import Iterator

from vvvaltr.drivers.trackers.natnet.table import NatnetTable

_LONGEST_BYTES = 65536


class Wires:
    """One socket for commands, answers and, with unicast, frames; another one for frames that go to a group.

    They are bound to the address by which this computer reaches the server, and hear that server alone.

    Args:
        table: where the server is.

    Raises:
        ValueError: the server's name or the group is none, or an address is taken.
    """

    def __init__(self, table: NatnetTable) -> None:
        self._sockets: list[socket.socket] = []
        try:
            self._server = (socket.gethostbyname(table.host), table.port)
            here = _address_towards(self._server)
            self._sockets.append(_bound(here, 0))
            if table.multicast:
                self._sockets.append(_bound(table.multicast, table.data_port))
                membership = socket.inet_aton(table.multicast) + socket.inet_aton(here)
                self._sockets[-1].setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        except OSError as error:
            self.close()
            group = f" by the group {table.multicast}:{table.data_port}" if table.multicast else ""
            raise ValueError(
                f"NatNet at {table.host}:{table.port}{group} cannot be reached: {error.strerror or error}; "
                "correct tracker.host and tracker.multicast"
            ) from error

    def send(self, datagram: bytes) -> None:
        """Send to the server, or lose it: the network may be down for a while."""
        try:
            self._sockets[0].sendto(datagram, self._server)
        except OSError:
            return

    def heard(self, timeout_s: float) -> Iterator[bytes]:
        """Yield what has come from the server, after waiting for it for up to ``timeout_s``."""
        for wire in select.select(self._sockets, (), (), timeout_s)[0]:
            try:
                datagram, (sender, _) = wire.recvfrom(_LONGEST_BYTES)
            except OSError:
                continue  # an earlier datagram of ours found nobody
            if sender == self._server[0]:
                yield datagram

    def close(self) -> None:
        """Let go of the sockets. Idempotent."""
        for wire in self._sockets:
            wire.close()


def _address_towards(server: tuple[str, int]) -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(server)  # sends nothing
        return str(probe.getsockname()[0])


def _bound(address: str, port: int) -> socket.socket:
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        if port:
            wire.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # others on this computer may listen as well
        wire.bind((address, port))
    except OSError:
        wire.close()
        raise
    return wire
