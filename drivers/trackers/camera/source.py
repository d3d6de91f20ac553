"""What gives pictures, and what it gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from vvvaltr.drivers.trackers.camera.tags import Picture

if TYPE_CHECKING:
    import cv2

FRAMES = "frames:"
"""Begins a source that is another program."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a camera is asked for.

    Args:
        width_px, height_px: size of the pictures.
        rate_hz: pictures per second.
        exposure_s: how long the shutter is open; 0 leaves it to the camera.
    """

    width_px: int = 1280
    height_px: int = 720
    rate_hz: float = 30.0
    exposure_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Frame:
    """One grey picture, shape (height, width), taken at ``t_s`` as ``time.monotonic()`` counts."""

    t_s: float
    grey: Picture


class NoMorePictures(Exception):
    """The source has ended, or is gone: says why."""


class NoPictureNow(NoMorePictures):
    """Another program shows no picture, or none that can be used: says why. It may go on."""


class Source(Protocol):
    """Gives pictures in real time."""

    @property
    def applied(self) -> Wanted:
        """What the source does, as read back from it; exposure 0 where it does not tell."""
        ...

    def newest(self) -> Frame:
        """Wait for the next picture and return the newest one. Raises NoMorePictures."""
        ...

    def close(self) -> None:
        """Let go of the source. Idempotent."""
        ...


def as_grey(picture: cv2.typing.MatLike) -> Picture:
    """Return a picture of OpenCV in grey, shape (height, width)."""
    import cv2

    return np.asarray(picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
