"""The Pololu qik 2s9v1, the published robot's motor controller, on a serial line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.drivers.qik.table import QikLineTable
from vvvaltr.drivers.registry import Driver, MockLine

if TYPE_CHECKING:
    from vvvaltr.drivers.qik.line import QikLine


def _open_line(table: QikLineTable) -> QikLine:
    from vvvaltr.drivers.qik.line import open_line

    return open_line(table)


def _make_mock(link: Path) -> MockLine:
    from vvvaltr.drivers.qik.mock import make_mock

    return make_mock(link)


DRIVER = Driver(table=QikLineTable, open_line=_open_line, make_mock=_make_mock)
