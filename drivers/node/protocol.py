"""The protocol between host and motor node, docs/node-protocol.md, from the host's side.

Payloads are packed little-endian; a frame is COBS(payload, CRC-16) and the end mark 0.
"""

from __future__ import annotations

import binascii
import logging
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from cobs import cobs

_log = logging.getLogger(__name__)

PROTOCOL = 1
SEQUENCES = 1 << 16
DEVICE_CLOCK_MS = 1 << 30  # the node's clock starts again after this (12 days)
_UNKNOWN = -32768
_LONGEST_FRAME = 123
_COMMAND = struct.Struct("<BH")
_DRIVE = struct.Struct("<BHH")
_WELCOME = struct.Struct("<BHBBBBBBHHIIII")
_ACK = struct.Struct("<BHBB")
_TELEMETRY = struct.Struct("<BHIIHHHHBBhhhh")
_MOTOR = struct.Struct("<iihhhB")


class Kind(IntEnum):
    """The first byte of a payload: commands of the host, and (from 0x81) messages of the node."""

    HELLO = 0x01
    DRIVE = 0x02
    STOP = 0x03
    CLEAR = 0x04
    WELCOME = 0x81
    ACK = 0x82
    TELEMETRY = 0x83


class Status(IntEnum):
    """Result of a command at the node."""

    OK = 0
    NOT_GREETED = 1
    REPEATED = 2
    OUT_OF_ORDER = 3
    BAD_VALUE = 4
    FAULTED = 5
    UNKNOWN_COMMAND = 6


class Fault(IntEnum):
    """Fault that made the node stop its motors; it stays until cleared."""

    NONE = 0
    STALL = 1
    OVER_TEMPERATURE = 2


class Sensor(IntFlag):
    """What the node can measure, beside each motor's frequency."""

    CURRENT = 1
    MOTOR_TEMPERATURE = 2
    BOARD_TEMPERATURE = 4
    ACCELEROMETER = 8


class Flag(IntFlag):
    """The node's condition."""

    GREETED = 1  # a host has said hello since the boot
    DRIVING = 2  # a set-point is in force


@dataclass(frozen=True, slots=True)
class Welcome:
    """The answer to a hello: who the node is and what it can do."""

    sequence: int
    protocol: int
    firmware: tuple[int, int, int]
    motor_count: int
    sensors: Sensor
    watchdog_s: float
    telemetry_s: float
    max_hz: float
    ramp_hz_s: float
    boot_id: int
    uptime_ms: int


@dataclass(frozen=True, slots=True)
class Ack:
    """The answer to any other command."""

    sequence: int
    command: int
    status: Status


@dataclass(frozen=True, slots=True)
class MotorReport:
    """One motor in the telemetry: measured frequency, ramped set-point, share of the supply, and sensors."""

    measured_hz: float
    ramped_hz: float
    output: float
    current_a: float | None
    temperature_c: float | None
    fault: Fault


@dataclass(frozen=True, slots=True)
class Telemetry:
    """State of the node, sent at a fixed rate.

    Args:
        sequence: counts the telemetry since the boot.
        device_ms: time since the boot.
        boot_id: differs from boot to boot.
        command: sequence number of the last command that was taken.
        lost: commands that never came, since the hello (modulo 65536).
        expiries: how often hold or watchdog has stopped the motors, since the hello (modulo 65536).
        bad_frames: frames that came damaged, since the boot (modulo 65536).
        flags, fault: of the node as a whole.
        temperature_c: of the board; None where it is not known.
        acceleration_m_s2: x, y, z of the board; None where it is not known.
        motors: one report for each.
    """

    sequence: int
    device_ms: int
    boot_id: int
    command: int
    lost: int
    expiries: int
    bad_frames: int
    flags: Flag
    fault: Fault
    temperature_c: float | None
    acceleration_m_s2: tuple[float, float, float] | None
    motors: tuple[MotorReport, ...]


Message = Welcome | Ack | Telemetry


def encode_frame(payload: bytes) -> bytes:
    """Return the frame that carries ``payload``."""
    crc = binascii.crc_hqx(payload, 0xFFFF)
    return bytes(cobs.encode(payload + crc.to_bytes(2, "little"))) + b"\0"


def decode_frame(frame: bytes) -> bytes:
    """Return the payload of a frame without its end mark. Raises ValueError if the frame is damaged."""
    try:
        content = bytes(cobs.decode(frame))
    except cobs.DecodeError as error:
        raise ValueError(f"not COBS: {error}") from error
    payload, crc = content[:-2], content[-2:]
    if not payload or binascii.crc_hqx(payload, 0xFFFF).to_bytes(2, "little") != crc:
        raise ValueError(f"wrong check sum {crc.hex()} of {payload.hex()}")
    return payload


