"""The boards of mock struts: our firmware itself, and models of the laboratory's and of the thesis' RFduino.

Each has a motor that turns as its firmware lets it. What the laboratory's firmware does is told in docs/hardware.md.
"""

from __future__ import annotations

import math
import random
from collections import deque
from typing import Protocol

from vvvaltr.drivers.node.firmware.simulated_board import SimulatedMotor
from vvvaltr.drivers.struts.firmware import core
from vvvaltr.drivers.struts.protocol import GREATEST_BYTE, GREATEST_RPM, SLOWEST_BYTE

MAX_HZ = 16.5  # as far as the twins' motors go
_NO_LOAD_HZ = 1.25 * MAX_HZ
_FULL_HZ = 0.9 * _NO_LOAD_HZ  # a simulated motor at the full supply
_PULSES_PER_TURN = 70
_BATTERY_MV, _EMPTY_MV = 3900, 2900
_STEP_S = 0.05
_STALL_STEPS = 20


class StrutBoard(Protocol):
    """A board with one motor and one characteristic. Times are in s on one monotonic clock."""

    motor: SimulatedMotor

    @property
    def is_expired(self) -> bool:
        """Whether its watchdog has stopped the motor, and no command came since."""
        ...

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults that it has now."""
        ...

    def connect(self) -> None:
        """Take notice of a host."""
        ...

    def disconnect(self) -> None:
        """Take notice of the end of the link."""
        ...

    def write(self, text: bytes, now_s: float) -> None:
        """Take what a host writes."""
        ...

    def tick(self, now_s: float) -> bytes:
        """Let time pass; return the notification that is due, or nothing."""
        ...

    def set_error(self, is_on: bool) -> None:
        """Empty the battery, or fill it."""
        ...


class OwnBoard:
    """A board with our firmware: the real core on a simulated motor."""

    def __init__(self, now_s: float) -> None:
        self.motor = SimulatedMotor(_NO_LOAD_HZ, _PULSES_PER_TURN)
        self._battery_mv = _BATTERY_MV
        self._pulses = self._count = 0
        self._now_us = _us(now_s)
        settings = {
            "no_load_mhz": round(1000 * _NO_LOAD_HZ),
            "ramp_mhz_s": round(1000 * MAX_HZ / 0.15),
            "pulses_per_turn": _PULSES_PER_TURN,
            "report_ms": core.REPORT_MS,
        }
        self.strut = core.Strut(self, settings, random.getrandbits(16), self._now_us // 1000)

    @property
    def is_expired(self) -> bool:
        """Whether its watchdog has stopped the motor."""
        return bool(self.strut.is_expired)

    @property
    def faults(self) -> tuple[str, ...]:
        """A stall."""
        return ("stall",) if self.strut.is_stalled else ()

    def connect(self) -> None:
        """Begin with a host."""
        self.strut.on_connect()

    def disconnect(self) -> None:
        """Stop."""
        self.strut.on_disconnect()

    def write(self, text: bytes, now_s: float) -> None:
        """Take a target."""
        self.strut.on_text(text, _us(now_s) // 1000)

    def tick(self, now_s: float) -> bytes:
        """Return the report that is due."""
        now_us = _us(now_s)
        _turn(self.motor, self._now_us, now_us)
        self._now_us = now_us
        return bytes(self.strut.tick(now_us // 1000, now_us))

    def set_error(self, is_on: bool) -> None:
        """Empty the battery."""
        self._battery_mv = _EMPTY_MV if is_on else _BATTERY_MV

    def pulses(self) -> tuple[int, int]:
        """Return pulses, which tell no sense, and the time of the last one."""
        self._pulses += abs(self.motor.count - self._count)
        self._count = self.motor.count
        return self._pulses, self.motor.edge_us

    def set_output(self, output: int) -> None:
        """Set the motor's output."""
        self.motor.output = output

    def motion(self) -> tuple[int, int, int, int, int, int]:
        """Return what a board at rest on the bench measures."""
        return 0, 0, 16384, 0, 0, 0

    def battery_mv(self) -> int:
        """Return the battery's voltage."""
        return self._battery_mv


