"""ODrive axes on a CAN bus, by the CANSimple protocol. Velocities are in turns per second, so they are frequencies.

The codec is written out here; odrive.dbc beside it describes the same messages for other tools, and a test holds the
two together. The axis has a watchdog of its own, to be switched on in the drive's configuration. No message tells
whether it is (where firmware lets endpoints be read, their numbers change from one version to the next), so opening
cannot look: ``vvvaltr check`` finds out, by falling silent while the motors turn.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from vvvaltr.controller.core.errors import DeviceFault, DeviceTimeout
from vvvaltr.controller.core.values import Gait, MotorState, Quantity
from vvvaltr.drivers.links.can import CanLink, Frame
from vvvaltr.drivers.motor_line import WATCHDOG
from vvvaltr.drivers.odrive.table import Firmware


class Message(IntEnum):
    """Commands: the low five bits of an identifier; the upper six are the axis' node."""

    HEARTBEAT = 0x01
    ESTOP = 0x02
    SET_STATE = 0x07
    ENCODER_ESTIMATES = 0x09
    SET_MODES = 0x0B
    SET_VELOCITY = 0x0D
    SET_LIMITS = 0x0F
    CURRENT = 0x14
    CLEAR_ERRORS = 0x18


# Payloads, little-endian. Of the heartbeat only what all firmware versions agree on.
_PAYLOADS = {
    Message.HEARTBEAT: struct.Struct("<IB"),  # axis error, axis state
    Message.SET_STATE: struct.Struct("<I"),
    Message.ENCODER_ESTIMATES: struct.Struct("<ff"),  # position in turns, velocity in turns/s
    Message.SET_MODES: struct.Struct("<ii"),  # control mode, input mode
    Message.SET_VELOCITY: struct.Struct("<ff"),  # turns/s, torque feed-forward in Nm
    Message.SET_LIMITS: struct.Struct("<ff"),  # turns/s, A
    Message.CURRENT: struct.Struct("<ff"),  # set-point, measured, in A
    Message.CLEAR_ERRORS: struct.Struct("<B"),  # 1 lets newer drives blink
}


class AxisState(IntEnum):
    """The states that are used."""

    IDLE = 1
    CLOSED_LOOP = 8


_OLD_ERRORS = {
    0x00000001: "invalid state",
    0x00000002: "supply voltage too low",
    0x00000004: "supply voltage too high",
    0x00000040: "motor failed",
    0x00000100: "encoder failed",
    0x00000200: "controller failed",
    0x00000800: WATCHDOG,
    0x00004000: "emergency stop",
    0x00040000: "too hot",
}
_NEW_ERRORS = {
    0x00000001: "starting",
    0x00000008: "no estimate of the motor's place",
    0x00000010: "bad configuration",
    0x00000020: "output stage failed",
    0x00000100: "supply voltage too high",
    0x00000200: "supply voltage too low",
    0x00000400: "supply current too high",
    0x00001000: "current limit exceeded",
    0x00002000: "motor too hot",
    0x00004000: "output stage too hot",
    0x00008000: "velocity limit exceeded",
    0x01000000: WATCHDOG,
    0x02000000: "emergency stop",
    0x04000000: "spin-out",
}

ERRORS: Mapping[Firmware, Mapping[int, str]] = {Firmware.OLD: _OLD_ERRORS, Firmware.NEW: _NEW_ERRORS}
"""Names of the axis error's bits that a user may meet."""

_VELOCITY_CONTROL, _PASS_THROUGH = 2, 1
_GREETING_S = 1.0  # for all axes to be heard of, and to settle
_SETTLE_S = 0.35  # three heartbeats: by then an axis has done as it was told, and said so
_TELL_AGAIN_S = 0.2
_CURRENT_PERIOD_S = 0.1


def encode(node: int, message: Message, *values: float) -> Frame:
    """Return a frame to an axis. Raises ValueError for a value that is not finite."""
    if not all(map(math.isfinite, values)):
        raise ValueError(f"{message.name.lower()} of {values} is not finite")
    payload = _PAYLOADS[message].pack(*values) if message in _PAYLOADS else b""
    return Frame(node << 5 | message, payload)


def decode(frame: Frame) -> tuple[int, Message, tuple[float, ...]] | None:
    """Return node, message and values of an axis' frame; None for one that is not of this protocol, or cut off."""
    try:
        message = Message(frame.identifier & 0x1F)
    except ValueError:
        return None
    payload = _PAYLOADS.get(message)
    if frame.is_remote or payload is None or len(frame.data) < payload.size:
        return None
    return frame.identifier >> 5, message, payload.unpack_from(frame.data)


