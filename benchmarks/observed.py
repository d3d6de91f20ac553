"""A mock device in its own process that records when its motors start and stop, and when it receives bytes."""

from __future__ import annotations

import math
import multiprocessing
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Self

from vvvaltr.controller.core.values import Vector
from vvvaltr.drivers.mocking.faults import Fault


@dataclass(frozen=True, slots=True)
class Change:
    """A change of the motors' state.

    Args:
        t_s: time of the change, as ``time.monotonic()`` counts.
        are_all_on: whether all motors run from then on.
        are_all_off: whether all motors are off from then on.
    """

    t_s: float
    are_all_on: bool
    are_all_off: bool


@dataclass(frozen=True, slots=True)
class Note:
    """What the device did since the last note.

    Args:
        changes: changes of its motors' state.
        longest_gap_s: longest time without a byte from the controller while motors were on.
        longest_pause_s: longest time for which the machine did not run the device; it may account for the gap.
        are_all_off: whether all motors are off now.
        watchdog: whether the device's watchdog has stopped them.
        place_m: where the robot truly is, whatever its tracker shows.
    """

    changes: tuple[Change, ...]
    longest_gap_s: float
    longest_pause_s: float
    are_all_off: bool
    watchdog: bool
    place_m: Vector


class ObservedDevice:
    """A mock with its twin in a process of its own, for a ``with`` statement."""

    def __init__(
        self, device: str, link: Path, twin: str = "planar", max_hz: float | None = None, firmware: str = ""
    ) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(device, link, twin, max_hz, firmware, theirs), daemon=True)
        self._process.start()
        self.robot_file = Path(self._pipe.recv())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pipe.send(None)
        self._process.join()

    def note(self) -> Note:
        """Return what the device did since the last call."""
        self._pipe.send("note")
        note: Note = self._pipe.recv()
        return note

    def inject(self, fault: Fault) -> None:
        """Make a fault happen."""
        self._pipe.send(fault)

    def rested_s(self, timeout_s: float) -> float:
        """Wait until all motors are off, and return the time since when, as ``time.monotonic()`` counts.

        Raises:
            TimeoutError: a motor is still running after ``timeout_s``.
        """
        deadline_s = time.monotonic() + timeout_s
        since_s = 0.0
        while time.monotonic() < deadline_s:
            note = self.note()
            since_s = max([since_s, *(change.t_s for change in note.changes if change.are_all_off)])
            if note.are_all_off:
                return since_s
            time.sleep(0.01)
        raise TimeoutError(f"a motor was still running after {timeout_s:g} s")


def _serve(device: str, link: Path, twin: str, max_hz: float | None, firmware: str, pipe: Connection) -> None:
    from vvvaltr.controller.robot.mock import open_mock
    from vvvaltr.drivers.mocking.plugged import be_prompt

    be_prompt()
    mock = open_mock(device, link, twin, max_hz=max_hz, firmware=firmware)
    pipe.send(str(mock.robot_file))
    changes: list[Change] = []
    heard_s: float | None = None
    longest_gap_s = longest_pause_s = 0.0
    before_s = time.monotonic()
    last = (False, True)

    def each_time(_: float) -> bool:
        nonlocal longest_gap_s, longest_pause_s
        if not pipe.poll():
            return False
        match request := pipe.recv():
            case Fault():
                mock.plugged.inject(request)
            case "note":
                place_m = mock.plugged.place_m or (math.nan,) * 3
                watchdog = mock.plugged.watchdog
                pipe.send(Note(tuple(changes), longest_gap_s, longest_pause_s, last[1], watchdog, place_m))
                changes.clear()
                longest_gap_s = longest_pause_s = 0.0
        return request is None

    while not each_time(now_s := time.monotonic()):
        longest_pause_s, before_s = max(longest_pause_s, now_s - before_s), now_s
        heard = mock.plugged.step(now_s)
        done_s = time.monotonic()
        applied = mock.plugged.applied_hz
        on, off = all(applied), not any(applied)
        if (on, off) != last:
            last = (on, off)
            changes.append(Change(done_s, on, off))
        if heard or off:
            if heard_s is not None and not off:
                longest_gap_s = max(longest_gap_s, now_s - heard_s)
            heard_s = None if off else now_s
        mock.plugged.wait()
    mock.close()
