"""Pictures that one program on this computer hands to another: the source ``frames:PATH``.

The file at PATH holds the newest few pictures in a ring, each with its number and the time at which it was taken, as
``time.monotonic()`` counts. Nobody waits for anybody: a writer overwrites, a reader takes the newest whole picture.
"""

from __future__ import annotations

import mmap
import os
import struct
from pathlib import Path

import numpy as np

from vvvaltr.controller.core.disk import open_plain
from vvvaltr.drivers.trackers.camera.tags import Picture

_MAGIC = b"vvvaltr1"
_HEAD = struct.Struct("<8sIIIdq")  # magic, width, height, slots, pictures per second, number of the newest picture
_SLOT = struct.Struct("<qd")  # number of the picture, -1 while it is written; when it was taken, in s
_SLOTS = 4
_LARGEST_PX, _FASTEST_HZ = 1 << 26, 1e5


class FrameWriter:
    """Hands on grey pictures of one size.

    Args:
        path: the file; an old one is replaced.
        width_px, height_px: of every picture.
        rate_hz: pictures per second, for readers to know.

    Raises:
        OSError: the file cannot be written.
    """

    def __init__(self, path: Path, width_px: int, height_px: int, rate_hz: float) -> None:
        self._shape = (height_px, width_px)
        self._rate_hz = rate_hz
        self._number = -1
        size = _HEAD.size + _SLOTS * (_SLOT.size + width_px * height_px)
        fresh = path.with_name(f"{path.name}.new")
        fresh.unlink(missing_ok=True)  # a left-over, or a link to somewhere
        with fresh.open("x+b") as file:
            file.truncate(size)
            self._memory = mmap.mmap(file.fileno(), size)
        for slot in range(_SLOTS):
            _SLOT.pack_into(self._memory, _place(slot, self._shape), -1, 0.0)
        self._say_newest()
        os.replace(fresh, path)

    def write(self, t_s: float, picture: Picture) -> None:
        """Hand on a picture that was taken at ``t_s``. Raises ValueError for one of another size."""
        if picture.shape != self._shape:
            raise ValueError(f"a picture of shape {picture.shape}, not {self._shape}")
        self._number += 1
        place = _place(self._number % _SLOTS, self._shape)
        _SLOT.pack_into(self._memory, place, -1, t_s)
        begin = place + _SLOT.size
        self._memory[begin : begin + picture.size] = picture.tobytes()
        _SLOT.pack_into(self._memory, place, self._number, t_s)
        self._say_newest()

    def close(self) -> None:
        """Let go of the file, which stays for its readers. Idempotent."""
        self._memory.close()

    def _say_newest(self) -> None:
        height, width = self._shape
        _HEAD.pack_into(self._memory, 0, _MAGIC, width, height, _SLOTS, self._rate_hz, self._number)


class FrameReader:
    """Takes the newest picture.

    Raises:
        ValueError: the file holds no pictures of a ``FrameWriter``.
        OSError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        with open_plain(path) as file:
            size = os.fstat(file.fileno()).st_size
            head = file.read(_HEAD.size)
            if len(head) < _HEAD.size or head[: len(_MAGIC)] != _MAGIC:
                raise ValueError("it holds no pictures of another program")
            _, self.width_px, self.height_px, self._slots, self.rate_hz, _ = _HEAD.unpack(head)
            pixels = self.width_px * self.height_px
            if not (
                0.0 < self.rate_hz <= _FASTEST_HZ
                and 0 < pixels <= _LARGEST_PX
                and self._slots > 0
                and size == _HEAD.size + self._slots * (_SLOT.size + pixels)
            ):
                raise ValueError("it is not as large as its pictures")
            self._memory = mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ)
        self._shape = (self.height_px, self.width_px)

    def newest(self, after: int) -> tuple[int, float, Picture] | None:
        """Return number, time and pixels of the newest picture; None while none is newer than number ``after``."""
        number = _HEAD.unpack_from(self._memory)[-1]
        if number <= after:
            return None
        place = _place(number % self._slots, self._shape)
        begin = place + _SLOT.size
        written, t_s = _SLOT.unpack_from(self._memory, place)
        pixels = self._memory[begin : begin + self.height_px * self.width_px]
        if written != number or _SLOT.unpack_from(self._memory, place) != (written, t_s):
            return None  # overwritten meanwhile: a newer one is there soon
        return number, t_s, np.frombuffer(pixels, np.uint8).reshape(self._shape)

    def close(self) -> None:
        """Let go of the file. Idempotent."""
        self._memory.close()


def _place(slot: int, shape: tuple[int, int]) -> int:
    return _HEAD.size + slot * (_SLOT.size + shape[0] * shape[1])