@dataclass(frozen=True, slots=True)
class OdriveMotor:
    """An axis: its node, the set-point that it may not exceed, and its current limit (None: as the drive has it)."""

    node: int
    max_hz: float
    max_a: float | None = None


@dataclass(slots=True)
class _Axis:
    """What is known of an axis. Times as ``time.monotonic()`` counts."""

    motor: OdriveMotor
    heartbeat_s: float = -math.inf
    estimate_s: float = -math.inf
    error: int = 0
    state: int = 0
    velocity_hz: float = 0.0
    current_a: float = math.nan


def open_line(
    interface: str,
    channel: str,
    bitrate: int,
    motors: Sequence[OdriveMotor],
    firmware: Firmware = Firmware.NEW,
    options: Mapping[str, Any] | None = None,
) -> OdriveLine:
    """Open the bus, find all axes, clear their errors, set their modes, and return their motors idle.

    Raises:
        LinkLost: the bus could not be opened.
        DeviceTimeout: an axis is not heard of.
        DeviceFault: an axis keeps an error.
    """
    line = OdriveLine(CanLink(interface, channel, bitrate, options), motors, firmware)
    try:
        line.arm()
    except BaseException:
        line.close()
        raise
    return line


class OdriveLine:
    """The axes on one bus: a ``MotorLine``."""

    period_s = 0.02
    # Its value is in the drive's configuration; this is the longest that is safe, and `check` holds the drive to it.
    watchdog_s = 0.3

    def __init__(self, link: CanLink, motors: Sequence[OdriveMotor], firmware: Firmware) -> None:
        self._link = link
        self._firmware = firmware
        self._axes = {motor.node: _Axis(motor) for motor in motors}
        self._armed_s: float | None = None
        self._rested_s = time.monotonic()
        self._told_idle_s = self._asked_current_s = -math.inf

    @property
    def name(self) -> str:
        """Interface and channel."""
        return self._link.name

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return len(self._axes)

    @property
    def quantities(self) -> frozenset[Quantity]:
        """Frequencies only."""
        return frozenset({Quantity.FREQUENCY})

    @property
    def heard_s(self) -> float:
        """When the most silent axis last sent its heartbeat or its estimates, whichever is the older."""
        return min(min(axis.heartbeat_s, axis.estimate_s) for axis in self._axes.values())

    def check(self, gait: Gait) -> None:
        """Raise ValueError for a frequency beyond an axis' limit."""
        for axis, frequency_hz in zip(self._axes.values(), gait.frequency_hz, strict=True):
            if abs(frequency_hz) > axis.motor.max_hz + 1e-9:
                raise ValueError(
                    f"{self.name}, axis {axis.motor.node}: {frequency_hz:g} Hz is beyond its {axis.motor.max_hz:g} Hz"
                )

    def send(self, gait: Gait) -> None:
        """Send all velocities, and arm the axes if they are idle."""
        now_s = time.monotonic()
        if self._armed_s is None:
            # Before it is told: the other thread may hear of an armed axis while this one is still telling the rest.
            self._armed_s = now_s
            self._tell(Message.SET_STATE, AxisState.CLOSED_LOOP)
        for axis, frequency_hz in zip(self._axes.values(), gait.frequency_hz, strict=True):
            self._link.send(encode(axis.motor.node, Message.SET_VELOCITY, frequency_hz, 0.0))

    def repeat(self, gait: Gait) -> None:
        """Send all velocities again."""
        self.send(gait)

    def rest(self) -> None:
        """Send velocity 0, which also feeds the watchdogs, and tell the axes to be idle."""
        now_s = time.monotonic()
        self._tell(Message.SET_VELOCITY, 0.0, 0.0)
        if self._armed_s is not None:
            self._rested_s, self._told_idle_s, self._armed_s = now_s, -math.inf, None
        if now_s - self._told_idle_s > _TELL_AGAIN_S:
            self._told_idle_s = now_s
            self._tell(Message.SET_STATE, AxisState.IDLE)

    def estop(self) -> None:
        """Disarm all axes at once; they keep an error that only a new start clears. Raises LinkLost."""
        self._tell(Message.ESTOP)

    def listen(self, until_s: float) -> None:
        """Take in heartbeats and estimates. Raises DeviceFault for an axis that has failed or does not obey."""
        now_s = time.monotonic()
        if now_s - self._asked_current_s > _CURRENT_PERIOD_S:
            self._asked_current_s = now_s
            for node in self._axes:
                self._link.send(Frame(node << 5 | Message.CURRENT, is_remote=True))
        for frame in self._link.frames(until_s):
            self._take(frame)
        for axis in self._axes.values():
            self._judge(axis)

    def state(self) -> MotorState:
        """Return the velocities that the encoders measure."""
        axes = self._axes.values()
        currents_a = tuple(axis.current_a for axis in axes)
        return MotorState(
            min(axis.estimate_s for axis in axes),
            tuple(axis.velocity_hz for axis in axes),
            current_a=currents_a if all(map(math.isfinite, currents_a)) else (),
        )

    def close(self) -> None:
        """Let go of the bus."""
        self._link.close()

    def arm(self) -> None:
        """Find all axes and make them ready. Raises as ``open_line`` does."""
        self._wait(lambda axis: axis.heartbeat_s > 0.0, "no heartbeat comes from", "check power, wiring, node and rate")
        self._tell(Message.SET_STATE, AxisState.IDLE)
        self._tell(Message.SET_MODES, _VELOCITY_CONTROL, _PASS_THROUGH)
        for axis in self._axes.values():
            if axis.motor.max_a is not None:
                self._link.send(encode(axis.motor.node, Message.SET_LIMITS, axis.motor.max_hz, axis.motor.max_a))
        begun_s = time.monotonic()
        self._wait(
            lambda axis: axis.heartbeat_s > begun_s and axis.state == AxisState.IDLE and not axis.error,
            "no readiness is reported by",
            "see its errors with the maker's tool",
        )
        self._wait(lambda axis: axis.estimate_s > 0.0, "no estimates come from", "switch on its cyclic messages")

    def _wait(self, is_so: Callable[[_Axis], bool], complaint: str, cure: str) -> None:
        deadline_s = time.monotonic() + _GREETING_S
        while missing := [axis for axis in self._axes.values() if not is_so(axis)]:
            if time.monotonic() > deadline_s:
                axis = missing[0]
                if axis.error:
                    raise self._fault(axis)
                raise DeviceTimeout(f"{self.name}: {complaint} axis {axis.motor.node}; {cure}")
            # The axes' watchdogs may be running, and have run out already.
            self._tell(Message.SET_VELOCITY, 0.0, 0.0)
            self._tell(Message.CLEAR_ERRORS, 0)
            for frame in self._link.frames(time.monotonic() + self.period_s):
                self._take(frame)

    def _tell(self, message: Message, *values: float) -> None:
        for node in self._axes:
            self._link.send(encode(node, message, *values))

    def _take(self, frame: Frame) -> None:
        if (decoded := decode(frame)) is None or decoded[0] not in self._axes:
            return
        node, message, values = decoded
        axis, now_s = self._axes[node], time.monotonic()
        if not all(map(math.isfinite, values)):
            raise DeviceFault("garbled", f"{self.name}: axis {node} sends {message.name.lower()} of {values}")
        if message is Message.HEARTBEAT:
            axis.heartbeat_s, (axis.error, axis.state) = now_s, map(int, values)
        elif message is Message.ENCODER_ESTIMATES:
            axis.estimate_s, axis.velocity_hz = now_s, values[1]
        elif message is Message.CURRENT:
            axis.current_a = values[1]

    def _judge(self, axis: _Axis) -> None:
        if axis.error:
            raise self._fault(axis)
        if self._armed_s is None:
            if axis.state == AxisState.CLOSED_LOOP and axis.heartbeat_s > self._rested_s + _SETTLE_S:
                self.estop()
                raise DeviceFault("disobedient", f"{self.name}: axis {axis.motor.node} stayed armed; emergency stop")
        elif axis.state != AxisState.CLOSED_LOOP and axis.heartbeat_s > self._armed_s + _SETTLE_S:
            raise DeviceFault("disarmed", f"{self.name}: axis {axis.motor.node} is not armed (state {axis.state})")

    def _fault(self, axis: _Axis) -> DeviceFault:
        names = [name for bit, name in ERRORS[self._firmware].items() if axis.error & bit] or ["an unknown error"]
        code = WATCHDOG if WATCHDOG in names else names[0]
        return DeviceFault(
            code, f"{self.name}: axis {axis.motor.node} reports {', '.join(names)} ({axis.error:#x}); find its cause"
        )
