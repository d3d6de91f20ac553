"""The person beside the robot, and the hand that puts it back: what the loop asks of them between trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol


class Wish(StrEnum):
    """What an operator can ask for. Each is understood at the stages that ``WISHES`` lists."""

    STOP = "stop"  # motors off now, and pause
    PAUSE = "pause"  # before the next trial; once more to go on
    GO = "go"  # begin the trial, wherever the robot lies
    SKIP = "skip"  # another gait in place of this one
    END = "end"  # the run, after this trial
    KEEP = "keep"  # the trial, at once
    REPEAT = "repeat"  # keep the trial, and drive its gait again
    DISCARD = "discard"  # the trial does not count; the text says why
    NOTE = "note"  # the text goes with the trial into the log
    NEW_BATTERY = "new battery"  # since the last trial


class Stage(StrEnum):
    """What the run is at when the operator is asked."""

    WAITING = "waiting"  # before a trial
    DRIVING = "driving"
    REVIEW = "review"  # after it


WISHES: dict[Stage, tuple[Wish, ...]] = {
    Stage.WAITING: (Wish.GO, Wish.PAUSE, Wish.SKIP, Wish.NEW_BATTERY, Wish.NOTE, Wish.END, Wish.STOP),
    Stage.DRIVING: (Wish.STOP, Wish.PAUSE, Wish.END),
    Stage.REVIEW: (Wish.KEEP, Wish.REPEAT, Wish.DISCARD, Wish.NOTE, Wish.NEW_BATTERY, Wish.PAUSE, Wish.END, Wish.STOP),
}


@dataclass(frozen=True, slots=True)
class Request:
    """A wish, with the operator's own words where it has any."""

    wish: Wish
    text: str = ""


class Operator(Protocol):
    """A person beside the robot."""

    @property
    def is_busy(self) -> bool:
        """Whether the operator is in the middle of an answer, which is waited for."""
        ...

    def show(self, stage: Stage, line: str) -> None:
        """Show what the run is at, in place of what was shown before."""
        ...

    def listen(self, wait_s: float) -> Sequence[Request]:
        """Return the wishes that have come, after waiting for one for at most ``wait_s``.

        Raises:
            KeyboardInterrupt: the operator is gone for good, as with a terminal that was closed.
        """
        ...


@dataclass(frozen=True, slots=True)
class StartPlace:
    """Where the robot lies at the start of a trial, in the tracker's frame.

    Args:
        x_m, y_m: centre of the start circle.
        yaw_rad: heading; None for any.
        within_m: radius of the circle.
        within_rad: greatest difference of the heading.

    Raises:
        ValueError: a number is not finite, or a radius is not above 0.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float | None = None
    within_m: float = 0.03
    within_rad: float = 0.2

    def __post_init__(self) -> None:
        for name in ("x_m", "y_m", "yaw_rad"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise ValueError(f"{name} is {value}, which is not a finite number")
        for name in ("within_m", "within_rad"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name):g}; allowed: above 0")

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return the distance from the circle's centre."""
        return math.hypot(self.x_m - x_m, self.y_m - y_m)

    def turn_rad(self, yaw_rad: float) -> float:
        """Return by how much a robot must be turned, counterclockwise positive; 0 where any heading will do."""
        return 0.0 if self.yaw_rad is None else math.remainder(self.yaw_rad - yaw_rad, math.tau)

    def holds(self, x_m: float, y_m: float, yaw_rad: float) -> bool:
        """Return whether a robot in this pose may start."""
        return self.distance_m(x_m, y_m) <= self.within_m and abs(self.turn_rad(yaw_rad)) <= self.within_rad


class Hand(Protocol):
    """What puts the robot back without a person: a mock's operator, or a machine."""

    def put_back(self, place: StartPlace) -> None:
        """Put the robot back; return once that is done. Raises DeviceError where it cannot be."""
        ...
