"""The table of a rigid body that OptiTrack's Motive tracks."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from vvvaltr.drivers.table import AgeLimit, TrackerTable
from vvvaltr.drivers.trackers.natnet.protocol import COMMAND_PORT, DATA_PORT

Port = Annotated[int, Meta(ge=1, le=65535)]


class NatnetTable(TrackerTable, frozen=True, kw_only=True, tag="natnet"):
    """A rigid body in Motive, or in any other server that speaks NatNet.

    Args:
        host: the computer with Motive, by name or address.
        port: its command port.
        body: name of the rigid body.
        multicast: the group that frames are sent to; empty for unicast.
        data_port: the port of the group; of no concern with unicast.
        up: the axis that points upwards in Motive's streaming settings.
        age_limit_s: a pose that is older is no longer the robot's.
    """

    host: Annotated[str, Meta(min_length=1)]
    port: Port = COMMAND_PORT
    body: Annotated[str, Meta(min_length=1)]
    multicast: str = ""
    data_port: Port = DATA_PORT
    up: Literal["y", "z"] = "y"
    age_limit_s: AgeLimit = 0.2
