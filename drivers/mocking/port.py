"""The port of a mock device: a pseudo-terminal as slow as a real line."""

from __future__ import annotations

import math
import os
import select
import termios
import time
import tty
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Protocol

_BAUDS = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}
_BACKLOG = 256  # bytes on the line; more are left with the sender, whose buffer fills up as a real one does


class Port(Protocol):
    """A place to plug a device in. Times are as ``time.monotonic()`` counts."""

    @property
    def name(self) -> str:
        """What a controller opens."""
        ...

    def receive(self, now_s: float) -> bytes:
        """Return what has crossed the line by now and was not returned before."""
        ...

    def send(self, data: bytes, now_s: float) -> None:
        """Put ``data`` on the line."""
        ...

    def wait(self, until_s: float) -> None:
        """Return at ``until_s``, or when there is something to receive, or to carry on with."""
        ...

    def unplug(self) -> None:
        """Pull the plug; bytes on the line are lost."""
        ...

    def plug(self) -> None:
        """Put the plug back."""
        ...

    def close(self) -> None:
        """Unplug for good, and leave nothing behind."""
        ...


class PtyPort:
    """A pseudo-terminal with a symbolic link to its controller's end.

    Args:
        link: the name that a controller opens.
        is_paced: whether bytes take as long as at the baud rate that the controller has set, ten bits each; a pty by
            itself passes them at once, as USB does.

    Raises:
        ValueError: ``link`` is taken, or cannot be made.
    """

    def __init__(self, link: Path, is_paced: bool) -> None:
        self._link = link
        self._is_paced = is_paced
        if link.is_symlink() and not link.exists():
            link.unlink()  # of a device that was killed
        if link.is_symlink() or link.exists():
            raise ValueError(f"{link} exists already; choose another --link or remove it")
        self._ends: tuple[int, ...] = ()
        try:
            self.plug()
        except OSError as error:  # it would name the pseudo-terminal
            self._hang_up()
            raise ValueError(f"{link} cannot be made: {error.strerror}; choose another --link") from error

    @property
    def name(self) -> str:
        """The link."""
        return str(self._link)

    def receive(self, now_s: float) -> bytes:
        """Return what has crossed the line by now."""
        if self._ends and len(self._inbound) < _BACKLOG:
            with suppress(BlockingIOError):
                self._inbound.put(os.read(self._ends[0], _BACKLOG), now_s, self._byte_s())
        self._carry_out(now_s)
        return self._inbound.take(now_s)

    def send(self, data: bytes, now_s: float) -> None:
        """Put ``data`` on the line; each byte arrives when it has crossed."""
        if self._ends:
            self._outbound.put(data, now_s, self._byte_s())
        self._carry_out(now_s)

    def wait(self, until_s: float) -> None:
        """Return at ``until_s``, or when there is something to do."""
        until_s = min(until_s, self._inbound.next_s, self._outbound.next_s)
        readable = self._ends[:1] if len(self._inbound) < _BACKLOG else ()
        select.select(readable, (), (), max(0.0, until_s - time.monotonic()))

    def unplug(self) -> None:
        """Hang up: the controller sees the end of its line."""
        self._hang_up()
        self._inbound = self._outbound = _Wire()
        self._link.unlink(missing_ok=True)

    def plug(self) -> None:
        """Make a new pseudo-terminal, and point the link to it."""
        if self._ends:
            return
        # The controller's end stays open here too, so that the terminal outlives a controller that closes it.
        ours, theirs = self._ends = os.openpty()
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        self._inbound, self._outbound = _Wire(), _Wire()
        self._link.symlink_to(os.ttyname(theirs))

    def close(self) -> None:
        """Hang up for good."""
        self.unplug()

    def _hang_up(self) -> None:
        for end in self._ends:
            os.close(end)
        self._ends = ()

    def _byte_s(self) -> float:
        baud = _BAUDS.get(termios.tcgetattr(self._ends[1])[5], 0)
        return 10.0 / baud if self._is_paced and baud else 0.0

    def _carry_out(self, now_s: float) -> None:
        if (data := self._outbound.take(now_s)) and self._ends:
            with suppress(BlockingIOError):  # without a reader the bytes are lost, as on a real line
                os.write(self._ends[0], data)


class _Wire:
    """Bytes on their way in one direction, each as slow as the line."""

    def __init__(self) -> None:
        self._free_s = 0.0
        self._bytes: deque[tuple[float, int]] = deque()

    def __len__(self) -> int:
        return len(self._bytes)

    @property
    def next_s(self) -> float:
        """When the next byte will have crossed."""
        return self._bytes[0][0] if self._bytes else math.inf

    def put(self, data: bytes, now_s: float, byte_s: float) -> None:
        for byte in data:
            self._free_s = max(self._free_s, now_s) + byte_s
            self._bytes.append((self._free_s, byte))

    def take(self, now_s: float) -> bytes:
        crossed = bytearray()
        while self._bytes and self._bytes[0][0] <= now_s:
            crossed.append(self._bytes.popleft()[1])
        return bytes(crossed)
