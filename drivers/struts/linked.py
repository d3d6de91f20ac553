"""What the lines of all struts share: their links, and that none is left turning when one of the links is lost."""

from __future__ import annotations

import logging
import time
from abc import ABC, abstractmethod

from vvvaltr.controller.core.errors import LinkLost
from vvvaltr.controller.core.gaits import Quantity
from vvvaltr.drivers.links.gatt import GattLink, Word
from vvvaltr.drivers.struts.opening import wanted_of
from vvvaltr.drivers.struts.rescue import stop_runaways
from vvvaltr.drivers.struts.table import StrutsLineTable

_log = logging.getLogger(__name__)


class LinkedStruts(ABC):
    """The links to several struts, a motor each: the part of a ``MotorLine`` that does not depend on the firmware.

    Args:
        link: connected to all struts.
        table: of the line.
        stop: what stops a strut.
        reports: whether the struts send anything.
    """

    period_s = 0.05
    quantities = frozenset({Quantity.FREQUENCY})

    def __init__(self, link: GattLink, table: StrutsLineTable, stop: bytes, reports: bool) -> None:
        self._link = link
        self._table = table
        self._names = tuple(motor.strut for motor in table.motor)
        self._stop = stop
        self._reports = reports
        self._lost: set[int] = set()

    @property
    def name(self) -> str:
        """The adapter."""
        return self._link.name

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return len(self._names)

    def listen(self, until_s: float) -> None:
        """Receive reports and acknowledgements. Raises as ``MotorLine.listen`` does."""
        try:
            while (left_s := until_s - time.monotonic()) > 0.0:
                if (word := self._link.read(left_s)) is not None:
                    self._take(word)
        except LinkLost:
            self._stop_reachable()
            raise

    def close(self) -> None:
        """Release the links; a strut without a watchdog whose link was lost is looked for, and stopped."""
        self._link.close()
        wanted = wanted_of(self._table)
        runaways = [wanted[number] for number in sorted(self._lost) if not self._has_watchdog(number)]
        self._lost.clear()
        stop_runaways(self._table.adapter, runaways, self._stop, reports=self._reports)

    @abstractmethod
    def _take(self, word: Word) -> None:
        """Take a report or an acknowledgement. Raises DeviceFault for what it tells."""

    @abstractmethod
    def _has_watchdog(self, number: int) -> bool:
        """Return whether a strut stops by itself when its link is lost."""

    def _warn(self, danger: str) -> None:
        """Tell why the struts must be watched: once a command, however often it opens them."""
        _log.warning("%s; keep a hand at the switch of the struts", danger, extra={"once": True})

    def _stop_reachable(self) -> None:
        """Stop the other struts when the link of one is lost: nobody tells them anything after that."""
        for number in range(self.motor_count):
            try:
                self._link.write(number, self._stop, is_acknowledged=True)
            except LinkLost:
                self._lost.add(number)
