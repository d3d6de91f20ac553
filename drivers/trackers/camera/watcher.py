"""The process that looks through the camera: pictures in, lines about the robot out.

Run as ``python -m vvvaltr.drivers.trackers.camera.watcher``. Its first line of standard input is the camera's table; it
ends when its standard input does, which is when the controller ends, however that comes about.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
from contextlib import closing
from typing import IO

import msgspec

from vvvaltr.controller.core.errors import TrackingLost, UserError
from vvvaltr.drivers.trackers.camera import messages
from vvvaltr.drivers.trackers.camera.floor import FloorWatch
from vvvaltr.drivers.trackers.camera.opening import open_source
from vvvaltr.drivers.trackers.camera.setup import find_view
from vvvaltr.drivers.trackers.camera.sight import Sight, Sighting, Unseen
from vvvaltr.drivers.trackers.camera.source import Frame, NoMorePictures, NoPictureNow, Source
from vvvaltr.drivers.trackers.camera.table import CameraTable, TagTable
from vvvaltr.drivers.trackers.camera.tags import Picture

_CHECK_S = 0.5  # between two looks at a floor tag
_KEEP_S = 1.0  # between two pictures that are kept
_JPEG_QUALITY = 70


def main() -> None:
    """Look until there is nothing more to see, or nobody who listens."""
    # These reach all processes of a terminal, and the controller decides.
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGTSTP):
        signal.signal(number, signal.SIG_IGN)
    table = msgspec.json.decode(sys.stdin.buffer.readline(), type=CameraTable)
    threading.Thread(target=_end_with_controller, daemon=True).start()
    say = _Speech(sys.stdout.buffer)
    try:
        watch(table, say)
    except Exception as error:  # a defect of ours: told to the controller before it is shown
        say(messages.Ended(f"the camera's process failed: {type(error).__name__}: {error}"))
        raise


class _Speech:
    """Writes one message a line."""

    def __init__(self, out: IO[bytes]) -> None:
        self._out = out

    def __call__(self, news: messages.News) -> None:
        self._out.write(msgspec.json.encode(news) + b"\n")
        self._out.flush()


def watch(table: CameraTable, say: _Speech) -> None:
    """Open the camera of a table, and say what is seen until the pictures end."""
    import cv2

    cv2.setNumThreads(1)  # a second thread gains nothing in a small window, and takes the controller's processor
    try:
        source = open_source(table.source, table.wanted)
    except UserError as error:
        say(messages.Refused(str(error)))
        return
    with closing(source):
        try:
            sight = start_sight(table, source)
            say(_ready(source, sight))
            _look_on(table, source, sight, say)
        except UserError as error:
            say(messages.Refused(str(error)))
        except NoMorePictures as error:
            say(messages.Ended(str(error)))


def start_sight(table: CameraTable, source: Source) -> Sight:
    """Return what reads the pictures of a source. Raises UserError, NoMorePictures."""
    if table.lens is None:
        raise UserError("tracker.lens is missing; run vvvaltr camera ROBOT calibrate first")
    lens, applied = table.lens.lens, source.applied
    if (lens.width_px, lens.height_px) != (applied.width_px, applied.height_px):
        raise UserError(
            f"the pictures are {applied.width_px} x {applied.height_px} pixels, and the lens was calibrated at "
            f"{lens.width_px} x {lens.height_px}; set tracker.width_px and height_px to that, or calibrate again"
        )
    tag = table.robot_tag
    view = find_view(lens, tag, table.floor_m, table.camera_height_m, lambda: source.newest().grey)
    if view.position_m[2] <= tag.height_m:
        raise UserError(f"the camera would hang {view.position_m[2]:.2f} m high, below the tag; correct tag.size_m")
    return Sight(view, tag)


def _ready(source: Source, sight: Sight) -> messages.Ready:
    applied, view = source.applied, sight.view
    size = applied.width_px, applied.height_px
    return messages.Ready(*size, applied.rate_hz, applied.exposure_s, float(view.position_m[2]), view.error_m)


def _look_on(table: CameraTable, source: Source, sight: Sight, say: _Speech) -> None:
    keep_s = check_s = -math.inf
    floor, problem = FloorWatch(sight.view, table.floor_m), None
    while True:
        try:
            frame = source.newest()
        except NoPictureNow as none:
            say(messages.Unseen(time.monotonic(), str(none)))
            time.sleep(_CHECK_S)
            continue
        if frame.t_s >= check_s:
            check_s = frame.t_s + _CHECK_S
            problem = floor.check(frame.grey)
        say(_loss(frame, problem) if problem else _news(frame, sight, table.tag))
        if table.pictures and frame.t_s >= keep_s:
            keep_s = frame.t_s + _KEEP_S
            say(messages.Kept(frame.t_s, _jpeg(frame.grey)))


def _news(frame: Frame, sight: Sight, tag: TagTable) -> messages.Seen | messages.Unseen:
    try:
        seen = sight.read(frame.grey)
    except Unseen as unseen:
        return _loss(frame, unseen)
    return messages.Seen(frame.t_s, *robot_place(seen, tag), seen.uncertainty_m)


def _loss(frame: Frame, lost: TrackingLost) -> messages.Unseen:
    return messages.Unseen(frame.t_s, lost.reason, lost.cure)


def robot_place(seen: Sighting, tag: TagTable) -> tuple[float, float, float]:
    """Return x, y and yaw of the robot that carries the tag."""
    yaw_rad = math.remainder(seen.yaw_rad - tag.yaw_rad, math.tau)
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return seen.x_m - c * tag.x_m + s * tag.y_m, seen.y_m - s * tag.x_m - c * tag.y_m, yaw_rad


def _jpeg(grey: Picture) -> bytes:
    import cv2

    done, data = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not done:
        raise ValueError("a picture cannot be written as JPEG")
    return data.tobytes()


def _end_with_controller() -> None:
    while os.read(sys.stdin.fileno(), 4096):  # unbuffered: at exit a buffered file may not be in use
        pass
    os._exit(0)


if __name__ == "__main__":
    main()