class LaboratoryBoard:
    """A board with the laboratory's firmware: it regulates a mean of ten speeds and has no watchdog.

    Args:
        now_s: the present.
        report_s: time between two reports; older builds take 0.8 s.
        takes_pulse_widths: whether it has the firmware of the same identity that takes widths of up to 4095.
    """

    is_expired = False
    faults = ()

    def __init__(self, now_s: float, report_s: float = 0.2, takes_pulse_widths: bool = False) -> None:
        self.motor = SimulatedMotor(_NO_LOAD_HZ, _PULSES_PER_TURN)
        self._report_s = report_s
        self._takes_pulse_widths = takes_pulse_widths
        self._greatest = 4095 if takes_pulse_widths else GREATEST_RPM
        self._target = 0
        self._output = 0.0
        self._speeds_rpm = deque([0.0] * 10, maxlen=10)
        self._stalled = 0
        self._pause_until_s = self._step_s = self._told_s = now_s
        self._now_us = _us(now_s)

    def connect(self) -> None:
        """Do nothing: an old target stays in force."""

    def disconnect(self) -> None:
        """Do nothing: the motor runs on."""

    def write(self, text: bytes, now_s: float) -> None:
        """Take a target; what is no number is 0."""
        if text.strip().lower() == b"calibrate":
            self._pause_until_s = now_s + 2.0
            return
        try:
            target = round(float(text))
        except (ValueError, OverflowError):
            target = 0
        target = max(-self._greatest, min(self._greatest, target))
        if target * self._target < 0:
            self._pause_until_s = now_s + 0.15
            self._output = 0.0
        self._target = target

    def tick(self, now_s: float) -> bytes:
        """Return the report that is due."""
        now_us = _us(now_s)
        _turn(self.motor, self._now_us, now_us)
        self._now_us = now_us
        if now_s >= self._step_s + _STEP_S:
            self._step_s = max(self._step_s + _STEP_S, now_s - _STEP_S)
            self._regulate(now_s)
        if now_s < self._told_s + self._report_s:
            return b""
        self._told_s = max(self._told_s + self._report_s, now_s - self._report_s)
        return b"%.2f,%.2f,0,0,16384,0,0,0" % (self._target, self._average_rpm)

    def set_error(self, is_on: bool) -> None:
        """Do nothing: the battery is not wired."""

    @property
    def _average_rpm(self) -> float:
        return sum(self._speeds_rpm) / len(self._speeds_rpm)

    def _regulate(self, now_s: float) -> None:
        self._speeds_rpm.append(60.0 * abs(self.motor.frequency_hz))
        if self._target == 0 or now_s < self._pause_until_s:
            self._output = 0.0
        elif self._takes_pulse_widths:
            self._output = abs(self._target) / 4095.0
        else:
            error = (abs(self._target) - self._average_rpm) / (60.0 * _FULL_HZ)
            self._output = max(0.0, min(1.0, self._output + 0.12 * error))
        self._watch_stall()
        self.motor.output = round(1000.0 * math.copysign(self._output, self._target))

    def _watch_stall(self) -> None:
        self._stalled = self._stalled + 1 if self._output > 0.15 and self._average_rpm < 10.0 else 0
        if self._stalled >= _STALL_STEPS:
            self._target, self._output, self._stalled = 0, 0.0, 0


class RfduinoBoard:
    """A board of the thesis: the last byte is the voltage, in one sense, for ever."""

    is_expired = False
    faults = ()

    def __init__(self, now_s: float) -> None:
        self.motor = SimulatedMotor(_NO_LOAD_HZ, _PULSES_PER_TURN)
        self._now_us = _us(now_s)

    def connect(self) -> None:
        """Do nothing: an old byte stays in force."""

    def disconnect(self) -> None:
        """Do nothing: the motor runs on."""

    def write(self, text: bytes, now_s: float) -> None:
        """Take the first byte."""
        value = text[0] if text else 0
        self.motor.output = round(1000.0 * value / GREATEST_BYTE) if value >= SLOWEST_BYTE else 0

    def tick(self, now_s: float) -> bytes:
        """Say nothing."""
        now_us = _us(now_s)
        _turn(self.motor, self._now_us, now_us)
        self._now_us = now_us
        return b""

    def set_error(self, is_on: bool) -> None:
        """Do nothing: it does not know its battery."""


def rfduino_hz(value: int) -> float:
    """Return how fast a byte turns the motor of ``RfduinoBoard``."""
    return _FULL_HZ * value / GREATEST_BYTE


def _turn(motor: SimulatedMotor, from_us: int, until_us: int) -> None:
    """Let a motor turn, in small steps; after a long pause the rest is skipped."""
    left_us = min(100_000, until_us - from_us)
    while left_us > 0:
        part_us = min(2000, left_us)
        left_us -= part_us
        motor.step(until_us - left_us, part_us)


def _us(now_s: float) -> int:
    return int(now_s * 1_000_000)
