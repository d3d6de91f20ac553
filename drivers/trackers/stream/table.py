"""The table of a tracker that receives poses over UDP."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from vvvaltr.drivers.table import Positive, TrackerTable


class StreamTable(TrackerTable, frozen=True, kw_only=True, tag="stream"):
    """Poses over UDP; ``host`` and ``port`` are the address to listen on.

    Args:
        host: the loopback address lets no other computer in.
        port: UDP port; 0 for any free one.
        age_limit_s: a pose that is older is no longer the robot's.
    """

    host: str = "127.0.0.1"
    port: Annotated[int, Meta(ge=0, le=65535)]
    age_limit_s: Positive = 0.2
