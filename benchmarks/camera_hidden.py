"""A camera's tracker in real time: a robot that is hidden again and again, and set-points beside it."""

from __future__ import annotations

import bisect
import math
import random
import tempfile
import threading
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.camera.feed import make_feed
from vvvaltr.drivers.trackers.camera.table import CameraTable

if TYPE_CHECKING:
    from vvvaltr.drivers.trackers.registry import PoseFeed


@dataclass(slots=True)
class _Told:
    """What the feed is told: where the robot is, or nothing; noted before, and with the time at which it was sent."""

    noted_s: float
    place_m: tuple[float, float] | None
    sent_s: float = math.inf


class Shown(threading.Thread):
    """Tells a feed 50 poses a second: of a robot that shakes and creeps, or that a hand hides it."""

    def __init__(self, feed: PoseFeed) -> None:
        super().__init__(daemon=True)
        self._feed = feed
        self.is_hidden = False
        self.is_over = threading.Event()
        self.told: list[_Told] = []

    @staticmethod
    def place(t_s: float) -> tuple[float, float]:
        """Return where the robot is at ``t_s``."""
        return 0.2 * math.sin(0.2 * t_s) + 0.001 * math.sin(60.0 * t_s), 0.1 * math.cos(0.3 * t_s)

    def run(self) -> None:
        """Tell poses until it is over."""
        while not self.is_over.wait(0.02):
            now_s = time.monotonic()
            place = None if self.is_hidden else self.place(now_s)
            self.told.append(told := _Told(now_s, place))
            if place is None:
                self._feed.send_lost(now_s)
            else:
                self._feed.send(Pose(now_s, (*place, 0.04), 0.3))
            told.sent_s = time.monotonic()

    def hide(self) -> None:
        """Hide the robot, and return once that has been told."""
        self.is_hidden = True
        while self.told[-1].place_m is not None or self.told[-1].sent_s == math.inf:
            time.sleep(0.002)

    def is_true(self, pose: Pose) -> bool:
        """Whether the robot was to be seen, and there, at the time of ``pose``: pictures show what was told last."""
        last = bisect.bisect_right(self.told, pose.t_s, key=lambda each: each.noted_s) - 1
        while last > 0 and not self._is_at(self.told[last], pose) and self.told[last].sent_s > pose.t_s:
            last -= 1  # this one was noted, and not yet told
        return self._is_at(self.told[max(0, last)], pose)

    @staticmethod
    def _is_at(told: _Told, pose: Pose) -> bool:
        return told.place_m is not None and math.dist(told.place_m, pose.position_m[:2]) < 0.001


def occlusions(count: int) -> dict[str, Any]:
    """Hide the robot ``count`` times for longer than the age limit: in real time, through the tracker's process."""
    from vvvaltr.drivers.trackers.camera.tracker import CameraTracker

    dice, lost, untrue, looks = random.Random(0), 0, 0, 0
    mock = make_feed()
    table = mock.table
    assert isinstance(table, CameraTable)
    shown = Shown(mock.feed)
    shown.start()
    try:
        with closing(CameraTracker(table)) as tracker:
            for _ in range(count):
                _until_seen(tracker)
                shown.hide()
                ends_s = time.monotonic() + table.age_limit_s + dice.uniform(0.1, 0.3)
                found = _watch(tracker, ends_s)
                looks += len(found)
                lost += found[-1] is None
                untrue += sum(pose is not None and not shown.is_true(pose) for pose in found)
                shown.is_hidden = False
    finally:
        shown.is_over.set()
        shown.join()
        mock.feed.close()
    return {"occlusions": count, "lost": lost, "held_or_invented": untrue, "looks": looks}


def set_points(duration_s: float) -> dict[str, float]:
    """Return the longest time between two set-points at a qik board in ms, with no camera and then with one.

    The controller's process learns without a pause, as in ``benchmarks.hil``. The mock's camera, which draws 50
    pictures a second, takes more of the machine than a real one.
    """
    from benchmarks.hil import measure_longest_gaps
    from benchmarks.observed import ObservedDevice
    from vvvaltr.controller.robot.hardware import open_hardware
    from vvvaltr.controller.robot.robot_file import load_robot_file
    from vvvaltr.drivers.trackers.camera.tracker import CameraTracker

    figures = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        ObservedDevice("qik", Path(folder, "qik")) as device,
        closing(open_hardware(load_robot_file(device.robot_file))) as robot,
    ):
        gaps = measure_longest_gaps([device], [robot], duration_s)
        figures["without_camera_ms"] = gaps["set_point_longest_gap_ms"]
        mock = make_feed()
        assert isinstance(mock.table, CameraTable)
        shown = Shown(mock.feed)
        shown.start()
        with closing(CameraTracker(mock.table)):
            gaps = measure_longest_gaps([device], [robot], duration_s)
            figures["with_camera_ms"] = gaps["set_point_longest_gap_ms"]
            figures["device_longest_pause_ms"] = gaps["device_longest_pause_ms"]
        shown.is_over.set()
        shown.join()
        mock.feed.close()
    return {name: round(figure, 2) for name, figure in figures.items()}


def _until_seen(tracker: Any) -> None:
    ends_s = time.monotonic() + 30.0
    while True:
        try:
            tracker.pose()
            return
        except TrackingLost:
            if time.monotonic() > ends_s:
                raise
        time.sleep(0.01)


def _watch(tracker: Any, ends_s: float) -> list[Pose | None]:
    found: list[Pose | None] = []
    is_last = False
    while not is_last:
        is_last = time.monotonic() > ends_s  # the last look comes after the end, however busy the machine is
        try:
            found.append(tracker.pose())
        except TrackingLost:
            found.append(None)
        time.sleep(0.01)
    return found
