"""The tables of ODrive axes in a robot's file."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import msgspec
from msgspec import Meta

from vvvaltr.drivers.table import LineTable, MotorTable, NotNegative


class Firmware(StrEnum):
    """Firmware generations, which number their errors differently."""

    OLD = "0.5"
    NEW = "0.6"


class OdriveMotorTable(MotorTable, frozen=True, kw_only=True):
    """An axis by its CAN node, with its current limit in A; 0 for the limit in the drive's configuration."""

    node: Annotated[int, Meta(ge=0, le=63)]
    max_a: NotNegative = 0.0

    @property
    def place(self) -> str:
        """The node."""
        return f"node {self.node}"


class OdriveLineTable(LineTable, frozen=True, kw_only=True, tag="odrive"):
    """ODrive axes on a CAN bus; interface, channel, bitrate and options as python-can takes them."""

    interface: str = "socketcan"
    channel: str
    bitrate: Annotated[int, Meta(gt=0)] = 500_000
    firmware: Firmware = Firmware.NEW
    options: dict[str, bool | int | float | str] = msgspec.field(default_factory=dict)
    motor: tuple[OdriveMotorTable, ...]
