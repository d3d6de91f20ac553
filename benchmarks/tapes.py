"""Links and a bus without a device, which deliver whatever a benchmark puts into them."""

from __future__ import annotations

import time
from collections.abc import Iterator

from vvvaltr.drivers.links.can import Frame
from vvvaltr.drivers.node.mock import NodeDevice


class Tape:
    """A link that delivers the bytes put into it, and discards what is written."""

    name = "fuzz"

    def __init__(self) -> None:
        self._data = b""

    def put(self, data: bytes) -> None:
        """Deliver ``data``."""
        self._data += data

    @property
    def is_empty(self) -> bool:
        """Whether everything has been read."""
        return not self._data

    def write(self, data: bytes) -> None:
        """Discard it."""

    def read(self, size: int, timeout_s: float) -> bytes:
        """Return what was delivered, without waiting."""
        part, self._data = self._data[:size], self._data[size:]
        return part

    def close(self) -> None:
        """Do nothing: there is nothing to release."""


class FrameTape:
    """A bus that delivers the frames put into it, and discards what is sent."""

    name = "fuzz"

    def __init__(self) -> None:
        self._frames: list[Frame] = []

    def put(self, frames: list[Frame]) -> None:
        """Deliver ``frames``."""
        self._frames = frames

    def send(self, frame: Frame) -> None:
        """Discard it."""

    def frames(self, until_s: float) -> Iterator[Frame]:
        """Yield what was delivered."""
        while self._frames:
            yield self._frames.pop(0)

    def close(self) -> None:
        """Do nothing: there is nothing to release."""


class NodeTape:
    """A link straight into a motor node, which delivers other bytes as well."""

    name = "fuzz"

    def __init__(self, device: NodeDevice) -> None:
        self.device = device
        self._data = b""

    def put(self, data: bytes) -> None:
        """Deliver ``data``."""
        self._data += data

    def write(self, data: bytes) -> None:
        """Send to the node."""
        self._data += self.device.on_bytes(data, time.monotonic())

    def read(self, size: int, timeout_s: float) -> bytes:
        """Return what was delivered, without waiting."""
        self._data += self.device.tick(time.monotonic())
        part, self._data = self._data[:size], self._data[size:]
        return part

    def close(self) -> None:
        """Do nothing: there is nothing to release."""
