"""Poses as JSON over UDP: what any laboratory's tracker can be made to send, and what the mock devices send."""

from __future__ import annotations

from vvvaltr.drivers.trackers.registry import MockFeed, PoseTracker, TrackerKind
from vvvaltr.drivers.trackers.stream.table import StreamTable


def _open_tracker(table: StreamTable) -> PoseTracker:
    from vvvaltr.drivers.trackers.stream.tracker import StreamTracker

    return StreamTracker(table)


def _make_feed() -> MockFeed:
    from vvvaltr.drivers.trackers.stream.tracker import PoseSender, find_free_port
    from vvvaltr.drivers.trackers.stream.wire import LOOPBACK

    port = find_free_port()
    return MockFeed(PoseSender(LOOPBACK, port), StreamTable(host=LOOPBACK, port=port), f"{LOOPBACK}:{port}")


TRACKER = TrackerKind(table=StreamTable, open_tracker=_open_tracker, make_feed=_make_feed)
