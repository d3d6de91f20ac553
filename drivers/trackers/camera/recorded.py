"""Pictures that were taken before: a film, or a folder of pictures."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from vvvaltr.controller.core.errors import UserError
from vvvaltr.drivers.trackers.camera.source import Frame, NoMorePictures, Wanted, as_grey
from vvvaltr.drivers.trackers.camera.tags import Picture

_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".tif", ".tiff"})


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
                return Frame(t_s, as_grey(self._capture.retrieve()[1]))
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
