"""A camera of this computer."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.controller.core.errors import UserError
from vvvaltr.drivers.trackers.camera.source import Frame, NoMorePictures, Wanted, as_grey

if TYPE_CHECKING:
    import cv2

_MANUAL = 1.0  # Video4Linux: exposure as told, not by the camera's own rule
_EXPOSURE_UNIT_S = 1e-4  # Video4Linux
_STALE = 1.2  # periods: a picture that has waited for longer is passed over
_MOST_SKIPPED = 8  # pictures that a driver may have kept back
_MOST_BROKEN = 30  # pictures in a row; a line that loses bytes breaks one now and then


class DeviceSource:
    """A camera of this computer. Raises UserError."""

    def __init__(self, path: Path, wanted: Wanted) -> None:
        import cv2

        if problem := device_problem(path):
            raise UserError(problem)
        self._path = path
        self._capture = cv2.VideoCapture(str(path), cv2.CAP_V4L2)
        if not self._capture.isOpened():
            raise UserError(
                f"camera {path} does not open: another program has it (fuser {path} tells which), or it is no camera"
            )
        self.applied = _applied(self._capture, wanted)
        self._given_s = time.monotonic()

    def newest(self) -> Frame:
        """Wait for the next picture and return the newest one. Raises NoMorePictures."""
        for _ in range(_MOST_BROKEN):
            taken_s = self._grab()
            _, picture = self._capture.retrieve()
            self._given_s = time.monotonic()
            if picture is not None:
                return Frame(taken_s, as_grey(picture))
        raise NoMorePictures(f"camera {self._path} gives nothing but broken pictures: try another cable or socket")

    def _grab(self) -> float:
        """Take hold of the newest picture; return when it was taken. Raises NoMorePictures."""
        period_s = 1.0 / self.applied.rate_hz
        for _ in range(_MOST_SKIPPED):
            began_s = time.monotonic()
            if not self._capture.grab():
                raise NoMorePictures(f"camera {self._path} gives no more pictures: is it unplugged?")
            taken_s = self._taken_s(began_s)
            if time.monotonic() - taken_s <= _STALE * period_s:
                break
        return taken_s

    def _taken_s(self, began_s: float) -> float:
        """Return when the picture just grabbed was taken: as the driver's stamp says, else by how long it took."""
        import cv2

        now_s = time.monotonic()
        stamp_s = 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC)
        if now_s - 2.0 < stamp_s <= now_s:
            return stamp_s
        # A picture that was there at once may have waited since the last one was given.
        return now_s if now_s - began_s > 0.002 else self._given_s

    def close(self) -> None:
        """Let go of the camera. Idempotent."""
        self._capture.release()


def device_problem(path: Path) -> str:
    """Return why a camera cannot be opened, and the cure; empty if nothing speaks against it."""
    if not path.exists():
        there = sorted(str(each) for each in path.parent.glob("video*"))
        seen = f"there are {', '.join(there)}" if there else "there is no camera at all: plug one in"
        return f"camera {path} is not there; {seen}"
    if not os.access(path, os.R_OK | os.W_OK):
        return f"camera {path} may not be used by you: sudo usermod -aG video $USER, then log in again"
    return ""


def _applied(capture: cv2.VideoCapture, wanted: Wanted) -> Wanted:
    """Set up a camera, and return what it says that it does."""
    import cv2

    # Compressed, for few cameras have the line for 30 raw pictures of this size in a second.
    capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, wanted.width_px)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, wanted.height_px)
    capture.set(cv2.CAP_PROP_FPS, wanted.rate_hz)
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    exposure_s = 0.0
    if wanted.exposure_s > 0.0:
        capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL)
        capture.set(cv2.CAP_PROP_EXPOSURE, wanted.exposure_s / _EXPOSURE_UNIT_S)
        exposure_s = max(0.0, capture.get(cv2.CAP_PROP_EXPOSURE) * _EXPOSURE_UNIT_S)
    width, height = round(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
    rate_hz = capture.get(cv2.CAP_PROP_FPS)
    return Wanted(width, height, rate_hz if rate_hz > 0.0 else wanted.rate_hz, exposure_s)
