"""The camera as a tracker: listens to the process that looks through it."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import threading
import time
from collections import deque

import msgspec

from vvvaltr.controller.core.errors import TrackingLost, UserError
from vvvaltr.controller.core.values import Photo, Pose
from vvvaltr.drivers.trackers.camera import messages
from vvvaltr.drivers.trackers.camera.table import CameraTable

_WATCHER = "vvvaltr.drivers.trackers.camera.watcher"
_OPENS_WITHIN_S = 30.0  # with a camera that opens
_LEAVE_S = 2.0
_MOST_PHOTOS = 600  # ten minutes of pictures that nobody takes
_QUIET = {"OPENCV_LOG_LEVEL": "SILENT", "OPENCV_FFMPEG_LOGLEVEL": "-8", "OPENBLAS_NUM_THREADS": "1"}


def require_opencv() -> None:
    """Raise UserError, with the cure, where OpenCV is not installed."""
    if importlib.util.find_spec("cv2") is None:
        raise UserError("the camera needs OpenCV, which is not installed; run: pip install 'vvvaltr[camera]'")


def silence_opencv() -> None:
    """Keep OpenCV's own warnings off standard error: what goes wrong is told in one line. Before its first import."""
    os.environ.update(_QUIET)


class CameraTracker:
    """A tracker that sees the robot's tag: satisfies ``Tracker``.

    A process of its own looks at the pictures, so that none of them delays a command to the motors. Poses carry
    the time at which the picture was taken; their height is the tag's.

    Args:
        table: the camera, its lens and its tags.

    Raises:
        UserError: OpenCV is not installed, there is no such camera, or what it sees cannot be: one line with the cure.
    """

    def __init__(self, table: CameraTable) -> None:
        require_opencv()
        self._table = table
        # The newest pose, or why there is none and the cure: one attribute, for two threads share it.
        self._newest: Pose | tuple[str, str] = ("no picture has been seen yet", "")
        self._unseen: tuple[str, str] = ("", "")
        self._is_over = False
        self._photos: deque[Photo] = deque(maxlen=_MOST_PHOTOS)
        command = [sys.executable, "-P", "-m", _WATCHER]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, env={**os.environ, **_QUIET})
        self._thread = threading.Thread(target=self._listen, name="camera", daemon=True)
        self._opened = threading.Event()
        self._answer: messages.Ready | str = (
            f"the camera gave no pictures within {_OPENS_WITHIN_S:g} s; is it plugged in?"
        )
        try:
            self.settings = self._start()
        except BaseException:
            self.close()
            raise

    def pose(self) -> Pose:
        """Return the newest pose. Raises TrackingLost if it is too old, or there will be none."""
        newest = self._newest
        if isinstance(newest, tuple):
            raise TrackingLost(*newest)
        age_s = time.monotonic() - newest.t_s
        if age_s > self._table.age_limit_s:
            limit = f"the last pose is {age_s:.2f} s old; the limit is {self._table.age_limit_s:g} s"
            reason, cure = self._unseen
            raise TrackingLost(f"{reason}; {limit}" if reason else limit, cure)
        return newest

    def take_photos(self) -> tuple[Photo, ...]:
        """Return the pictures kept since the last call: one a second, unless the table says none."""
        return tuple(self._photos.popleft() for _ in range(len(self._photos)))

    def close(self) -> None:
        """Let go of the camera. Idempotent."""
        if self._process.stdin is not None and not self._process.stdin.closed:
            self._process.stdin.close()  # by which it ends
        try:
            self._process.wait(_LEAVE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._thread.is_alive():
            self._thread.join()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _start(self) -> messages.Ready:
        assert self._process.stdin is not None
        self._thread.start()
        self._process.stdin.write(msgspec.json.encode(self._table) + b"\n")
        self._process.stdin.flush()
        self._opened.wait(_OPENS_WITHIN_S)
        if isinstance(self._answer, str):
            raise UserError(self._answer)
        return self._answer

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.endswith(b"\n"):  # a process that was killed may leave half a line
                self._take(msgspec.json.decode(line, type=messages.News))
        self._end("the camera's process has ended")

    def _take(self, news: messages.News) -> None:
        match news:
            case messages.Seen():
                place = (news.x_m, news.y_m, self._table.tag.height_m)
                pose = Pose(news.t_s, place, news.yaw_rad, uncertainty_m=news.uncertainty_m)
                self._newest, self._unseen = pose, ("", "")
            case messages.Unseen():
                self._unseen = news.reason, news.cure
                if isinstance(self._newest, tuple):
                    self._newest = self._unseen
            case messages.Kept():
                self._photos.append(Photo(news.t_s, news.jpeg))
            case messages.Ready():
                self._answer = news
                self._opened.set()
            case messages.Refused() | messages.Ended():
                self._end(news.reason)

    def _end(self, reason: str) -> None:
        """Have no pose any more. The first reason is the true one."""
        if not self._is_over:
            self._newest, self._is_over = (reason, ""), True
        if not self._opened.is_set():
            self._answer = reason
            self._opened.set()
