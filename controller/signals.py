"""Signals end the program the orderly way: through every `finally` that stops a motor."""

from __future__ import annotations

import signal
import time
from types import FrameType

_PATIENCE_S = 3.0  # how long a stop may take before a second signal may break into it


class _RaiseOnce:
    """Raises KeyboardInterrupt, but never into the clean-up that the previous signal began."""

    def __init__(self) -> None:
        self._raised_s = float("-inf")

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if time.monotonic() - self._raised_s > _PATIENCE_S:
            self._raised_s = time.monotonic()
            raise KeyboardInterrupt(signal.Signals(number).name)


def interrupt_on_signals() -> None:
    """Make SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt, also where a shell's background ignores SIGINT."""
    raise_once = _RaiseOnce()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, raise_once)
