"""The motor node: closed-loop motors on a microcontroller, on a serial line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.drivers.node.table import NodeLineTable
from vvvaltr.drivers.registry import Driver, MockLine

if TYPE_CHECKING:
    from vvvaltr.drivers.node.line import NodeLine


def _open_line(table: NodeLineTable) -> NodeLine:
    from vvvaltr.drivers.node.line import open_line

    return open_line(table)


def _make_mock(link: Path) -> MockLine:
    from vvvaltr.drivers.node.mock import make_mock

    return make_mock(link)


def _make_fast_mock(link: Path, max_hz: float) -> MockLine:
    from vvvaltr.drivers.node.mock import make_mock

    return make_mock(link, max_hz)


DRIVER = Driver(NodeLineTable, _open_line, make_mock=_make_mock, make_fast_mock=_make_fast_mock)
