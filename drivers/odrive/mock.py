"""Mock ODrive axes on a CAN bus, with the watchdog switched on."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path

from vvvaltr.drivers.links.can import Frame
from vvvaltr.drivers.mocking.can_adapter import BusPort, SlcanAdapter
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.port import PtyPort
from vvvaltr.drivers.motor_line import LOW_SUPPLY, WATCHDOG
from vvvaltr.drivers.odrive.protocol import ERRORS, AxisState, Message
from vvvaltr.drivers.odrive.table import Firmware, OdriveLineTable, OdriveMotorTable
from vvvaltr.drivers.registry import MockLine

WATCHDOG_S = 0.25
_MOTORS, _MAX_HZ = 3, 16.5  # as far as the planar twin's motors go
_HEARTBEAT_S, _ESTIMATES_S = 0.1, 0.01
_IDLE_A, _A_PER_HZ, _STALLED_A = 0.05, 0.02, 4.0
_ENCODERS = {
    Message.HEARTBEAT: struct.Struct("<IBBBB"),
    Message.ENCODER_ESTIMATES: struct.Struct("<ff"),
    Message.CURRENT: struct.Struct("<ff"),
}


@dataclass(slots=True)
class OdriveAxis:
    """One axis. Its controller follows the set-point at once; the motor's lag is the twin's."""

    node: int
    firmware: Firmware
    state: int = AxisState.IDLE
    error: int = 0
    wanted_hz: float = 0.0
    limit_hz: float = math.inf
    turns: float = 0.0
    fed_s: float = 0.0
    is_velocity_controlled: bool = False
    is_stalled: bool = False
    heartbeat_s: float = -math.inf
    estimates_s: float = -math.inf

    @property
    def applied_hz(self) -> float:
        """The axis' velocity."""
        if self.state != AxisState.CLOSED_LOOP or self.is_stalled or not self.is_velocity_controlled:
            return 0.0
        return max(-self.limit_hz, min(self.limit_hz, self.wanted_hz))

    @property
    def current_a(self) -> float:
        """The motor's current."""
        if self.is_stalled and self.state == AxisState.CLOSED_LOOP and self.wanted_hz:
            return _STALLED_A
        return _IDLE_A + _A_PER_HZ * abs(self.applied_hz) if self.state == AxisState.CLOSED_LOOP else 0.0

    def bit(self, name: str) -> int:
        """Return the error bit of this name."""
        return next(bit for bit, known in ERRORS[self.firmware].items() if known == name)

    def fail(self, error: int) -> None:
        """Set an error, and disarm."""
        self.error |= error
        self.state = AxisState.IDLE

    def obey(self, frame: Frame, now_s: float) -> list[Frame]:
        """Receive one frame for this axis; return the replies."""
        command = frame.identifier & 0x1F
        if frame.is_remote:
            return [self.frame(Message(command))] if command in _ENCODERS else []
        if command == Message.ESTOP:
            self.fail(self.bit("emergency stop"))
        elif command == Message.CLEAR_ERRORS:
            self.error, self.fed_s = 0, now_s
        elif command == Message.SET_STATE and len(frame.data) >= 4:
            self._request(struct.unpack_from("<I", frame.data)[0], now_s)
        elif command == Message.SET_MODES and len(frame.data) >= 8:
            self.is_velocity_controlled = struct.unpack_from("<i", frame.data)[0] == 2
        elif command in (Message.SET_VELOCITY, Message.SET_LIMITS) and len(frame.data) >= 8:
            self._set(command, struct.unpack_from("<f", frame.data)[0], now_s)
        return []

    def tick(self, now_s: float) -> None:
        """Check the watchdog, which runs while the axis is armed."""
        if self.state == AxisState.CLOSED_LOOP and now_s - self.fed_s > WATCHDOG_S:
            self.fail(self.bit(WATCHDOG))

    def frame(self, message: Message) -> Frame:
        """Return a message of the axis."""
        values: tuple[float, ...] = (self.error, self.state, 0, 0, 0)
        if message is Message.ENCODER_ESTIMATES:
            values = (self.turns, self.applied_hz)
        elif message is Message.CURRENT:
            values = (self.current_a, self.current_a)
        return Frame(self.node << 5 | message, _ENCODERS[message].pack(*values))

    def _request(self, state: int, now_s: float) -> None:
        if state == AxisState.CLOSED_LOOP and self.error:
            return  # an axis with an error does not arm
        if state == AxisState.CLOSED_LOOP and self.state != state:
            self.fed_s, self.wanted_hz = now_s, 0.0
        if state in (AxisState.IDLE, AxisState.CLOSED_LOOP):
            self.state = state

    def _set(self, command: int, value: float, now_s: float) -> None:
        if not math.isfinite(value):
            return
        if command == Message.SET_LIMITS:
            self.limit_hz = abs(value)
        else:
            self.wanted_hz, self.fed_s = value, now_s


