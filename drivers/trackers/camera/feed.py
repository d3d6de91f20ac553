"""A mock robot under a camera: a process that draws the poses it is told, for a tracker that looks at the pictures.

Run as ``python -m vvvaltr.drivers.trackers.camera.feed PATH``: it tells the UDP port on which it takes poses, writes
pictures to PATH, and ends when its standard input does.
"""

from __future__ import annotations

import math
import os
import select
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.values import Pose, Vector
from vvvaltr.drivers.mocking.plugged import be_prompt
from vvvaltr.drivers.trackers.camera.frames import FrameWriter
from vvvaltr.drivers.trackers.camera.lens import Lens
from vvvaltr.drivers.trackers.camera.pictures import Painter
from vvvaltr.drivers.trackers.camera.sight import RobotTag
from vvvaltr.drivers.trackers.camera.table import CameraTable, FloorTagTable, TagTable, lens_table
from vvvaltr.drivers.trackers.camera.view import View
from vvvaltr.drivers.trackers.registry import MockFeed
from vvvaltr.drivers.trackers.stream.message import decode_pose
from vvvaltr.drivers.trackers.stream.tracker import PoseSender
from vvvaltr.drivers.trackers.stream.wire import LOOPBACK

LENS = Lens(1280, 720, (1013.0, 1013.0), (643.0, 357.0), (-0.2, 0.05, 0.0005, -0.0003, 0.0))
"""A webcam's: 65 degrees wide."""
TAG = RobotTag(0, 0.04, 0.06)
FLOOR_M = {1: (-0.45, -0.24), 2: (0.45, -0.24), 3: (0.45, 0.24), 4: (-0.45, 0.24)}
_HEIGHT_M, _TILTS_RAD = 1.0, (math.radians(3.0), math.radians(1.0))
_PICTURE_S = 0.02  # a mock tells 50 poses a second; a camera as fast as that also sees how fast the motors turn
_OUTSIDE_PX, _STILL_M, _CARRIED_AFTER_S = 12, 0.004, 2.0
_SHORTEST_S = 0.005  # between two poses that tell a speed
_LONGEST_BYTES = 65536
_LEAVE_S = 5.0


def mock_view(lens: Lens = LENS, height_m: float = _HEIGHT_M) -> View:
    """Return a camera that hangs a little askew and looks at the origin."""
    (ca, sa), (cb, sb) = ((math.cos(tilt), math.sin(tilt)) for tilt in _TILTS_RAD)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, ca, -sa], [0.0, sa, ca]])
    about_y = np.array([[cb, 0.0, sb], [0.0, 1.0, 0.0], [-sb, 0.0, cb]])
    rotation: Array = about_x @ about_y @ np.diag([1.0, -1.0, -1.0])
    # Along the view (the rotation's last row) from the origin backwards, until that high.
    return View(lens, rotation, rotation[2] * height_m / rotation[2, 2])


def make_feed() -> MockFeed:
    """Start the process, and return what tells it poses, and the table of a tracker that sees its pictures.

    Raises:
        UserError: it did not start.
    """
    folder = Path(tempfile.mkdtemp(prefix="vvvaltr-camera-"))
    path = folder / "frames"
    try:
        feed = PictureFeed(path)
    except BaseException:
        shutil.rmtree(folder)
        raise
    floor = tuple(FloorTagTable(id=number, x_m=x_m, y_m=y_m) for number, (x_m, y_m) in FLOOR_M.items())
    tag = TagTable(id=TAG.id, size_m=TAG.size_m, height_m=TAG.height_m)
    table = CameraTable(source=f"frames:{path}", rate_hz=1.0 / _PICTURE_S, tag=tag, floor=floor, lens=lens_table(LENS))
    return MockFeed(feed, table, f"frames:{path}")


class PictureFeed:
    """Tells poses to the process that draws them: satisfies ``PoseFeed``.

    Args:
        path: where the pictures go; its folder is removed by ``close``.

    Raises:
        UserError: the process did not start.
    """

    def __init__(self, path: Path) -> None:
        self._folder = path.parent
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, str(path)], stdin=pipe, stdout=pipe, start_new_session=True
        )
        assert self._process.stdout is not None
        port = self._process.stdout.readline().strip()
        if not port.isdigit():
            self._process.kill()
            raise UserError("the mock's camera did not start; is OpenCV installed? pip install 'vvvaltr[camera]'")
        self._sender = PoseSender(LOOPBACK, int(port))
        self.send, self.send_lost = self._sender.send, self._sender.send_lost

    def close(self) -> None:
        """End the process, and leave nothing behind. Idempotent."""
        self._sender.close()
        self._process.communicate(timeout=_LEAVE_S)
        shutil.rmtree(self._folder, ignore_errors=True)


