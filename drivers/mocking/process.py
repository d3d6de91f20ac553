"""A mock device in a process of its own: for tests of drivers, also in other packages, and for benchmarks."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Self

import msgspec

from vvvaltr.drivers.mocking.faults import Fault

_ENDING_S = 30.0
_PROGRAM = "from vvvaltr.entry import main; main()"


class Greeting(msgspec.Struct, frozen=True):
    """The first line of a mock."""

    port: str
    robot_file: str
    tracker: str


class Status(msgspec.Struct, frozen=True):
    """State of the device; the time is as ``time.monotonic()`` counts.

    ``place_m`` is where its robot truly is, whatever the tracker shows.
    """

    t_s: float
    applied_hz: tuple[float, ...]
    watchdog: bool
    faults: tuple[str, ...]
    place_m: tuple[float, float, float] | None = None

    @property
    def is_at_rest(self) -> bool:
        """Whether all motors are off."""
        return not any(self.applied_hz)


class MockProcess:
    """``vvvaltr mock``, running; to be used in a ``with`` statement.

    Args:
        device: qik, odrive or node.
        link: the port's name.
        more: further arguments.
    """

    def __init__(self, device: str, link: Path, *more: str) -> None:
        command = [sys.executable, "-c", _PROGRAM, "mock", device, "--link", str(link), "--faults", "-", *more]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._news = threading.Condition()
        self._statuses: list[Status] = []
        self.greeting = msgspec.json.decode(self._line(), type=Greeting)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def statuses(self) -> list[Status]:
        """All statuses so far, the newest last."""
        with self._news:
            return list(self._statuses)

    def inject(self, fault: Fault) -> None:
        """Inject a fault."""
        assert self.process.stdin is not None
        self.process.stdin.write(msgspec.json.encode(fault) + b"\n")
        self.process.stdin.flush()

    def wait_until(self, is_so: Callable[[Status], bool], timeout_s: float = 5.0) -> Status:
        """Return the next status that ``is_so``. Raises TimeoutError if none comes."""
        asked_s = time.monotonic()
        with self._news:
            found: list[Status] = []

            def has_come() -> bool:
                found.extend(s for s in self._statuses[-50:] if s.t_s >= asked_s and is_so(s))
                return bool(found)

            if not self._news.wait_for(has_come, timeout_s):
                raise TimeoutError(f"not within {timeout_s:g} s; the last status is {self._statuses[-1:]}")
            return found[0]

    def close(self) -> None:
        """End the mock, and wait until it has cleaned up."""
        self.process.terminate()
        self.process.wait(_ENDING_S)
        self._reader.join()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                pipe.close()

    def _line(self) -> bytes:
        assert self.process.stdout is not None
        return self.process.stdout.readline()

    def _read(self) -> None:
        while line := self._line():
            status = msgspec.json.decode(line, type=Status)
            with self._news:
                self._statuses.append(status)
                self._news.notify_all()
