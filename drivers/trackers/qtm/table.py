"""The table of a rigid body that Qualisys Track Manager (QTM) tracks."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from vvvaltr.drivers.table import AgeLimit, NotNegative, TrackerTable
from vvvaltr.drivers.trackers.qtm.protocol import PORT


class QtmTable(TrackerTable, frozen=True, kw_only=True, tag="qtm"):
    """A rigid body in QTM.

    Args:
        host: the computer with QTM, by name or address.
        port: the little-endian port of its real-time output.
        body: name of the rigid body.
        rate_hz: how many frames a second to ask for; 0 for all.
        age_limit_s: a pose that is older is no longer the robot's.
    """

    host: Annotated[str, Meta(min_length=1)]
    port: Annotated[int, Meta(ge=1, le=65535)] = PORT
    body: Annotated[str, Meta(min_length=1)]
    rate_hz: NotNegative = 0.0
    age_limit_s: AgeLimit = 0.2
