"""The tables of a motor node in a robot's file."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from vvvaltr.drivers.table import LineTable, MotorTable


class NodeMotorTable(MotorTable, frozen=True, kw_only=True):
    """A motor of a motor node; the node numbers them in the order of the file."""


class NodeLineTable(LineTable, frozen=True, kw_only=True, tag="node"):
    """A motor node on a serial line."""

    port: str
    baud: Annotated[int, Meta(gt=0)] = 460_800
    motor: tuple[NodeMotorTable, ...]
