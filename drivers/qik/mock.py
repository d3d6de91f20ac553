"""Mock qik 2s9v1 boards on one line: two boards with three motors, as on the published robot.

They understand the compact and the Pololu protocol from any program, not only from our driver.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import and_
from pathlib import Path
from typing import Literal

from vvvaltr.drivers.links.curve import Curve
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.port import PtyPort
from vvvaltr.drivers.qik.protocol import ERRORS, SET_KEY, START, Opcode, Parameter, compute_crc7, watchdog_timeout_s
from vvvaltr.drivers.qik.table import QikLineTable, QikMotorTable
from vvvaltr.drivers.registry import MockLine

# A motor with friction: at rest it needs more than at the slowest turning.
CURVE = Curve(((14.0, 1.8), (40.0, 6.0), (80.0, 11.5), (127.0, 16.5)))
_STARTS_AT = 20.0

_OVERRUN, _FRAME, _CRC, _FORMAT, _TIMEOUT = ERRORS
_VALUES = {Parameter.DEVICE_ID: 128, Parameter.PWM: 4, Parameter.SHUT_DOWN: 2, Parameter.TIMEOUT: 128}
_LENGTHS = {Opcode.FIRMWARE: 0, Opcode.ERRORS: 0, Opcode.GET: 1, Opcode.SET: 4, Opcode.COAST: 0}
_LENGTHS_BY_CODE = {
    **{int(command): length for command, length in _LENGTHS.items()},
    Opcode.COAST + 1: 0,
    **dict.fromkeys(range(Opcode.SPEED, Opcode.SPEED + 8), 1),
}
_SETTING_S = 0.004


@dataclass(slots=True)
class QikBoard:
    """One board: its permanent memory, its jumpers, and what it is doing."""

    parameters: list[int]
    has_crc: bool = False
    has_fixed_baud: bool = False
    speeds: list[int] = field(default_factory=lambda: [0, 0])
    errors: int = 0
    has_timed_out: bool = False
    is_silent: bool = False
    _knows_baud: bool = False
    _is_first: bool = False
    _valid_s: float = 0.0
    _packet: bytearray = field(default_factory=bytearray)
    _pending: list[tuple[float, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._knows_baud = self.has_fixed_baud

    def take(self, byte: int, now_s: float) -> None:
        """Receive one byte."""
        if not self._knows_baud:
            # The byte that tells the baud rate may begin a packet already; if not, that is not an error.
            self._knows_baud = self._is_first = byte == START
            self._packet = bytearray((START,)) if self._knows_baud else bytearray()
            return
        if byte & 0x80:
            if self._packet and not self._is_first:
                self.fail(_FORMAT)
            self._packet = bytearray((byte,))
        elif self._packet:
            self._packet.append(byte)
        self._is_first = False
        self._finish(now_s)

    def tick(self, now_s: float) -> None:
        """Check whether the serial timeout has expired."""
        limit_s = watchdog_timeout_s(self.parameters[Parameter.TIMEOUT])
        if limit_s and not self.has_timed_out and now_s - self._valid_s > limit_s:
            self.has_timed_out = True
            self.fail(_TIMEOUT)

    def replies(self, now_s: float) -> list[int]:
        """Return the replies that are due."""
        due = [reply for due_s, reply in self._pending if due_s <= now_s]
        self._pending = [(due_s, reply) for due_s, reply in self._pending if due_s > now_s]
        return [] if self.is_silent else due

    def fail(self, error: int) -> None:
        """Set an error bit, and stop the motors if so configured."""
        self.errors |= error
        if self.parameters[Parameter.SHUT_DOWN]:
            self.speeds = [0, 0]

    def share(self, output: int) -> float:
        """Return an output's speed as on the scale of 0 to 127, negative for reverse."""
        return self.speeds[output] / 255.0 * 127.0 if self._is_eight_bit else float(self.speeds[output])

    def reboot(self, now_s: float) -> None:
        """Restart after a loss of power."""
        self.speeds, self.errors, self.has_timed_out = [0, 0], 0, False
        self._knows_baud, self._valid_s = self.has_fixed_baud, now_s
        self._packet.clear()
        self._pending.clear()

    @property
    def _is_eight_bit(self) -> bool:
        return bool(self.parameters[Parameter.PWM] & 1)

    def _finish(self, now_s: float) -> None:
        """Execute the packet if it is complete and addressed to this board."""
        packet = bytes(self._packet)
        head = 3 if packet[:1] == bytes((START,)) else 1
        if len(packet) < head:
            return
        command = packet[head - 1] | 0x80
        is_mine = head == 1 or packet[1] == self.parameters[Parameter.DEVICE_ID]
        length = _LENGTHS_BY_CODE.get(command)
        if length is None:
            self._packet = bytearray()
            if is_mine:
                self.fail(_FORMAT)
        elif len(packet) == head + length + self.has_crc:
            self._packet = bytearray()
            if is_mine and self.has_crc and compute_crc7(packet[:-1]) != packet[-1]:
                self.fail(_CRC)
            elif is_mine:
                self._valid_s, self.has_timed_out = now_s, False
                self._obey(command, packet[head : head + length], now_s)

    def _obey(self, command: int, data: bytes, now_s: float) -> None:
        if command >= Opcode.SPEED:
            self._set_speed(command - Opcode.SPEED, data[0])
        elif command >= Opcode.COAST:
            self.speeds[command - Opcode.COAST] = 0
        elif command == Opcode.FIRMWARE:
            self._pending.append((now_s, ord("2")))
        elif command == Opcode.ERRORS:
            self._pending.append((now_s, self.errors))
            self.errors = 0
        elif command == Opcode.GET:
            self._pending.append((now_s, self._get(data[0])))
        elif (data[2], data[3]) != SET_KEY:
            self.fail(_FORMAT)
        else:
            self._pending.append((now_s + _SETTING_S, self._set(*data[:2])))

    def _set_speed(self, code: int, speed: int) -> None:
        if code & 1 and self._is_eight_bit:
            speed += 128
        self.speeds[code >> 2] = -speed if code & 2 else speed

    def _get(self, parameter: int) -> int:
        if parameter < len(self.parameters):
            return self.parameters[parameter]
        self.fail(_FORMAT)
        return 0xFF

    def _set(self, parameter: int, value: int) -> int:
        if parameter >= len(self.parameters):
            return 1
        if value >= _VALUES[Parameter(parameter)]:
            return 2
        self.parameters[parameter] = value
        if parameter == Parameter.PWM:
            self.speeds = [0, 0]
        return 0


