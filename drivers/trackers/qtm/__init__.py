"""Qualisys: poses from Qualisys Track Manager (QTM) over its real-time protocol."""

from __future__ import annotations

from vvvaltr.controller.core.errors import UserError
from vvvaltr.drivers.trackers.qtm.table import QtmTable
from vvvaltr.drivers.trackers.registry import MockFeed, PoseTracker, TrackerKind


def _open_tracker(table: QtmTable) -> PoseTracker:
    try:
        import qtm_rt  # noqa: F401
    except ModuleNotFoundError:
        raise UserError("Qualisys' client library is not installed; run: pip install 'vvvaltr[qtm]'") from None
    from vvvaltr.drivers.trackers.qtm.tracker import QtmTracker

    return QtmTracker(table.host, table.port, body=table.body, rate_hz=table.rate_hz, age_limit_s=table.age_limit_s)


def _make_feed() -> MockFeed:
    from vvvaltr.drivers.trackers.qtm.mock import HOST, QtmServer

    server = QtmServer()
    return MockFeed(
        server, QtmTable(host=HOST, port=server.port, body=server.bodies[-1]), address=f"{HOST}:{server.port}"
    )


TRACKER = TrackerKind(table=QtmTable, open_tracker=_open_tracker, make_feed=_make_feed)
