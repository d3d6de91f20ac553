"""Time stamps of another clock converted to this computer's, so that a delayed message does not pass for a new one."""

from __future__ import annotations

import math
import statistics
from collections import deque

_DRIFT = 2e-4  # the greatest drift of two clocks against each other
_REMEMBERED = 512  # messages


class RemoteClock:
    """Estimates the offset of the two clocks from the message with the shortest latency."""

    def __init__(self) -> None:
        self._offset_s = math.inf
        self._last_s = 0.0
        self._delays_s: deque[float] = deque(maxlen=_REMEMBERED)

    @property
    def offset_s(self) -> float:
        """The other clock minus this computer's; NaN before the first message.

        It is too small by the time that the quickest message was under way.
        """
        return -self._offset_s if math.isfinite(self._offset_s) else math.nan

    @property
    def jitter_s(self) -> float:
        """Standard deviation of the times that the last messages were under way; NaN before the first one."""
        delays_s = self._delays_s.copy()  # in one step, for another thread goes on to fill it
        return statistics.pstdev(delays_s) if delays_s else math.nan

    def here_s(self, there_s: float, received_s: float) -> float:
        """Return when, on this computer's clock, the other clock showed ``there_s``.

        Args:
            there_s: the time stamp of the message, on a clock that never goes back.
            received_s: when the message came, on this computer's clock.
        """
        # The offset may creep, for clocks drift, but too slowly to absorb a lasting delay within a trial.
        creep_s = _DRIFT * max(0.0, there_s - self._last_s)
        self._last_s = there_s
        self._offset_s = min(self._offset_s + creep_s, received_s - there_s)
        self._delays_s.append(received_s - there_s - self._offset_s)
        return self._offset_s + there_s
