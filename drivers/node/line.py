"""The motor node: closed-loop motors that speak the framed protocol of docs/node-protocol.md."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from vvvaltr.controller.core.errors import DeviceError, DeviceFault, DeviceTimeout, LinkLost
from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState
from vvvaltr.drivers.links.curve import to_commands
from vvvaltr.drivers.links.link import Link
from vvvaltr.drivers.links.remote_clock import RemoteClock
from vvvaltr.drivers.links.trouble import ECHO_CURE
from vvvaltr.drivers.motor_line import WATCHDOG
from vvvaltr.drivers.node.protocol import (
    DEVICE_CLOCK_MS,
    PROTOCOL,
    SEQUENCES,
    Ack,
    Decoder,
    Fault,
    Message,
    Status,
    Telemetry,
    Welcome,
    encode_clear,
    encode_drive,
    encode_hello,
    encode_stop,
)
from vvvaltr.drivers.node.table import NodeLineTable, NodeMotorTable

_log = logging.getLogger(__name__)

SEQUENCE = "sequence"  # code of the DeviceFault of a node whose messages are out of order
_PERIOD_S = 0.02
_HOLD_S = 0.2  # hold of one set-point: the node stops the motors after ten lost ones
_GREETING_S = 1.0  # time for a node to answer the greeting
_ANSWER_S = 0.1
_MAX_BEHIND = 20  # commands sent that the node has not received yet

_CURES = {
    Fault.STALL: "free the motor, or check its supply and wiring",
    Fault.OVER_TEMPERATURE: "let it cool, then run the motors more slowly",
}
_TWO_HOSTS_CURE = "check the wiring for noise, and end other programs that send to this node"

_Answer = TypeVar("_Answer")


def open_line(table: NodeLineTable) -> NodeLine:
    """Open the port and return the motors of the node on it. Raises as ``open_node`` does."""
    from vvvaltr.drivers.links.serial import SerialLink

    return open_node(SerialLink(table.port, table.baud), table.motor)


def open_node(link: Link, motors: Sequence[NodeMotorTable]) -> NodeLine:
    """Return the motors of the node on ``link``: greeted, at rest, without faults, telemetry coming in.

    Raises:
        DeviceTimeout: no node answers.
        DeviceFault: the node is not what the robot's file says: it has another number of motors, or slower ones.
        DeviceFault: the node speaks another version of the protocol, or has a fault that cannot be cleared.
        LinkLost: the line is gone.
    """
    try:
        line = _greet(link, motors)
        _check_motors(link.name, line.welcome, motors)
    except DeviceError:
        link.close()
        raise
    return line


def _check_motors(name: str, welcome: Welcome, motors: Sequence[NodeMotorTable]) -> None:
    if welcome.motor_count != len(motors):
        raise DeviceFault(
            "motors",
            f"{name}: the node has {welcome.motor_count} motors, the robot's file has {len(motors)}; correct the file, "
            "or flash the firmware for as many motors",
        )
    for number, motor in enumerate(motors, start=1):
        if motor.max_command > welcome.max_hz + 1e-9:
            raise DeviceFault(
                "max_hz",
                f"{name}: motor {number} of the line: the robot's file allows {motor.max_command:g} Hz, the node's "
                f"firmware {welcome.max_hz:g} Hz; lower max_hz in the file, or raise it in the firmware",
            )


def _greet(link: Link, motors: Sequence[NodeMotorTable]) -> NodeLine:
    decoder = Decoder()
    link.write(b"\0")  # ends a frame that noise may have begun
    welcome = _ask(link, decoder, encode_hello(0), lambda message: message if isinstance(message, Welcome) else None)
    if welcome.protocol != PROTOCOL:
        raise DeviceFault(
            "protocol",
            f"{link.name}: the node speaks version {welcome.protocol} of the protocol, this program {PROTOCOL}: "
            "flash the firmware that came with this program",
        )
    telemetry = _ask(
        link,
        decoder,
        encode_clear(1),
        lambda message: message if isinstance(message, Telemetry) and message.command == 1 else None,
    )
    _raise_faults(link.name, telemetry)
    return NodeLine(link, motors, decoder, welcome, telemetry)


def _ask(link: Link, decoder: Decoder, command: bytes, answer: Callable[[Message], _Answer | None]) -> _Answer:
    """Send ``command`` again and again until a message is its ``answer``."""
    deadline_s = time.monotonic() + _GREETING_S
    heard = b""
    while time.monotonic() < deadline_s:
        link.write(command)
        again_s = time.monotonic() + _ANSWER_S
        heard = b""
        while (left_s := again_s - time.monotonic()) > 0.0:
            heard += (data := link.read(4096, left_s))
            for found in map(answer, decoder.feed(data)):
                if found is not None:
                    return found
    if command in heard:
        raise DeviceFault("echo", f"{link.name}: no motor node answers, and what is sent comes back: {ECHO_CURE}")
    raise DeviceTimeout(f"{link.name}: no motor node answers; check power, wiring, port and baud rate")


def _raise_faults(name: str, telemetry: Telemetry) -> None:
    faults = [("the node", telemetry.fault)]
    faults += [(f"motor {number}", motor.fault) for number, motor in enumerate(telemetry.motors, start=1)]
    for where, fault in faults:
        if fault is not Fault.NONE:
            code = fault.name.lower()
            raise DeviceFault(code, f"{name}: {where} reports {code.replace('_', ' ')}; {_CURES[fault]}")


class NodeLine:
    """The motors of one node: satisfies ``vvvaltr.drivers.motor_line.MotorLine``. Made by ``open_node``.

    ``welcome`` is what the node said of itself.
    """

    period_s = _PERIOD_S
    watchdog_s = _HOLD_S
    quantities = frozenset({Quantity.FREQUENCY})

    def __init__(
        self,
        link: Link,
        motors: Sequence[NodeMotorTable],
        decoder: Decoder,
        welcome: Welcome,
        telemetry: Telemetry,
    ) -> None:
        self.welcome = welcome
        self._link = link
        self._curves = tuple(motor.calibration for motor in motors)
        self._decoder = decoder
        self._sequence = telemetry.command
        self._clock = RemoteClock()
        self._uptime_s = telemetry.device_ms / 1000.0
        # One attribute, for two threads read it.
        self._heard = (self._clock.here_s(self._uptime_s, time.monotonic()), telemetry)

    @property
    def name(self) -> str:
        """The port."""
        return self._link.name

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return self.welcome.motor_count

    @property
    def heard_s(self) -> float:
        """When the node sent its last telemetry."""
        return self._heard[0]

    @property
    def telemetry(self) -> Telemetry:
        """The latest telemetry."""
        return self._heard[1]

    def check(self, gait: Gait) -> None:
        """Raise ValueError for a frequency beyond a calibration curve or the node's firmware."""
        for motor, command_hz in enumerate(self._commands_hz(gait), start=1):
            if abs(command_hz) > self.welcome.max_hz + 1e-9:
                raise ValueError(
                    f"{self.name}, motor {motor} of the line: {command_hz:g} Hz is beyond the "
                    f"{self.welcome.max_hz:g} Hz of the node's firmware"
                )

    def send(self, gait: Gait) -> None:
        """Send the set-point of all motors."""
        self._link.write(encode_drive(self._next(), self._commands_hz(gait), _HOLD_S))

    repeat = send

    def rest(self) -> None:
        """Send the stop command."""
        self._link.write(encode_stop(self._next()))

    def listen(self, until_s: float) -> None:
        """Receive telemetry and acknowledgements. Raises as ``MotorLine.listen`` does."""
        while (left_s := until_s - time.monotonic()) > 0.0:
            for message in self._decoder.feed(self._link.read(4096, left_s)):
                if isinstance(message, Telemetry):
                    self._take_telemetry(message)
                elif isinstance(message, Ack):
                    self._take_ack(message)

    def state(self) -> MotorState:
        """Return what the node measured last."""
        heard_s, telemetry = self._heard
        currents = [motor.current_a for motor in telemetry.motors if motor.current_a is not None]
        temperatures = [motor.temperature_c for motor in telemetry.motors if motor.temperature_c is not None]
        return MotorState(
            heard_s,
            tuple(motor.measured_hz for motor in telemetry.motors),
            current_a=tuple(currents) if len(currents) == self.motor_count else (),
            temperature_c=tuple(temperatures) if len(temperatures) == self.motor_count else (),
        )

    def close(self) -> None:
        """Release the line."""
        self._link.close()

    def _commands_hz(self, gait: Gait) -> tuple[float, ...]:
        return to_commands(self._curves, gait.frequency_hz, self.name)

    def _next(self) -> int:
        self._sequence = (self._sequence + 1) % SEQUENCES
        return self._sequence

    def _take_telemetry(self, telemetry: Telemetry) -> None:
        if telemetry.boot_id != self.welcome.boot_id or len(telemetry.motors) != self.motor_count:
            raise LinkLost(f"{self.name}: the node has rebooted; check its supply")
        last = self.telemetry.sequence
        ahead = (telemetry.sequence - last) % SEQUENCES
        if ahead == 0:
            return  # the same once more: harmless, and nothing new
        if ahead >= SEQUENCES // 2:
            raise DeviceFault(
                SEQUENCE, f"{self.name}: telemetry {telemetry.sequence} came after {last}; {_TWO_HOSTS_CURE}"
            )
        if ahead > 1:
            _log.debug("%s: %d telemetry messages lost before number %d", self.name, ahead - 1, telemetry.sequence)
        self._uptime_s += (telemetry.device_ms - self.telemetry.device_ms) % DEVICE_CLOCK_MS / 1000.0
        self._heard = (self._clock.here_s(self._uptime_s, time.monotonic()), telemetry)
        _raise_faults(self.name, telemetry)
        behind = (self._sequence - telemetry.command) % SEQUENCES
        if behind > _MAX_BEHIND:
            raise DeviceTimeout(f"{self.name}: the node has not received the last {behind} commands; check the wiring")
        if telemetry.expiries:
            raise DeviceFault(
                WATCHDOG,
                f"{self.name}: the node's watchdog stopped the motors: no command came in time; check the cable, and "
                "end programs that keep this computer busy",
            )

    def _take_ack(self, ack: Ack) -> None:
        behind = (self._sequence - ack.sequence) % SEQUENCES
        if behind >= SEQUENCES // 2 or ack.status is Status.OUT_OF_ORDER:
            raise DeviceFault(
                SEQUENCE,
                f"{self.name}: command {ack.sequence} is out of order after {self._sequence}; {_TWO_HOSTS_CURE}",
            )
        if ack.status is Status.NOT_GREETED:
            raise LinkLost(f"{self.name}: the node has rebooted; check its supply")
        if ack.status in (Status.BAD_VALUE, Status.UNKNOWN_COMMAND):
            what = ack.status.name.lower().replace("_", " ")
            raise DeviceFault(
                "refused",
                f"{self.name}: the node refuses command {ack.sequence} ({what}); flash the firmware that came with "
                "this program",
            )
