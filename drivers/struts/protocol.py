"""The text of radio struts, as bytes to values and back: targets to a strut, reports from it. Speeds in turns a minute.

The laboratory's boards take a target and report ``target,average,ax,ay,az,gx,gy,gz``. Our own firmware takes and says
the same, and adds: a target may have a hold and a number, and a report goes on as firmware/README.md tells. That is how
the two are told apart. The RFduino boards of the thesis take one byte and say nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

GREATEST_RPM = 1001
SEQUENCES = 1 << 16
DEVICE_CLOCK_MS = 1 << 30  # the board's clock starts again after this (12 days)
SLOWEST_BYTE, GREATEST_BYTE = 0x17, 0xFF  # of an RFduino: below, the motor stands still
_MARK = "v1"
_COMMON, _ADDED = 8, 9
_INT16 = 1 << 15
_LONGEST = 200
_GREATEST_SHOWN_RPM = 100_000.0  # no motor is so fast: a number beyond was garbled


@dataclass(frozen=True, slots=True)
class Added:
    """What our firmware adds to a report.

    Args:
        sequence: counts the reports since the boot (modulo 65536).
        device_ms: time since the boot.
        boot_id: differs from boot to boot.
        command: number of the last command with a number that was taken, since the connection; 0 before the first.
        expiries: how often a command has expired, since the boot (modulo 65536).
        stalls: how often the motor was switched off because it did not turn, since the boot (modulo 65536).
        battery_v: voltage of the battery; None where it is not wired.
    """

    sequence: int
    device_ms: int
    boot_id: int
    command: int
    expiries: int
    stalls: int
    battery_v: float | None


@dataclass(frozen=True, slots=True)
class Report:
    """One notification of a strut.

    Args:
        target_rpm: what the board regulates to.
        average_rpm: measured speed; the laboratory's is the mean of the last 0.5 s.
        acceleration_g: x, y, z of the board, up to 2 g.
        rotation_deg_s: x, y, z of the board, up to 250 degrees a second.
        added: what our firmware adds; None from the laboratory's.
    """

    target_rpm: float
    average_rpm: float
    acceleration_g: tuple[float, float, float]
    rotation_deg_s: tuple[float, float, float]
    added: Added | None


def to_rpm(frequency_hz: float) -> int:
    """Return the target for a frequency, to the nearest turn a minute."""
    return round(60.0 * frequency_hz)


def to_byte(command: float) -> int:
    """Return an RFduino's byte for a command; 0 for one at which the motor stands still."""
    value = round(command)
    return value if value >= SLOWEST_BYTE else 0


def encode_target(rpm: int) -> bytes:
    """Return the text that sets a target, which every firmware understands."""
    return b"%d" % rpm


def encode_held(rpm: int, hold_s: float, sequence: int) -> bytes:
    """Return the text that sets a target for ``hold_s`` (1 ms or more), which our firmware understands."""
    return b"%d,%d,%d" % (rpm, round(1000.0 * hold_s), sequence)


def decode(text: bytes) -> Report:
    """Return what a strut reports. Raises ValueError for what makes no sense, or was cut short on its way."""
    if len(text) > _LONGEST or not text.isascii():
        raise ValueError("it is no text of a strut")
    fields = text.decode("ascii").split(",")
    if len(fields) not in (_COMMON, _COMMON + _ADDED):
        raise ValueError(f"it has {len(fields)} fields instead of {_COMMON} or {_COMMON + _ADDED}")
    target, average = map(_speed, fields[:2])
    motion = [_integer(field, -_INT16, _INT16) for field in fields[2:_COMMON]]
    ax, ay, az = (value / 16384.0 for value in motion[:3])
    gx, gy, gz = (value / 131.0 for value in motion[3:])
    added = _decode_added(text, fields[_COMMON:]) if len(fields) > _COMMON else None
    return Report(target, average, (ax, ay, az), (gx, gy, gz), added)


def check_sum(text: bytes) -> int:
    """Return the sum of all bytes, modulo 256: it shows a report that was cut short."""
    return sum(text) % 256


def check_bytes(points: Sequence[tuple[float, float]]) -> None:
    """Raise ValueError for a curve with commands at which an RFduino's motor does not turn, or that it has not."""
    for command, _ in points:
        if not SLOWEST_BYTE <= command <= GREATEST_BYTE:
            raise ValueError(f"it has the command {command:g}; allowed: {SLOWEST_BYTE} to {GREATEST_BYTE}")


def _decode_added(text: bytes, fields: Sequence[str]) -> Added:
    mark, *numbers, battery_mv, total = fields
    if mark != _MARK:
        raise ValueError(f"it is marked {mark[:8]!r} instead of {_MARK!r}")
    said, _, _ = text.rpartition(b",")
    if total != f"{check_sum(said):02x}":
        raise ValueError("its check sum is wrong")
    sequence, device_ms, boot_id, command, expiries, stalls = (
        _integer(field, 0, limit)
        for field, limit in zip(numbers, (SEQUENCES, DEVICE_CLOCK_MS, *4 * [SEQUENCES]), strict=True)
    )
    battery_v = _integer(battery_mv, 0, SEQUENCES) / 1000.0 if battery_mv else None
    return Added(sequence, device_ms, boot_id, command, expiries, stalls, battery_v)


def _speed(field: str) -> float:
    value = float(field)
    if not math.isfinite(value) or abs(value) > _GREATEST_SHOWN_RPM:
        raise ValueError(f"{field[:20]!r} is no speed")
    return value


def _integer(field: str, low: int, high: int) -> int:
    value = int(field)
    if not low <= value < high:
        raise ValueError(f"{field[:20]!r} is out of range")
    return value
