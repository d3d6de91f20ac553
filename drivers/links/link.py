"""The line to a device: bytes out, bytes in, and one error, LinkLost, for every symptom of a lost line."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from vvvaltr.controller.core.errors import DeviceError, DeviceTimeout, LinkLost
from vvvaltr.drivers.links.trouble import explain


class Link(Protocol):
    """A line of bytes. Reading and writing may happen in two threads at once."""

    @property
    def name(self) -> str:
        """Name of the line in messages: its port."""
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
        """Release the line. Idempotent. Never raises: nothing more can be done for a lost line."""
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
            raise DeviceTimeout(f"{link.name}: the answer has {len(data)} of {size} bytes; check wiring and baud rate")
    return data


def discard(link: Link) -> int:
    """Discard received bytes that were not requested or came too late; return their number. Raises LinkLost."""
    count = 0
    while part := link.read(4096, 0.0):
        count += len(part)
    return count


@contextmanager
def lost_link(name: str, *symptoms: type[Exception]) -> Iterator[None]:
    """Raise LinkLost, with the line's name, for the ``symptoms`` of a lost line and for any OSError."""
    kinds: tuple[type[Exception], ...] = (OSError, *symptoms)
    try:
        yield
    except DeviceError:
        raise  # some are OSErrors too, but they name the cause already
    except kinds as error:
        raise LinkLost(explain(name, error)) from error