def encode_hello(sequence: int) -> bytes:
    """Return the frame that begins a session: motors stop, and commands count from ``sequence`` on."""
    return encode_frame(_COMMAND.pack(Kind.HELLO, sequence) + bytes([PROTOCOL]))


def encode_drive(sequence: int, frequency_hz: Sequence[float], hold_s: float) -> bytes:
    """Return the frame with the set-point of all motors, kept in force for ``hold_s`` at most (1 ms to 65 s)."""
    targets = [round(1000.0 * frequency) for frequency in frequency_hz]
    hold_ms = round(1000.0 * hold_s)
    return encode_frame(_DRIVE.pack(Kind.DRIVE, sequence, hold_ms) + struct.pack(f"<{len(targets)}i", *targets))


def encode_stop(sequence: int) -> bytes:
    """Return the frame that stops all motors; the node obeys it whatever its sequence number."""
    return encode_frame(_COMMAND.pack(Kind.STOP, sequence))


def encode_clear(sequence: int) -> bytes:
    """Return the frame that clears faults, as far as their causes are gone."""
    return encode_frame(_COMMAND.pack(Kind.CLEAR, sequence))


def decode(payload: bytes) -> Message:
    """Return what the node says in a payload of a byte or more. Raises ValueError if it makes no sense."""
    try:
        match payload[0]:
            case Kind.WELCOME:
                return _decode_welcome(payload)
            case Kind.ACK:
                return _decode_ack(payload)
            case Kind.TELEMETRY:
                return _decode_telemetry(payload)
    except struct.error as error:
        raise ValueError(f"{payload.hex()} is cut short: {error}") from error
    raise ValueError(f"{payload.hex()} is not a message of a node")


class Decoder:
    """Finds messages in a stream of bytes. ``bad_frames`` counts the garbled frames, which are discarded and logged."""

    def __init__(self) -> None:
        self.bad_frames = 0
        self._rest = b""

    def feed(self, data: bytes) -> list[Message]:
        """Return the messages that ``data`` completes."""
        *frames, self._rest = (self._rest + data).split(b"\0")
        # An endless frame is noise: one byte more than the longest frame suffices to recognise it.
        self._rest = self._rest[: _LONGEST_FRAME + 1]
        messages = []
        for frame in filter(None, frames):
            try:
                messages.append(decode(decode_frame(frame)))
            except ValueError as error:
                self.bad_frames += 1
                _log.debug("garbled frame discarded: %s", error)
        return messages


def _decode_welcome(payload: bytes) -> Welcome:
    _, sequence, protocol, *rest = _WELCOME.unpack(payload)
    major, minor, patch, motors, sensors, watchdog_ms, telemetry_ms, max_mhz, ramp_mhz_s, boot_id, uptime_ms = rest
    return Welcome(
        sequence,
        protocol,
        (major, minor, patch),
        motors,
        Sensor(sensors),
        watchdog_ms / 1000.0,
        telemetry_ms / 1000.0,
        max_mhz / 1000.0,
        ramp_mhz_s / 1000.0,
        boot_id,
        uptime_ms,
    )


def _decode_ack(payload: bytes) -> Ack:
    _, sequence, command, status = _ACK.unpack(payload)
    return Ack(sequence, command, Status(status))


def _decode_telemetry(payload: bytes) -> Telemetry:
    _, sequence, device_ms, boot_id, command, lost, expiries, bad, flags, fault, temperature_dc, *acceleration_mg = (
        _TELEMETRY.unpack_from(payload)
    )
    known = _UNKNOWN not in acceleration_mg
    x, y, z = (0.00980665 * value for value in acceleration_mg)
    return Telemetry(
        sequence,
        device_ms,
        boot_id,
        command,
        lost,
        expiries,
        bad,
        Flag(flags),
        Fault(fault),
        _measured(temperature_dc, 10.0),
        (x, y, z) if known else None,
        tuple(map(_decode_motor, _MOTOR.iter_unpack(payload[_TELEMETRY.size :]))),
    )


def _decode_motor(fields: tuple[int, ...]) -> MotorReport:
    measured_mhz, ramped_mhz, output, current_ma, temperature_dc, fault = fields
    return MotorReport(
        measured_mhz / 1000.0,
        ramped_mhz / 1000.0,
        output / 1000.0,
        _measured(current_ma, 1000.0),
        _measured(temperature_dc, 10.0),
        Fault(fault),
    )


def _measured(value: int, scale: float) -> float | None:
    """Return a reading in its unit; None where there is no sensor or it does not answer."""
    return None if value == _UNKNOWN else value / scale