class Scene:
    """Draws a picture for what has come from the mock.

    A robot that lies outside the picture is carried back into its middle after a while.
    """

    def __init__(self, painter: Painter, view: View) -> None:
        self._painter, self._view = painter, view
        self._rest_z_m: float | None = None
        self._last: Pose | None = None
        self._is_hidden = False
        self._origin_m, self._still_m, self._still_s = (0.0, 0.0), (0.0, 0.0), 0.0

    def picture(self, pose: Pose | None) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
        """Return the picture of a pose; of None, a hand over where the robot was last."""
        self._is_hidden = pose is None
        if pose is None:
            where = self._shown(self._last, 0.0)[:2] if self._last else (0.0, 0.0)
            return self._painter.picture(None, hand_m=where)
        if self._rest_z_m is None:
            self._rest_z_m = pose.position_m[2]
        velocity, self._last = self._velocity(pose), pose
        # The card stands over the robot's centre: at its height while the robot rests as at the start.
        self._carry_back(pose)
        lifted = replace(pose, position_m=self._shown(pose, TAG.height_m + pose.position_m[2] - self._rest_z_m))
        struts = [(end, end + 1) for end in range(0, len(pose.markers_m) - 1, 2)]
        return self._painter.picture(lifted, velocity, struts)

    def at_rest(self, t_s: float) -> Pose | None:
        """Return the last pose, still the same at ``t_s``; None before the first, and while a hand hides the robot."""
        return replace(self._last, t_s=t_s) if self._last and not self._is_hidden else None

    def _shown(self, pose: Pose, z_m: float) -> Vector:
        return pose.position_m[0] - self._origin_m[0], pose.position_m[1] - self._origin_m[1], z_m

    def _carry_back(self, pose: Pose) -> None:
        """Put a robot that lies still outside the picture into its middle."""
        here_m = pose.position_m[:2]
        x_px, y_px = self._view.pixels(np.array([self._shown(pose, TAG.height_m)]))[0]
        lens = self._view.lens
        is_inside = (
            _OUTSIDE_PX < x_px < lens.width_px - _OUTSIDE_PX and _OUTSIDE_PX < y_px < lens.height_px - _OUTSIDE_PX
        )
        if is_inside or math.dist(here_m, self._still_m) > _STILL_M:
            self._still_m, self._still_s = here_m, pose.t_s
        elif pose.t_s - self._still_s > _CARRIED_AFTER_S:
            self._origin_m = here_m

    def note(self, pose: Pose) -> None:
        """Take in a pose that is not drawn."""
        self._last = pose

    def _velocity(self, pose: Pose) -> Vector:
        if self._last is None or not _SHORTEST_S < (step_s := pose.t_s - self._last.t_s) < 0.1:
            return (0.0, 0.0, 0.0)
        x, y, z = ((here - there) / step_s for here, there in zip(pose.position_m, self._last.position_m, strict=True))
        return x, y, z


def main() -> None:
    """Draw until nobody listens."""
    import cv2

    cv2.setNumThreads(1)
    be_prompt()  # no camera waits for the computer that it is plugged into
    threading.Thread(target=_end_with_input, daemon=True).start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inbox, closing(_writer(Path(sys.argv[1]))) as writer:
        inbox.bind((LOOPBACK, 0))
        scene = Scene(Painter(mock_view(), TAG, FLOOR_M), mock_view())
        writer.write(time.monotonic(), scene.picture(None))
        sys.stdout.write(f"{inbox.getsockname()[1]}\n")
        sys.stdout.flush()
        _draw_all(inbox, scene, writer)


def _writer(path: Path) -> FrameWriter:
    return FrameWriter(path, LENS.width_px, LENS.height_px, 1.0 / _PICTURE_S)


def _draw_all(inbox: socket.socket, scene: Scene, writer: FrameWriter) -> None:
    inbox.settimeout(2.0 * _PICTURE_S)
    while True:
        began_s = time.monotonic()
        try:
            pose = _newest(inbox, scene)
        except TimeoutError:  # a camera goes on to give pictures; what has come since then, it does not know
            pose = scene.at_rest(began_s)
        writer.write(pose.t_s if pose else time.monotonic(), scene.picture(pose))


def _newest(inbox: socket.socket, scene: Scene) -> Pose | None:
    """Return the newest pose that has come, None where the robot is hidden: a slow painter falls no further behind."""
    pose = decode_pose(inbox.recv(_LONGEST_BYTES)).pose
    while select.select([inbox], [], [], 0.0)[0]:
        if pose:
            scene.note(pose)
        pose = decode_pose(inbox.recv(_LONGEST_BYTES)).pose
    return pose


def _end_with_input() -> None:
    while os.read(sys.stdin.fileno(), 4096):  # unbuffered: at exit a buffered file may not be in use
        pass
    os._exit(0)


if __name__ == "__main__":
    main()
