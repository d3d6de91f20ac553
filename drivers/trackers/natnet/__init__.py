"""OptiTrack: poses from Motive over the NatNet protocol."""

from __future__ import annotations

from vvvaltr.drivers.trackers.natnet.table import NatnetTable
from vvvaltr.drivers.trackers.registry import MockFeed, PoseTracker, TrackerKind


def _open_tracker(table: NatnetTable) -> PoseTracker:
    from vvvaltr.drivers.trackers.natnet.tracker import NatnetTracker

    return NatnetTracker(table)


def _make_feed() -> MockFeed:
    from vvvaltr.drivers.trackers.natnet.mock import HOST, NatnetServer

    server = NatnetServer()
    table = NatnetTable(host=HOST, port=server.port, body=server.bodies[-1])
    return MockFeed(server, table, f"{HOST}:{server.port}")


TRACKER = TrackerKind(table=NatnetTable, open_tracker=_open_tracker, make_feed=_make_feed)
