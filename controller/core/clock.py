"""The wall clock."""

from __future__ import annotations

import time


class WallClock:
    """Real time. Consecutive sleeps keep to absolute deadlines, so that lateness does not add up."""

    def __init__(self) -> None:
        self._deadline_s = time.monotonic()

    def now_s(self) -> float:
        """Seconds since an arbitrary start; never goes back."""
        return time.monotonic()

    def sleep(self, duration_s: float) -> None:
        """Sleep until ``duration_s`` after the last deadline, or after now if that deadline has long passed."""
        now_s = time.monotonic()
        # Work between two sleeps counts as slept; a pause longer than the sleep itself starts a new rhythm.
        start_s = self._deadline_s if now_s - self._deadline_s < duration_s else now_s
        self._deadline_s = start_s + duration_s
        time.sleep(max(0.0, self._deadline_s - now_s))
