"""Fault scripts: what goes wrong on a mock device, and when. Data, in TOML or JSON; see docs/hardware.md."""

from __future__ import annotations

import math
from enum import StrEnum

import msgspec


class Kind(StrEnum):
    """What goes wrong."""

    DROP = "drop"  # replies are lost
    CORRUPT = "corrupt"  # replies have a wrong bit
    DELAY = "delay"  # replies come late
    DUPLICATE = "duplicate"  # replies come twice
    STALL = "stall"  # a motor is jammed
    BROWN_OUT = "brown_out"  # no power for a while, then a reboot
    UNPLUG = "unplug"  # the line is gone for a while
    ERROR = "error"  # the device sees an error, on the line or of its own
    SILENCE = "silence"  # no heartbeats and no telemetry, while commands are obeyed
    DROP_OUT = "drop_out"  # one strut is out of the radio's range
    SLOW = "slow"  # the radio link is slow, both ways
    BLIND = "blind"  # the tracker does not see the robot
    JUMP = "jump"  # it sees the robot elsewhere
    FREEZE = "freeze"  # it repeats the last pose, with new numbers and times
    ORIGIN = "origin"  # its poses are zero
    SECOND_BODY = "second_body"  # every second pose is that of another body
    UNIT = "unit"  # its positions are in millimetres
    CLOCK_STEP = "clock_step"  # its clock is set to another time, and back


REPLY_KINDS = frozenset({Kind.DROP, Kind.CORRUPT, Kind.DELAY, Kind.DUPLICATE})
POSE_KINDS = frozenset({Kind.BLIND, Kind.JUMP, Kind.FREEZE, Kind.ORIGIN, Kind.SECOND_BODY, Kind.UNIT, Kind.CLOCK_STEP})
RADIO_KINDS = frozenset({Kind.DROP_OUT, Kind.SLOW})
DEVICE_KINDS = frozenset({Kind.STALL, Kind.ERROR, Kind.SILENCE}) | RADIO_KINDS


class Fault(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One fault, with exactly one of the three triggers.

    Args:
        kind: what goes wrong.
        at_s: time from the start of the device to the fault.
        after_motion_s: time from the first rotation of a motor to the fault.
        at_reply: number of the device's message at which the fault begins, counted from 1.
        every_s: time from each beginning of the fault to the next; None for once.
        duration_s: how long it lasts (all kinds but those of messages).
        replies: number of messages affected (drop, corrupt, delay, duplicate).
        delay_s: how late messages are (delay, slow).
        motor: the motor, counted from 1 (stall, error, drop out).
        code: the device's own code for the error; None for the mock's choice.
        size_m: how far away the robot is seen (jump), or the other body is (second body).
        step_s: how far the tracker's clock is set forward; negative is back (clock step).

    Raises:
        ValueError: not one trigger, or a number that is out of range.
    """

    kind: Kind
    at_s: float | None = None
    after_motion_s: float | None = None
    at_reply: int | None = None
    every_s: float | None = None
    duration_s: float = 0.5
    replies: int = 1
    delay_s: float = 0.2
    motor: int = 1
    code: int | None = None
    size_m: float = 0.5
    step_s: float = -0.19

    def __post_init__(self) -> None:
        triggers = (self.at_s, self.after_motion_s, self.at_reply)
        if sum(trigger is not None for trigger in triggers) != 1:
            raise ValueError("a fault has one of at_s, after_motion_s and at_reply")
        if self.every_s is not None and not 0.0 < self.every_s < math.inf:
            raise ValueError(f"every_s is {self.every_s:g}, but must be above 0, and finite")
        for name in ("at_s", "after_motion_s", "at_reply", "duration_s", "delay_s", "size_m"):
            value = getattr(self, name)
            if value is not None and not 0.0 <= value < math.inf:
                raise ValueError(f"{name} is {value:g}, but must be 0 or more, and finite")
        if not math.isfinite(self.step_s):
            raise ValueError(f"step_s is {self.step_s:g}, but must be finite")
        if self.replies < 1 or self.motor < 1:
            raise ValueError("replies and motor count from 1")


class FaultScript(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All faults of one device: ``[[fault]]`` tables."""

    fault: tuple[Fault, ...] = ()


class Schedule:
    """Decides which faults begin and end. Times are in seconds on one clock; the device started at ``start_s``."""

    def __init__(self, start_s: float) -> None:
        self._start_s = start_s
        self._motion_s: float | None = None
        self._waiting: list[Fault] = []
        self._timed: list[tuple[float, Fault]] = []
        self._lasting: list[tuple[float, Fault]] = []

    def add(self, fault: Fault) -> None:
        """Add a fault."""
        self._waiting.append(fault)

    def begin(self, now_s: float, replies: int, is_turning: bool) -> list[Fault]:
        """Return the faults that begin now, after ``replies`` messages of the device."""
        if is_turning and self._motion_s is None:
            self._motion_s = now_s
        begun = [fault for fault in self._waiting if self._is_due(fault, now_s, replies)]
        self._waiting = [fault for fault in self._waiting if fault not in begun]
        begun += [fault for begin_s, fault in self._timed if begin_s <= now_s]
        self._timed = [(begin_s, fault) for begin_s, fault in self._timed if begin_s > now_s]
        for fault in begun:
            if fault.every_s is not None:
                self._timed.append((now_s + fault.every_s, fault))
            if fault.kind not in REPLY_KINDS:
                self._lasting.append((now_s + fault.duration_s, fault))
        return begun

    def end(self, now_s: float) -> list[Fault]:
        """Return the faults that end now."""
        ended = [fault for end_s, fault in self._lasting if end_s <= now_s]
        self._lasting = [(end_s, fault) for end_s, fault in self._lasting if end_s > now_s]
        return ended

    def _is_due(self, fault: Fault, now_s: float, replies: int) -> bool:
        if fault.at_reply is not None:
            return replies + 1 >= fault.at_reply
        if fault.at_s is not None:
            return now_s >= self._start_s + fault.at_s
        return self._motion_s is not None and now_s >= self._motion_s + (fault.after_motion_s or 0.0)