class QikDevice:
    """Boards on one line: a mock ``Device``.

    Args:
        motors: (device id, output) of each motor.
        has_crc: the boards' CRC jumper is in place.
        has_fixed_baud: the boards' fixed-baud jumper is in place, so that they do not wait for the byte 0xAA.
    """

    def __init__(
        self,
        motors: Sequence[tuple[int, int]] = ((0, 0), (0, 1), (1, 0)),
        has_crc: bool = False,
        has_fixed_baud: bool = False,
    ) -> None:
        # As they come from the maker: no timeout, shut-down on error; only the device id has been changed.
        self.boards = {board: QikBoard([board, 0, 1, 0], has_crc, has_fixed_baud) for board, _ in motors}
        self._motors = tuple(motors)
        self._rotating = [False] * len(motors)
        self._stalled: set[int] = set()

    @property
    def applied_hz(self) -> tuple[float, ...]:
        """The frequencies that the motors' curve gives for the output stages."""
        return tuple(
            CURVE.frequency_hz(self.boards[board].share(output)) if self._rotating[number] else 0.0
            for number, (board, output) in enumerate(self._motors)
        )

    @property
    def watchdog(self) -> bool:
        """Whether a board's serial timeout has expired."""
        return any(board.has_timed_out for board in self.boards.values())

    @property
    def faults(self) -> tuple[str, ...]:
        """Errors that have not been read yet, and stalled motors."""
        errors = [
            f"board {number}: {name}"
            for number, board in self.boards.items()
            for bit, name in ERRORS.items()
            if board.errors & bit
        ]
        return (*errors, *(f"motor {number + 1}: stalled" for number in sorted(self._stalled)))

    def on_bytes(self, data: bytes, now_s: float) -> bytes:
        """Pass ``data`` to all boards; return their replies."""
        said = b""
        for byte in data:
            for board in self.boards.values():
                board.take(byte, now_s)
            self._update_rotation()
            said += self._replies(now_s)
        return said

    def tick(self, now_s: float) -> bytes:
        """Let time pass; return delayed replies."""
        for board in self.boards.values():
            board.tick(now_s)
        self._update_rotation()
        return self._replies(now_s)

    def begin_fault(self, fault: Fault, now_s: float) -> None:
        """Begin a stall, an error (its code is a bit of the error byte), or silence."""
        number = (fault.motor - 1) % len(self._motors)
        if fault.kind is Kind.STALL:
            self._stalled.add(number)
        elif fault.kind is Kind.ERROR:
            self.boards[self._motors[number][0]].fail(_FRAME if fault.code is None else fault.code & 0xF8)
        self._set_silence(fault, is_silent=True)
        self._update_rotation()

    def end_fault(self, fault: Fault, now_s: float) -> None:
        """End a stall or silence."""
        if fault.kind is Kind.STALL:
            self._stalled.discard((fault.motor - 1) % len(self._motors))
        self._set_silence(fault, is_silent=False)

    def reboot(self, now_s: float) -> None:
        """Reboot; the parameters are in permanent memory."""
        for board in self.boards.values():
            board.reboot(now_s)
        self._update_rotation()

    def _set_silence(self, fault: Fault, is_silent: bool) -> None:
        if fault.kind is Kind.SILENCE:
            for board in self.boards.values():
                board.is_silent = is_silent

    def _replies(self, now_s: float) -> bytes:
        """Return the boards' replies; two at once pull the line low where either does, and are one byte."""
        replies = [reply for board in self.boards.values() if (reply := board.replies(now_s))]
        return bytes(reduce(and_, column) for column in zip(*replies, strict=False)) if replies else b""

    def _update_rotation(self) -> None:
        """Start and stop the motors; friction is greater at rest than in motion."""
        for number, (board, output) in enumerate(self._motors):
            speed = abs(self.boards[board].share(output))
            least = CURVE.points[0][0] if self._rotating[number] else _STARTS_AT
            self._rotating[number] = speed >= least and number not in self._stalled


def make_mock(link: Path) -> MockLine:
    """Plug in boards under the port ``link``: a ``MockLine``. Raises ValueError for a name that is taken."""
    places: tuple[tuple[int, Literal[0, 1]], ...] = ((0, 0), (0, 1), (1, 0))
    motors = tuple(
        QikMotorTable(board=board, output=output, max_hz=CURVE.highest_hz, curve=CURVE.points)
        for board, output in places
    )
    return MockLine(PtyPort(link, is_paced=True), QikDevice(places), QikLineTable(port=str(link), motor=motors))
