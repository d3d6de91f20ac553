"""The qik's protocol: packets, parameters, errors, and how many motors a line has capacity for.

As in the controller's user's guide.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from vvvaltr.drivers.links.trouble import ECHO_CURE
from vvvaltr.drivers.motor_line import WATCHDOG

START = 0xAA  # begins a packet of the Pololu protocol; the board also finds the baud rate from it
SET_KEY = (0x55, 0x2A)  # must follow a new value
ERRORS = {0x08: "data overrun", 0x10: "frame error", 0x20: "CRC error", 0x40: "format error", 0x80: WATCHDOG}
_CURES = {
    0x08: "bytes came faster than it takes them; lower the baud rate",
    0x10: "a byte came damaged; check wiring, ground and baud rate",
    0x20: "a command came damaged; check the wiring for noise, and that crc in the robot's file is as the CRC jumper",
    0x40: "a command made no sense; check wiring and baud rate, and that no other program or board sends on this line",
    0x80: "no command came in time, so it stopped its motors; check cable and plugs, and end programs that keep this "
    "computer busy",
}
TIMEOUT_UNIT_S = 0.262
LONGEST_TIMEOUT_S = 1.0
GREATEST_BAUD = 38400
ASK_PERIOD_S = 0.02
TELL_PERIOD_S = 0.02  # between two set-points of one motor
_MARGIN = 1.2  # for bytes that are not evenly spread over time


class Opcode(IntEnum):
    """Commands as in the compact protocol; without the top bit in the Pololu protocol."""

    FIRMWARE = 0x81
    ERRORS = 0x82
    GET = 0x83
    SET = 0x84
    COAST = 0x86
    SPEED = 0x88  # + 4 for motor 1, + 2 for reverse, + 1 for 128 more


class Parameter(IntEnum):
    """Configuration parameters, kept in the board's permanent memory."""

    DEVICE_ID = 0
    PWM = 1
    SHUT_DOWN = 2
    TIMEOUT = 3


def describe_errors(answer: int) -> tuple[str, str]:
    """Return the name of the gravest error in an error byte, and all of them in words, with the cure of that one."""
    if answer == START:
        return "echo", f"{answer:#04x}, which is what was sent: {ECHO_CURE}"
    bits = [bit for bit in ERRORS if answer & bit]
    if not bits:
        return "garbled", f"{answer:#04x}, which is no error of a qik; check the wiring for noise"
    names = ", ".join(ERRORS[bit] for bit in bits)
    return ERRORS[bits[-1]], f"{names} ({answer:#04x}): {_CURES[bits[-1]]}"


def compute_crc7(data: bytes) -> int:
    """Return the CRC-7 of a packet: polynomial 0x91, least significant bit first."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc ^ 0x91 if crc & 1 else crc) >> 1
    return crc


def encode_packet(board: int, command: int, *data: int, has_crc: bool = False) -> bytes:
    """Return a packet of the Pololu protocol."""
    body = bytes((START, board, command & 0x7F, *data))
    return body + bytes((compute_crc7(body),)) if has_crc else body


def watchdog_timeout_s(value: int) -> float:
    """Return what a value of the serial timeout parameter means: 0.262 s * (low four bits) * 2^(upper three bits)."""
    return TIMEOUT_UNIT_S * (value & 0x0F) * float(1 << (value >> 4))


def check_timeout(value: int) -> None:
    """Raise ValueError for a serial timeout that is off, or above 1 s; its text begins with the key."""
    # 0 s switches the watchdog off.
    allowed = [known for known in range(128) if 0.0 < watchdog_timeout_s(known) <= LONGEST_TIMEOUT_S]
    if value not in allowed:
        times = ", ".join(f"{known} ({watchdog_timeout_s(known):g} s)" for known in allowed)
        raise ValueError(f"timeout is {value}, which means {watchdog_timeout_s(value):g} s; allowed: {times}")


def least_baud(motor_count: int, has_crc: bool) -> int:
    """Return the bits per second that a line needs: all set-points, a question and its answer, each every 0.02 s.

    A byte is ten bits on the line. On a slower line a stop would wait for the set-points that were sent before it.
    """
    set_point = len(encode_packet(0, Opcode.SPEED, 0, has_crc=has_crc))
    question_and_answer = len(encode_packet(0, Opcode.ERRORS, has_crc=has_crc)) + 1
    return round(10.0 * _MARGIN * (motor_count * set_point / TELL_PERIOD_S + question_and_answer / ASK_PERIOD_S))


def check_baud(baud: int, motor_count: int, has_crc: bool) -> None:
    """Raise ValueError for a line that is too slow for so many motors; its text begins with the key."""
    if baud < (least := least_baud(motor_count, has_crc)):
        raise ValueError(
            f"baud is {baud}; allowed: {least} or more, which {motor_count} motors on one line need "
            f"(the boards know up to {GREATEST_BAUD})"
        )


def check_commands(points: Sequence[tuple[float, float]], eight_bit: bool) -> None:
    """Raise ValueError for a curve with commands that the boards do not have."""
    allowed = "up to 255" if eight_bit else "up to 127, or up to 255 with eight_bit = true"
    if (last := max((command for command, _ in points), default=0.0)) > (255 if eight_bit else 127):
        raise ValueError(f"its commands reach {last:g}; allowed: {allowed}")
