"""The line to a device: bytes out, bytes in, and one error for everything that a lost line can look like."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from vvvaltr.controller.core.errors import DeviceError, DeviceTimeout, LinkLost


class Link(Protocol):
    """A line of bytes. Reading and writing may happen in two threads at once."""

    @property
    def name(self) -> str:
        """What to call the line in a message: its port."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of ``data``, without waiting for it to have crossed the line. Raises LinkLost."""
        ...

    def read(self, size: int, timeout_s: float) -> bytes:
        """Return what has come in, ``size`` bytes at most, after waiting at most ``timeout_s`` for the first of them.

        Returns no bytes if none came. Raises LinkLost.
        """
        ...

    def close(self) -> None:
        """Let go of the line. Idempotent; never raises, for a lost line cannot be closed in a better way."""
        ...


def read_exactly(link: Link, size: int, deadline_s: float) -> bytes:
    """Return the next ``size`` bytes of a link.

    Args:
        link: where from.
        size: how many bytes.
        deadline_s: until when to wait for the last of them, as ``time.monotonic()`` counts.

    Raises:
        DeviceTimeout: they did not all come in time.
        LinkLost: the line is gone.
    """
    data = b""
    while len(data) < size:
        left_s = deadline_s - time.monotonic()
        data += (part := link.read(size - len(data), max(0.0, left_s)))
        if not part and left_s <= 0.0:
            raise DeviceTimeout(f"{link.name}: {len(data)} of {size} bytes came in time")
    return data


def discard(link: Link) -> int:
    """Throw away what has come in unasked or too late; returns how many bytes that was. Raises LinkLost."""
    count = 0
    while part := link.read(4096, 0.0):
        count += len(part)
    return count


@contextmanager
def lost_link(name: str, *symptoms: type[Exception]) -> Iterator[None]:
    """Turn the ``symptoms`` of a lost line, and any OSError, into LinkLost, with the line's name."""
    kinds: tuple[type[Exception], ...] = (OSError, *symptoms)
    try:
        yield
    except DeviceError:
        raise  # also an OSError, but one that says already what happened
    except kinds as error:
        raise LinkLost(f"{name}: the line is gone or cannot be opened ({error})") from error
