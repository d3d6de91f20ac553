"""Signals end the program the orderly way: through every `finally` that stops a motor."""

from __future__ import annotations

import signal
import sys
import threading
import time
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

_STOPPING_S = 3.0  # how long a stop may take before a second signal may break into it
_RETRY_AFTER_S = 0.001
_SHOW_UNRAISABLE = sys.unraisablehook  # of the program that this one runs in
# What is raised there is dropped, and leaves things half done: pymunk's finalizers take shapes out of a space by
# callbacks from C, and without one of them free a space with a shape in it, whose finalizer then reads freed memory.
# Imports are finished, too: modules of others catch everything there, and go on with half of what they need.
_UNBREAKABLE_MODULES = frozenset({"pymunk", "weakref", "importlib"})
_FINALIZER = "__del__"


class _RaiseOnce:
    """Raises KeyboardInterrupt, but never into the clean-up that the previous signal began."""

    def __init__(self) -> None:
        self._raised_s = float("-inf")
        self._name = ""

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if time.monotonic() - self._raised_s > _STOPPING_S:
            self._raised_s = time.monotonic()
            self._name = signal.Signals(number).name
            self._raise(frame)

    def raise_later(self, unraisable: UnraisableHookArgs) -> None:
        """Schedule an interrupt that Python dropped, because it came where nothing can be raised, once more."""
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, _RETRY_AFTER_S)
        else:
            _SHOW_UNRAISABLE(unraisable)

    def raise_again(self, number: int, frame: FrameType | None) -> None:
        """Raise the interrupt that was dropped or put off."""
        self._raise(frame)

    def _raise(self, frame: FrameType | None) -> None:
        if _is_unbreakable(frame):
            signal.setitimer(signal.ITIMER_REAL, _RETRY_AFTER_S)
        else:
            raise KeyboardInterrupt(self._name)


def _is_unbreakable(frame: FrameType | None) -> bool:
    """Return whether a finalizer, a callback from C or an import is at work, in ``frame`` or in what called it."""
    while frame is not None:
        module = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if module in _UNBREAKABLE_MODULES or frame.f_code.co_name == _FINALIZER:
            return True
        frame = frame.f_back
    return False


def interrupt_on_signals() -> None:
    """Make SIGINT, SIGQUIT, SIGTERM and SIGHUP raise KeyboardInterrupt, even where a background job ignores SIGINT.

    A SIGHUP that is ignored, as under nohup, stays so: the program is to outlast its terminal.

    Python drops an exception that is raised in a finalizer or in a callback from C, and the motors would run on. An
    interrupt that comes there is put off, or raised again if it was dropped, until 1 ms later, by SIGALRM.
    """
    raise_once = _RaiseOnce()
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, raise_once)
    signal.signal(signal.SIGALRM, raise_once.raise_again)
    sys.unraisablehook = raise_once.raise_later


def interrupt_on_suspension() -> None:
    """From now on, treat Ctrl-Z (SIGTSTP) as the other signals: a suspended program stops no motor.

    For a program that has motors. One that left its signals as they are, or ignores SIGTSTP, keeps that.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    handler = signal.getsignal(signal.SIGINT)
    if isinstance(handler, _RaiseOnce) and signal.getsignal(signal.SIGTSTP) is signal.SIG_DFL:
        signal.signal(signal.SIGTSTP, handler)
