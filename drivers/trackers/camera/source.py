"""Where pictures come from: a camera of this computer, a film, a folder of pictures, or another program."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from vvvaltr.controller.core.errors import UserError
from vvvaltr.drivers.trackers.camera.frames import FrameReader
from vvvaltr.drivers.trackers.camera.tags import Picture

if TYPE_CHECKING:
    import cv2

FRAMES = "frames:"
"""Begins a source that is another program."""
_DEVICES = Path("/dev")
_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".tif", ".tiff"})
_MANUAL = 1.0  # Video4Linux: exposure as told, not by the camera's own rule
_EXPOSURE_UNIT_S = 1e-4  # Video4Linux
_LOOK_S = 0.002  # between two looks for a picture of another program
_STALE = 1.2  # periods: a picture that has waited for longer is passed over
_MOST_SKIPPED = 8  # pictures that a driver may have kept back
_MOST_BROKEN = 30  # pictures in a row; a line that loses bytes breaks one now and then
_GONE_S, _GONE_PERIODS = 5.0, 5.0  # without a picture, after which another program is taken to have ended


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


def open_source(source: int | str, wanted: Wanted, in_real_time: bool = True) -> Source:
    """Open a source of pictures.

    Args:
        source: a camera's number or path below /dev, a film, a folder of pictures, or ``frames:PATH``.
        wanted: what a camera is asked for; of a folder's pictures the rate.
        in_real_time: whether a film or folder is shown at its rate, without late pictures; else each picture in turn.

    Raises:
        UserError: there is no such source, or it cannot be opened: says why, and the cure.
    """
    path = _DEVICES / f"video{source}" if isinstance(source, int) else Path(source)
    if isinstance(source, str) and source.startswith(FRAMES):
        return SharedSource(Path(source.removeprefix(FRAMES)))
    if path.is_relative_to(_DEVICES):
        return DeviceSource(path, wanted)
    if path.is_dir():
        return FolderSource(path, wanted.rate_hz, in_real_time)
    return FilmSource(path, in_real_time)


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
                return Frame(taken_s, _grey(picture))
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


class FilmSource:
    """A film; times are those of the file. Raises UserError."""

    def __init__(self, path: Path, in_real_time: bool) -> None:
        import cv2

        if not path.exists():
            raise UserError(f"tracker.source: there is no film or folder {path}; name one, or a camera's number")
        self._path = path
        self._capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        if not self._capture.isOpened():
            raise UserError(f"tracker.source: {path} is no film that OpenCV can read; convert it to MP4 (H.264)")
        get = self._capture.get
        self._period_s = 1.0 / (get(cv2.CAP_PROP_FPS) or 30.0)
        width, height = get(cv2.CAP_PROP_FRAME_WIDTH), get(cv2.CAP_PROP_FRAME_HEIGHT)
        self.applied = Wanted(round(width), round(height), 1.0 / self._period_s)
        self._in_real_time = in_real_time
        self._begin_s = time.monotonic()

    def newest(self) -> Frame:
        """Wait for the next picture and return it. Raises NoMorePictures."""
        import cv2

        while self._capture.grab():
            t_s = self._begin_s + 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC)
            late_s = time.monotonic() - t_s
            if late_s < self._period_s or not self._in_real_time:
                time.sleep(max(0.0, -late_s) if self._in_real_time else 0.0)
                return Frame(t_s, _grey(self._capture.retrieve()[1]))
        raise NoMorePictures(f"the film {self._path} has ended")

    def close(self) -> None:
        """Let go of the film. Idempotent."""
        self._capture.release()


class FolderSource:
    """A folder of pictures, shown in the order of their names. Raises UserError."""

    def __init__(self, path: Path, rate_hz: float, in_real_time: bool) -> None:
        self._path = path
        self._pictures = sorted(each for each in path.iterdir() if each.suffix.lower() in _SUFFIXES)
        if not self._pictures:
            raise UserError(f"tracker.source: the folder {path} holds no pictures ({', '.join(sorted(_SUFFIXES))})")
        try:
            height, width = self._read(0).shape
        except NoMorePictures as error:
            raise UserError(f"tracker.source: {error}; remove it from the folder") from None
        self.applied = Wanted(width, height, rate_hz)
        self._shown = -1
        self._in_real_time = in_real_time
        self._begin_s = time.monotonic()

    def newest(self) -> Frame:
        """Wait for the next picture and return it. Raises NoMorePictures."""
        period_s = 1.0 / self.applied.rate_hz
        due = int((time.monotonic() - self._begin_s) / period_s) if self._in_real_time else 0
        self._shown = max(self._shown + 1, due)
        if self._shown >= len(self._pictures):
            raise NoMorePictures(f"the pictures in {self._path} have ended")
        t_s = self._begin_s + self._shown * period_s
        if self._in_real_time:
            time.sleep(max(0.0, t_s - time.monotonic()))
        return Frame(t_s, self._read(self._shown))

    def close(self) -> None:
        """Do nothing: no file is open."""

    def _read(self, number: int) -> Picture:
        import cv2

        picture = cv2.imread(str(self._pictures[number]), cv2.IMREAD_GRAYSCALE)
        if picture is None:
            raise NoMorePictures(f"{self._pictures[number]} is no picture")
        return np.asarray(picture, np.uint8)


class SharedSource:
    """Pictures of another program on this computer; see ``frames``. Raises UserError."""

    def __init__(self, path: Path) -> None:
        try:
            self._reader = FrameReader(path)
        except OSError as error:
            raise UserError(
                f"tracker.source: {path}: {error.strerror}; is the program that writes it running?"
            ) from None
        except ValueError as error:
            raise UserError(f"tracker.source: {path}: {error}") from None
        self.applied = Wanted(self._reader.width_px, self._reader.height_px, self._reader.rate_hz)
        self._path = path
        self._shown, self._given_s = -1, time.monotonic()

    def newest(self) -> Frame:
        """Wait for the next picture and return the newest one. Raises NoPictureNow."""
        patience_s = max(_GONE_S, _GONE_PERIODS / self.applied.rate_hz)
        while (found := self._reader.newest(self._shown)) is None:
            if time.monotonic() - self._given_s > patience_s:
                raise NoPictureNow(
                    f"no new picture in {self._path} for {patience_s:g} s; is the program that writes it running?"
                )
            time.sleep(_LOOK_S)
        self._given_s = time.monotonic()
        self._shown, t_s, grey = found
        if not t_s <= self._given_s:  # such a picture would never grow old, however long ago it was taken
            raise NoPictureNow(f"a picture in {self._path} is from the future; give it the time of time.monotonic()")
        return Frame(t_s, grey)

    def close(self) -> None:
        """Let go of the file. Idempotent."""
        self._reader.close()


def _grey(picture: cv2.typing.MatLike) -> Picture:
    import cv2

    return np.asarray(picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
