"""An overhead camera that sees an AprilTag on the robot (extra ``camera``: OpenCV, imported only where it is used)."""

from __future__ import annotations

from vvvaltr.drivers.trackers.camera.table import CameraTable
from vvvaltr.drivers.trackers.registry import MockFeed, PoseTracker, TrackerKind


def _open_tracker(table: CameraTable) -> PoseTracker:
    from vvvaltr.drivers.trackers.camera.tracker import CameraTracker

    return CameraTracker(table)


def _make_feed() -> MockFeed:
    from vvvaltr.drivers.trackers.camera.feed import make_feed

    return make_feed()


TRACKER = TrackerKind(table=CameraTable, open_tracker=_open_tracker, make_feed=_make_feed)
