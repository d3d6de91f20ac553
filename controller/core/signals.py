"""Signals end the program the orderly way: through every `finally` that stops a motor."""

from __future__ import annotations

import signal
import sys
import time
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

_PATIENCE_S = 3.0  # how long a stop may take before a second signal may break into it
_SOON_S = 0.001
_SHOW = sys.unraisablehook  # of the program that this one runs in


class _RaiseOnce:
    """Raises KeyboardInterrupt, but never into the clean-up that the previous signal began."""

    def __init__(self) -> None:
        self._raised_s = float("-inf")
        self._name = ""

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if time.monotonic() - self._raised_s > _PATIENCE_S:
            self._raised_s = time.monotonic()
            self._name = signal.Signals(number).name
            raise KeyboardInterrupt(self._name)

    def retry(self, unraisable: UnraisableHookArgs) -> None:
        """Have the interrupt raised soon again that Python dropped: it came where nothing can be raised."""
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, _SOON_S)
        else:
            _SHOW(unraisable)

    def again(self, number: int, frame: FrameType | None) -> None:
        """Raise what was dropped."""
        raise KeyboardInterrupt(self._name)


def interrupt_on_signals() -> None:
    """Make SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt, also where a shell's background ignores SIGINT.

    An interrupt that comes while a finalizer or a callback from C runs would be lost, and the motors would run on: it
    is raised again, with the help of SIGALRM.
    """
    raise_once = _RaiseOnce()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, raise_once)
    signal.signal(signal.SIGALRM, raise_once.again)
    sys.unraisablehook = raise_once.retry
