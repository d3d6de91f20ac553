"""The air of mock struts: a socket that a program connects to, packet by packet."""

from __future__ import annotations

import select
import socket
import time
from collections import deque
from contextlib import suppress
from pathlib import Path

from vvvaltr.drivers.links.air import GREETING, LONGEST

_HANG_UP, _PULLED = b"H\0", b"P\0"  # what is received when a program has ended, and when the adapter was pulled


class AirPort:
    """A socket for one program at a time: satisfies ``vvvaltr.drivers.mocking.port.Port``.

    Raises:
        ValueError: ``link`` is taken, or cannot be made.
    """

    def __init__(self, link: Path) -> None:
        self._link = link
        self._listener: socket.socket | None = None
        self._host: socket.socket | None = None
        self._news: deque[bytes] = deque()
        if link.is_socket() and not _is_alive(link):
            link.unlink()  # of a mock that was killed
        if link.is_symlink() or link.exists():
            raise ValueError(f"{link} exists already; choose another --link or remove it")
        try:
            self.plug()
        except OSError as error:
            self.unplug()
            raise ValueError(f"{link} cannot be made: {error.strerror or error}; choose another --link") from error

    @property
    def name(self) -> str:
        """The socket."""
        return str(self._link)

    def receive(self, now_s: float) -> bytes:
        """Return the next packet."""
        if self._news:
            return self._news.popleft()
        if self._host is None:
            self._accept()
        if self._host is None:
            return b""
        try:
            packet = self._host.recv(LONGEST)
        except BlockingIOError:
            return b""
        except OSError:
            packet = b""
        if not packet:
            self._hang_up()
        return packet or _HANG_UP

    def send(self, data: bytes, now_s: float) -> None:
        """Send a packet; without a reader it is lost."""
        if self._host is not None:
            with suppress(OSError):
                self._host.send(data, socket.MSG_NOSIGNAL)

    def wait(self, until_s: float) -> None:
        """Return at ``until_s``, or when there is something to do."""
        readable = [end for end in (self._host or self._listener,) if end is not None]
        select.select(readable, (), (), 0.0 if self._news else max(0.0, until_s - time.monotonic()))

    def unplug(self) -> None:
        """Pull the adapter: the links of all struts are lost."""
        self._hang_up()
        self._news.append(_PULLED)
        if self._listener is not None:
            self._listener.close()
            self._listener = None
            self._link.unlink(missing_ok=True)

    def plug(self) -> None:
        """Plug the adapter in again."""
        if self._listener is not None:
            return
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_CLOEXEC)
        try:
            listener.bind(str(self._link))
            listener.listen()
        except OSError:
            listener.close()
            raise
        listener.setblocking(False)
        self._listener = listener

    def close(self) -> None:
        """Pull the adapter for good."""
        self.unplug()

    def _accept(self) -> None:
        if self._listener is None:
            return
        with suppress(OSError):
            self._host, _ = self._listener.accept()
            self._host.setblocking(False)
            self.send(GREETING, 0.0)

    def _hang_up(self) -> None:
        if self._host is not None:
            self._host.close()
            self._host = None


def _is_alive(link: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as end:
        try:
            end.connect(str(link))
        except OSError:
            return False
    return True
