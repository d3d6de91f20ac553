"""The wall clock."""

from __future__ import annotations

import time
from collections.abc import Callable


class WallClock:
    """Real time. Consecutive sleeps keep to absolute deadlines, so that lateness does not add up.

    Args:
        wait: lets so many seconds pass; what it raises ends a sleep.
    """

    def __init__(self, wait: Callable[[float], None] = time.sleep) -> None:
        self._deadline_s = time.monotonic()
        self._wait = wait

    def now_s(self) -> float:
        """Seconds since an arbitrary start; never goes back."""
        return time.monotonic()

    def sleep(self, duration_s: float) -> None:
        """Sleep until ``duration_s`` after the last deadline, or after now if that deadline has long passed."""
        now_s = time.monotonic()
        # Work between two sleeps counts as slept; a pause longer than the sleep itself starts a new rhythm.
        start_s = self._deadline_s if now_s - self._deadline_s < duration_s else now_s
        self._deadline_s = start_s + duration_s
        self._wait(max(0.0, self._deadline_s - now_s))
