"""The ODrive's CANSimple protocol: identifiers, payloads and errors. Velocities are in turns per second.

odrive.dbc beside this file describes the same messages for other tools, and a test holds the two together.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from enum import IntEnum

from vvvaltr.drivers.links.can import Frame
from vvvaltr.drivers.motor_line import LOW_SUPPLY, WATCHDOG
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
    0x00000002: LOW_SUPPLY,
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
    0x00000200: LOW_SUPPLY,
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
"""Names of the bits of an axis error that a user may meet."""

_CURES = {
    WATCHDOG: "no command came in time; check the wiring of the bus, and end programs that keep this computer busy",
    LOW_SUPPLY: "charge the battery, or check the supply and its cable",
    "supply voltage too high": "check the supply, and the drive's brake resistor",
    "supply current too high": "let the motors turn freely, or raise the drive's limit of the supply current",
    "current limit exceeded": "let the motor turn freely, or check max_a in the robot's file",
    "velocity limit exceeded": "let the motor's load be as it was tuned, or raise the drive's velocity limit",
    "spin-out": "check that the encoder and the motor are firmly on their shaft",
    "encoder failed": "check the encoder's cable",
    "no estimate of the motor's place": "check the encoder's cable, and calibrate the drive by the maker's tool",
    "emergency stop": "switch the drive off and on",
    "starting": "try again in a moment",
    **dict.fromkeys(
        ("too hot", "motor too hot", "output stage too hot"), "let it cool, then run the motors more slowly"
    ),
}
_OTHER_CURE = "read its errors with the maker's tool, and remove their cause"


def describe_errors(firmware: Firmware, error: int) -> tuple[str, str]:
    """Return the name of the most telling error of an axis, and all of them in words, with the cure of that one."""
    names = [name for bit, name in ERRORS[firmware].items() if error & bit] or ["an unknown error"]
    code = WATCHDOG if WATCHDOG in names else names[0]
    return code, f"{', '.join(names)} ({error:#x}); {_CURES.get(code, _OTHER_CURE)}"


VELOCITY_CONTROL, PASS_THROUGH = 2, 1


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
