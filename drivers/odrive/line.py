"""ODrive axes on a CAN bus, by the CANSimple protocol. Velocities are in turns per second, so they are frequencies.

The axis has a watchdog of its own, to be switched on in the drive's configuration. No message tells whether it is on
(where firmware lets endpoints be read, their numbers change from one version to the next), so opening cannot look:
``vvvaltr check`` finds out, by falling silent while the motors turn.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from vvvaltr.controller.core.errors import DeviceFault, DeviceTimeout
from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState
from vvvaltr.drivers.links.can import CanLink, Frame
from vvvaltr.drivers.links.curve import to_commands
from vvvaltr.drivers.motor_line import arm_or_close
from vvvaltr.drivers.odrive.protocol import (
    PASS_THROUGH,
    VELOCITY_CONTROL,
    AxisState,
    Message,
    decode,
    describe_errors,
    encode,
)
from vvvaltr.drivers.odrive.table import OdriveLineTable, OdriveMotorTable

_GREETING_S = 1.0  # time for all axes to send and to settle
_SETTLE_S = 0.35  # three heartbeats: by then an axis has obeyed and reported it
_TELL_AGAIN_S = 0.2
_CURRENT_PERIOD_S = 0.1
_OURS = frozenset({Message.SET_VELOCITY, Message.SET_STATE, Message.SET_MODES, Message.CLEAR_ERRORS})
_RETURNED = (
    "and commands to it come in: the port or its adapter echoes, or another program drives the axes; correct channel, "
    "or end that program"
)


@dataclass(slots=True)
class _Axis:
    """What is known of an axis. Times as ``time.monotonic()`` counts."""

    motor: OdriveMotorTable
    heartbeat_s: float = -math.inf
    estimate_s: float = -math.inf
    error: int = 0
    state: int = 0
    velocity_hz: float = 0.0
    current_a: float = math.nan


def open_line(table: OdriveLineTable) -> OdriveLine:
    """Open the bus, find all axes, clear their errors, set their modes, and return their motors idle.

    Raises:
        LinkLost: the bus could not be opened.
        DeviceTimeout: an axis sends nothing.
        DeviceFault: an axis keeps an error.
    """
    return arm_or_close(OdriveLine(CanLink(table.interface, table.channel, table.bitrate, table.options), table))


class OdriveLine:
    """The axes on one bus: a ``MotorLine``."""

    period_s = 0.02
    # The value is in the drive's configuration; this is the longest safe one, and `check` tests the drive against it.
    watchdog_s = 0.3

    def __init__(self, link: CanLink, table: OdriveLineTable) -> None:
        self._link = link
        self._firmware = table.firmware
        self._axes = {motor.node: _Axis(motor) for motor in table.motor}
        self._curves = tuple(motor.calibration for motor in table.motor)
        self._returned = False
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
        """Time of the oldest of all axes' latest heartbeats and estimates."""
        return min(min(axis.heartbeat_s, axis.estimate_s) for axis in self._axes.values())

    def check(self, gait: Gait) -> None:
        """Raise ValueError for a frequency that a calibration curve does not reach."""
        to_commands(self._curves, gait.frequency_hz, self.name)

    def send(self, gait: Gait) -> None:
        """Send all velocities, and arm the axes if they are idle."""
        now_s = time.monotonic()
        if self._armed_s is None:
            # Noted before it is sent: the other thread may hear of an armed axis while this one still arms the others.
            self._armed_s = now_s
            self._tell(Message.SET_STATE, AxisState.CLOSED_LOOP)
        commands_hz = to_commands(self._curves, gait.frequency_hz, self.name)
        for node, command_hz in zip(self._axes, commands_hz, strict=True):
            self._link.send(encode(node, Message.SET_VELOCITY, command_hz, 0.0))

    def repeat(self, gait: Gait) -> None:
        """Send all velocities again."""
        self.send(gait)

    def rest(self) -> None:
        """Send velocity 0, which also feeds the watchdogs, and request idle."""
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
        """Receive heartbeats and estimates. Raises DeviceFault for an axis that has failed or does not obey."""
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
        """Release the bus."""
        self._link.close()

    def arm(self) -> None:
        """Find all axes and make them ready. Raises as ``open_line`` does."""
        self._wait(
            lambda axis: axis.heartbeat_s > 0.0, "no heartbeat from", "check power, wiring, node number and bitrate"
        )
        self._tell(Message.SET_STATE, AxisState.IDLE)
        self._tell(Message.SET_MODES, VELOCITY_CONTROL, PASS_THROUGH)
        for motor in (axis.motor for axis in self._axes.values()):
            if motor.max_a:
                self._link.send(encode(motor.node, Message.SET_LIMITS, motor.max_command, motor.max_a))
        begun_s = time.monotonic()
        self._wait(
            lambda axis: axis.heartbeat_s > begun_s and axis.state == AxisState.IDLE and not axis.error,
            "not ready:",
            "read its errors with the maker's tool",
        )
        self._wait(lambda axis: axis.estimate_s > 0.0, "no encoder estimates from", "switch on its cyclic messages")

    def _wait(self, is_so: Callable[[_Axis], bool], complaint: str, cure: str) -> None:
        deadline_s = time.monotonic() + _GREETING_S
        while missing := [axis for axis in self._axes.values() if not is_so(axis)]:
            if time.monotonic() > deadline_s:
                axis = missing[0]
                if axis.error:
                    raise self._fault(axis)
                if self._returned:
                    raise DeviceFault("echo", f"{self.name}: {complaint} axis {axis.motor.node}, {_RETURNED}")
                raise DeviceTimeout(f"{self.name}: {complaint} axis {axis.motor.node}; {cure}")
            # The axes' watchdogs may be running, or have expired already.
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
        self._returned = self._returned or message in _OURS
        if not all(map(math.isfinite, values)):
            raise DeviceFault(
                "garbled",
                f"{self.name}: axis {node} sends {message.name.lower()} {values}; check the wiring for noise",
            )
        if message is Message.HEARTBEAT:
            axis.heartbeat_s, (axis.error, axis.state) = now_s, map(int, values)
        elif message is Message.ENCODER_ESTIMATES:
            axis.estimate_s, axis.velocity_hz = now_s, values[1]
        elif message is Message.CURRENT:
            axis.current_a = values[1]

    def _judge(self, axis: _Axis) -> None:
        where = f"{self.name}: axis {axis.motor.node}"
        if axis.error:
            raise self._fault(axis)
        if self._armed_s is None:
            if axis.state == AxisState.CLOSED_LOOP and axis.heartbeat_s > self._rested_s + _SETTLE_S:
                self.estop()
                raise DeviceFault(
                    "disobedient",
                    f"{where} stayed armed after a stop; emergency stop sent; switch the drive off and on",
                )
        elif axis.state != AxisState.CLOSED_LOOP and axis.heartbeat_s > self._armed_s + _SETTLE_S:
            raise DeviceFault("disarmed", f"{where} has disarmed by itself; read its errors with the maker's tool")

    def _fault(self, axis: _Axis) -> DeviceFault:
        code, what = describe_errors(self._firmware, axis.error)
        return DeviceFault(code, f"{self.name}: axis {axis.motor.node} reports {what}")
