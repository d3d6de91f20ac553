"""Fault scripts: what goes wrong on a mock device, and when. Data, in TOML or JSON; see docs/hardware.md."""

from __future__ import annotations

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


REPLY_KINDS = frozenset({Kind.DROP, Kind.CORRUPT, Kind.DELAY, Kind.DUPLICATE})
DEVICE_KINDS = frozenset({Kind.STALL, Kind.ERROR, Kind.SILENCE})


class Fault(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One fault. It begins at ``at_s``, or with the ``at_reply``-th reply, and lasts ``duration_s`` or ``replies``.

    Args:
        kind: what goes wrong.
        at_s: when, in seconds since the device started.
        at_reply: with which reply of the device, counted from 1; instead of ``at_s``.
        every_s: again and again after as many seconds.
        duration_s: how long it lasts (stall, brown-out, unplugging, silence).
        replies: how many replies it befalls (drop, corrupt, delay, duplicate).
        delay_s: by how much replies are late.
        motor: the motor, counted from 1 (stall, error).
        code: the device's own code for the error; None for the mock's choice.
    """

    kind: Kind
    at_s: float | None = None
    at_reply: int | None = None
    every_s: float | None = None
    duration_s: float = 0.5
    replies: int = 1
    delay_s: float = 0.2
    motor: int = 1
    code: int | None = None