class OdriveDevice:
    """Axes on one bus: a mock ``CanDevice``. Nodes count from 0."""

    def __init__(self, motor_count: int = 3, firmware: Firmware = Firmware.NEW) -> None:
        self.axes = [OdriveAxis(node, firmware) for node in range(motor_count)]
        self._is_silent = False
        self._ticked_s = -math.inf

    @property
    def applied_hz(self) -> tuple[float, ...]:
        """The axes' velocities."""
        return tuple(axis.applied_hz for axis in self.axes)

    @property
    def watchdog(self) -> bool:
        """Whether an axis' watchdog has disarmed it."""
        return any(axis.error & axis.bit(WATCHDOG) for axis in self.axes)

    @property
    def faults(self) -> tuple[str, ...]:
        """The axes' errors, and stalled motors."""
        errors = [f"axis {axis.node}: {axis.error:#x}" for axis in self.axes if axis.error]
        return (*errors, *(f"axis {axis.node}: stalled" for axis in self.axes if axis.is_stalled))

    def on_frame(self, frame: Frame, now_s: float) -> list[Frame]:
        """Receive a frame; return the replies."""
        return [reply for axis in self.axes if axis.node == frame.identifier >> 5 for reply in axis.obey(frame, now_s)]

    def tick(self, now_s: float) -> list[Frame]:
        """Let time pass; return heartbeats and estimates that are due."""
        elapsed_s = now_s - self._ticked_s if math.isfinite(self._ticked_s) else 0.0
        self._ticked_s = now_s
        said = []
        for axis in self.axes:
            axis.turns += axis.applied_hz * elapsed_s
            axis.tick(now_s)
            if now_s >= axis.heartbeat_s + _HEARTBEAT_S:
                axis.heartbeat_s = max(axis.heartbeat_s + _HEARTBEAT_S, now_s - _HEARTBEAT_S)
                said.append(axis.frame(Message.HEARTBEAT))
            if now_s >= axis.estimates_s + _ESTIMATES_S:
                axis.estimates_s = max(axis.estimates_s + _ESTIMATES_S, now_s - _ESTIMATES_S)
                said.append(axis.frame(Message.ENCODER_ESTIMATES))
        return [] if self._is_silent else said

    def begin_fault(self, fault: Fault, now_s: float) -> None:
        """Begin a stall, an error (its code is an axis error), or silence."""
        axis = self.axes[(fault.motor - 1) % len(self.axes)]
        if fault.kind is Kind.STALL:
            axis.is_stalled = True
        elif fault.kind is Kind.ERROR:
            axis.fail(axis.bit(LOW_SUPPLY) if fault.code is None else fault.code & 0xFFFFFFFF)
        elif fault.kind is Kind.SILENCE:
            self._is_silent = True

    def end_fault(self, fault: Fault, now_s: float) -> None:
        """End a stall or silence."""
        if fault.kind is Kind.STALL:
            self.axes[(fault.motor - 1) % len(self.axes)].is_stalled = False
        elif fault.kind is Kind.SILENCE:
            self._is_silent = False

    def reboot(self, now_s: float) -> None:
        """Reboot: idle, with default modes and limits."""
        self.axes = [
            OdriveAxis(axis.node, axis.firmware, is_stalled=axis.is_stalled, fed_s=now_s) for axis in self.axes
        ]


def make_mock(link: Path, max_hz: float = _MAX_HZ) -> MockLine:
    """Plug in axes behind an slcan adapter under the port ``link``. Raises ValueError for a name that is taken."""
    # The serial line of a USB adapter is as fast as USB, whatever its baud rate.
    port = PtyPort(link, is_paced=False)
    return MockLine(port, SlcanAdapter(OdriveDevice(_MOTORS)), _line_table("slcan", str(link), max_hz))


def make_bus_mock(interface: str, channel: str) -> MockLine:
    """Put axes on a CAN bus of python-can. Raises LinkLost."""
    table = _line_table(interface, channel)
    port = BusPort(interface, channel, table.bitrate)
    return MockLine(port, SlcanAdapter(OdriveDevice(_MOTORS), is_open=True), table)


def _line_table(interface: str, channel: str, max_hz: float = _MAX_HZ) -> OdriveLineTable:
    motors = tuple(OdriveMotorTable(node=node, max_hz=max_hz) for node in range(_MOTORS))
    return OdriveLineTable(interface=interface, channel=channel, motor=motors)
