"""The trackers by name: one row each.

A tracker is a folder beside ``stream/``:

- ``table.py``: a ``TrackerTable`` whose ``tag`` is the name; its fields are the keys of ``[tracker]`` in the
  robot's file.
- ``tracker.py``: a class with the methods of ``PoseTracker``.
- ``__init__.py``: the row, ``TRACKER = TrackerKind(table=..., open_tracker=..., make_feed=...)``. It may import
  ``table.py``; whatever is slow or an extra (opencv, an SDK) is imported within the functions, and an extra that is not
  installed is a UserError that names it.

Then add the name to ``TRACKERS``; a package of its own adds itself by an entry point of the group ``vvvaltr.trackers``
instead. ``vvvaltr mock DEVICE --tracker NAME`` sends a mock's poses through the row's ``make_feed``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Generic, Protocol, TypeVar

from vvvaltr.controller.core.plug_ins import Registry
from vvvaltr.controller.core.protocols import Tracker
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.table import TrackerTable

TableT = TypeVar("TableT", bound=TrackerTable)


class PoseTracker(Tracker, Protocol):
    """An open tracker."""

    def close(self) -> None:
        """Let go of socket, camera and threads. Idempotent."""
        ...


class PoseFeed(Protocol):
    """What a tracker sees in place of a real robot: a mock device tells it the poses of its twin.

    Both are called 50 times a second from one thread and must not block. Times are as ``time.monotonic()`` counts.
    """

    def send(self, pose: Pose) -> None:
        """Show the robot in this pose."""
        ...

    def send_lost(self, t_s: float) -> None:
        """Show that the tracker does not see the robot at ``t_s``."""
        ...

    def close(self) -> None:
        """Release everything. Idempotent."""
        ...


@dataclass(frozen=True, slots=True)
class MockFeed:
    """A running feed.

    Args:
        feed: takes the poses.
        table: what stands under ``[tracker]`` in the robot's file for a tracker that receives them.
        address: where they go, for a person to read.
    """

    feed: PoseFeed
    table: TrackerTable
    address: str


@dataclass(frozen=True, slots=True)
class TrackerKind(Generic[TableT]):
    """A kind of tracker.

    Args:
        table: the type of its table in a robot's file.
        open_tracker: returns the tracker of a table, receiving. The first pose may come later: ``pose`` raises
            TrackingLost until then. Raises ValueError for an address that cannot be used, UserError for what is not
            installed, LinkLost for a source that does not answer.
        make_feed: starts a mock source on this computer; None where there is none.
    """

    table: type[TableT]
    open_tracker: Callable[[TableT], PoseTracker]
    make_feed: Callable[[], MockFeed] | None = None


TRACKERS: Registry[TrackerKind[Any]] = Registry(
    noun="tracker",
    group="vvvaltr.trackers",
    kind=TrackerKind,
    built_in=MappingProxyType(
        {
            "stream": "vvvaltr.drivers.trackers.stream:TRACKER",
            "qtm": "vvvaltr.drivers.trackers.qtm:TRACKER",
            "natnet": "vvvaltr.drivers.trackers.natnet:TRACKER",
            "camera": "vvvaltr.drivers.trackers.camera:TRACKER",
        }
    ),
)


def open_tracker(table: TrackerTable) -> PoseTracker:
    """Open the tracker of a table. Raises as ``TrackerKind.open_tracker`` does."""
    return TRACKERS.named(str(table.__struct_config__.tag)).open_tracker(table)
