"""A mock device, plugged in: its logic, its line, its faults and its motion, in real time."""

from __future__ import annotations

import heapq
import itertools
import os
import random
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

from vvvaltr.controller.core.values import Vector
from vvvaltr.drivers.mocking.device import Device
from vvvaltr.drivers.mocking.faults import DEVICE_KINDS, REPLY_KINDS, Fault, Kind, Schedule
from vvvaltr.drivers.mocking.moving_twin import MovingTwin
from vvvaltr.drivers.mocking.port import Port

_TICK_S = 0.002


def be_prompt() -> None:
    """Give this process real-time priority where that is allowed: a real device has a processor of its own."""
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))


class PluggedDevice:
    """A device on a port.

    Args:
        device: its logic.
        port: where it is plugged in.
        motion: the robot that its motors move; None for motors on a bench.
        faults: what goes wrong.

    Raises:
        ValueError: a fault names a motor that the device does not have.
    """

    def __init__(
        self, device: Device, port: Port, motion: MovingTwin | None = None, faults: Sequence[Fault] = ()
    ) -> None:
        self._device = device
        self._port = port
        self._motion = motion
        self._schedule = Schedule(time.monotonic())
        self._reply_faults: list[tuple[Fault, int]] = []
        self._outbox: list[tuple[float, int, bytes]] = []
        self._replies = 0
        self._order = itertools.count()
        self._has_power = True
        self._dice = random.Random(0)
        for fault in faults:
            self.inject(fault)

    @property
    def applied_hz(self) -> tuple[float, ...]:
        """What the output stages are set to."""
        applied_hz = self._device.applied_hz
        return applied_hz if self._has_power else (0.0,) * len(applied_hz)

    @property
    def place_m(self) -> Vector | None:
        """Where the robot truly is; None for motors on a bench."""
        return None if self._motion is None else self._motion.place_m

    @property
    def watchdog(self) -> bool:
        """Whether the device's watchdog has stopped the motors."""
        return self._device.watchdog

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults that the device has now."""
        return self._device.faults if self._has_power else ("no power",)

    def inject(self, fault: Fault) -> None:
        """Add a fault to the script. Raises ValueError for a motor that the device does not have."""
        if fault.motor > len(self.applied_hz):
            raise ValueError(f"motor is {fault.motor}; allowed: 1 to {len(self.applied_hz)}")
        self._schedule.add(fault)

    def step(self, now_s: float) -> bool:
        """Do what is due at ``now_s``, as ``time.monotonic()`` counts; return whether anything was received."""
        self._change_faults(now_s)
        data = self._port.receive(now_s)
        if data:
            self._say(self._device.on_bytes(data, now_s) if self._has_power else b"", now_s)
        if self._has_power:
            self._say(self._device.tick(now_s), now_s)
        while self._outbox and self._outbox[0][0] <= now_s:
            self._port.send(heapq.heappop(self._outbox)[2], now_s)
        if self._motion is not None:
            self._motion.advance(self.applied_hz, now_s)
        return bool(data)

    def run(self, is_over: Callable[[float], bool]) -> None:
        """Run in real time until ``is_over(now_s)``."""
        be_prompt()
        while not is_over(now_s := time.monotonic()):
            self.step(now_s)
            self.wait()

    def wait(self) -> None:
        """Return when there is something to do again, after a tick at most."""
        self._port.wait(time.monotonic() + _TICK_S)

    def close(self) -> None:
        """Unplug, and remove the port."""
        self._port.close()
        if self._motion is not None:
            self._motion.close()

    def _change_faults(self, now_s: float) -> None:
        for fault in self._schedule.begin(now_s, self._replies, any(self.applied_hz)):
            self._begin(fault, now_s)
        for fault in self._schedule.end(now_s):
            self._end(fault, now_s)

    def _begin(self, fault: Fault, now_s: float) -> None:
        if fault.kind in REPLY_KINDS:
            self._reply_faults.append((fault, self._replies + fault.replies))
        elif fault.kind in DEVICE_KINDS:
            self._device.begin_fault(fault, now_s)
        elif fault.kind is Kind.UNPLUG:
            self._port.unplug()
        elif fault.kind is Kind.BROWN_OUT:
            self._has_power = False
        elif self._motion is not None:
            self._motion.faults.begin(fault)

    def _end(self, fault: Fault, now_s: float) -> None:
        if fault.kind in DEVICE_KINDS:
            self._device.end_fault(fault, now_s)
        elif fault.kind is Kind.UNPLUG:
            self._port.plug()
        elif fault.kind is Kind.BROWN_OUT:
            self._device.reboot(now_s)
            self._has_power = True
        elif self._motion is not None:
            self._motion.faults.end(fault)

    def _say(self, message: bytes, now_s: float) -> None:
        """Put one message of the device into the outbox, changed by the faults of the moment."""
        if not message:
            return
        copies, at_s = 1, now_s
        for fault, _ in self._reply_faults:
            if fault.kind is Kind.DROP:
                copies = 0
            elif fault.kind is Kind.DUPLICATE:
                copies *= 2
            elif fault.kind is Kind.DELAY:
                at_s += fault.delay_s
            elif fault.kind is Kind.CORRUPT:
                message = self._with_wrong_bit(message)
        self._replies += 1
        self._reply_faults = [(fault, last) for fault, last in self._reply_faults if last > self._replies]
        for _ in range(copies):
            heapq.heappush(self._outbox, (at_s, next(self._order), message))

    def _with_wrong_bit(self, message: bytes) -> bytes:
        place = self._dice.randrange(len(message))
        return message[:place] + bytes([message[place] ^ 1 << self._dice.randrange(8)]) + message[place + 1 :]
