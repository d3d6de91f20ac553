"""The socket on which poses arrive: on one address of this computer, or of a group, or by broadcast."""

from __future__ import annotations

import ipaddress
import select
import socket
import struct
from contextlib import suppress

LOOPBACK = "127.0.0.1"
_LONGEST_BYTES = 65536

Address = tuple[str, int]


class PoseSocket:
    """A UDP socket that one thread reads, and another one can end.

    Args:
        host: address or name to listen on: of this computer, of a multicast group, which is joined, or of a broadcast.
        port: UDP port; 0 for any that is free. A group's may be shared with other programs.
        interface: name or address of the network interface on which a group is joined; empty for all of them.

    Raises:
        ValueError: the address cannot be listened on, or the group cannot be joined.
    """

    def __init__(self, host: str, port: int, interface: str = "") -> None:
        self._wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._bind(host, port, interface)
        except OSError as error:
            self._wire.close()
            raise ValueError(
                f"cannot listen for poses on {host}:{port}: {error.strerror or error}; {_cure(host)}"
            ) from error
        self._waking, self._wake = socket.socketpair()

    @property
    def address(self) -> str:
        """Where it listens, as ``host:port``."""
        host, port = self._wire.getsockname()
        return f"{host}:{port}"

    def receive(self) -> tuple[bytes, Address] | None:
        """Return the next datagram and its sender; None once the socket was ended."""
        heard = select.select((self._wire, self._waking), (), ())[0]
        if self._waking in heard:
            return None
        datagram, sender = self._wire.recvfrom(_LONGEST_BYTES)
        return datagram, sender

    def end(self) -> None:
        """Make ``receive`` return None, in whatever thread it waits."""
        self._wake.send(b"\0")

    def close(self) -> None:
        """Let go of the sockets, once no thread reads them."""
        for each in (self._wire, self._waking, self._wake):
            each.close()

    def _bind(self, host: str, port: int, interface: str) -> None:
        address = socket.gethostbyname(host)
        if not ipaddress.ip_address(address).is_multicast:
            self._wire.bind((address, port))
            return
        self._wire.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # others may listen to the group as well
        self._wire.bind((address, port))  # to the group's address, so that nothing else that comes here is heard
        self._join(socket.inet_aton(address), interface)

    def _join(self, group: bytes, interface: str) -> None:
        """Join a group. Raises OSError if no interface can."""
        names = [name for _, name in socket.if_nameindex()]
        joined = 0
        for name in (interface,) if interface else names:
            with suppress(OSError):
                where = struct.pack("=4si", bytes(4), socket.if_nametoindex(name)) if name in names else _where(name)
                self._wire.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + where)
                joined += 1
        if not joined:
            raise OSError(f"the interface {interface!r} cannot join the group" if interface else "no network is up")


def _where(address: str) -> bytes:
    return socket.inet_aton(socket.gethostbyname(address))


def _cure(host: str) -> str:
    with suppress(ValueError):
        if ipaddress.ip_address(host).is_multicast:
            return "correct tracker.host and tracker.interface"
    return "end the other program that listens there, or correct tracker.host and tracker.port"
