"""The table of a tracker that receives poses over UDP."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from vvvaltr.drivers.table import AgeLimit, TrackerTable
from vvvaltr.drivers.trackers.stream.message import AngleUnit, Unit, Up


class StreamTable(TrackerTable, frozen=True, kw_only=True, tag="stream"):
    """Poses over UDP; ``host`` and ``port`` are the address to listen on.

    Args:
        host: the loopback address lets no other computer in; a multicast group is joined.
        port: UDP port; 0 for any free one.
        interface: name or address of the network interface on which a group is joined; empty for all.
        name: of the robot's body, as the poses tell it; others are ignored. Empty where one body is sent.
        unit: of the positions.
        up: the axis that points upwards.
        yaw_unit: of yaw, pitch and roll.
        age_limit_s: a pose that is older is no longer the robot's.
    """

    host: str = "127.0.0.1"
    port: Annotated[int, Meta(ge=0, le=65535)]
    interface: str = ""
    name: str = ""
    unit: Unit = "m"
    up: Up = "z"
    yaw_unit: AngleUnit = "rad"
    age_limit_s: AgeLimit = 0.2
