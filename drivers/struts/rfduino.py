"""The radio boards of the thesis: an RFduino a strut, one byte a motor, one sense of rotation, no word back.

A text that the strut acknowledges counts as applied; that is also the only sign that it is there.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

from vvvaltr.controller.core.errors import DeviceTimeout, LinkLost, UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import MotorState
from vvvaltr.drivers.links.curve import Curve, to_commands
from vvvaltr.drivers.links.gatt import GattLink, Word
from vvvaltr.drivers.motor_line import Patience
from vvvaltr.drivers.struts.linked import LinkedStruts
from vvvaltr.drivers.struts.protocol import to_byte
from vvvaltr.drivers.struts.table import StrutsLineTable

DANGER = "an RFduino has no watchdog: its motor runs on when the radio link is lost or this program is killed"
_STALE_S, _SETTLE_S, _ANSWER_S = 0.8, 0.6, 1.0


def check_curves(table: StrutsLineTable) -> None:
    """Raise UserError for a motor without a curve: nobody knows how fast a byte turns it."""
    for motor in table.motor:
        if not motor.curve:
            raise UserError(f"strut {motor.strut} has no curve; run vvvaltr calibrate first")


class RfduinoLine(LinkedStruts):
    """The motors of several RFduino boards: satisfies ``vvvaltr.drivers.motor_line.MotorLine``."""

    watchdog_s = math.inf
    patience = Patience(stale_s=_STALE_S, settle_s=_SETTLE_S)

    def __init__(self, link: GattLink, table: StrutsLineTable) -> None:
        super().__init__(link, table, b"\0", reports=False)
        self._curves = tuple(Curve(motor.curve) for motor in table.motor)
        self._heard_s = [time.monotonic()] * len(self._names)
        self._applied = [0] * len(self._names)

    @property
    def heard_s(self) -> float:
        """When the strut that has been silent for longest acknowledged a byte."""
        return min(self._heard_s)

    def check(self, gait: Gait) -> None:
        """Raise ValueError for a negative frequency, or one beyond a calibration curve."""
        for number, frequency_hz in enumerate(gait.frequency_hz, start=1):
            if frequency_hz < 0.0:
                raise ValueError(
                    f"{self.name}, motor {number} of the line: {frequency_hz:g} Hz is negative, and an RFduino's motor "
                    "turns one way; search from 0 Hz up"
                )
        self._bytes(gait)

    def send(self, gait: Gait) -> None:
        """Send each strut its byte, to be acknowledged."""
        self._tell(self._bytes(gait))

    repeat = send

    def rest(self) -> None:
        """Send each strut a 0."""
        self._tell((0,) * self.motor_count)

    def state(self) -> MotorState:
        """Return the frequencies of the bytes that were acknowledged."""
        applied_hz = tuple(c.frequency_hz(value) for c, value in zip(self._curves, self._applied, strict=True))
        return MotorState(self.heard_s, applied_hz, measured=False)

    def arm(self) -> None:
        """Stop the motors. Raises as ``open_line`` does."""
        self._warn(DANGER)
        self.rest()
        silent = set(range(self.motor_count))
        end_s = time.monotonic() + _ANSWER_S
        while silent:
            if (word := self._link.read(max(0.0, end_s - time.monotonic()))) is not None:
                self._take(word)
                silent.discard(word.strut)
            elif time.monotonic() >= end_s:
                raise DeviceTimeout(
                    f"strut {self._names[min(silent)]} does not acknowledge a byte; switch it off and on"
                )

    def _take(self, word: Word) -> None:
        if word.acknowledges and len(word.text) == 1:
            self._heard_s[word.strut] = word.heard_s
            self._applied[word.strut] = word.text[0]

    def _has_watchdog(self, number: int) -> bool:
        return False

    def _bytes(self, gait: Gait) -> tuple[int, ...]:
        return tuple(map(to_byte, to_commands(self._curves, gait.frequency_hz, self.name)))

    def _tell(self, values: Sequence[int]) -> None:
        try:
            for number, value in enumerate(values):
                self._link.write(number, bytes([value]), is_acknowledged=True)
        except LinkLost:
            self._stop_reachable()
            raise
