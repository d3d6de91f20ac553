"""Pololu qik 2s9v1: two motors per board, several boards on one serial line, no sensors.

Bytes as in the controller's user's guide. Speeds are open loop: frequencies are those of the calibration curve. The
board acknowledges neither speeds nor stops, so its error byte is polled; speeds sent before a clean error byte count as
applied.
"""

from __future__ import annotations

import itertools
import math
import time

from vvvaltr.controller.core.errors import DeviceFault, DeviceTimeout, UserError
from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState
from vvvaltr.drivers.links.curve import Curve, to_commands
from vvvaltr.drivers.links.link import Link, discard, read_exactly
from vvvaltr.drivers.links.trouble import ECHO_CURE
from vvvaltr.drivers.motor_line import arm_or_close
from vvvaltr.drivers.qik.protocol import (
    ASK_PERIOD_S,
    SET_KEY,
    START,
    TELL_PERIOD_S,
    Opcode,
    Parameter,
    describe_errors,
    encode_packet,
    watchdog_timeout_s,
)
from vvvaltr.drivers.qik.table import QikLineTable

_ANSWER_S = 0.2  # line time and a USB adapter's latency come to 20 ms; the rest is for a busy computer
_QUIET_S = 0.05  # silence after which no answer to an earlier program is still to come
_ATTEMPTS = 3


def open_line(table: QikLineTable) -> QikLine:
    """Open the port, find all boards, switch on their watchdog, and return their motors at rest.

    Raises:
        ValueError: the table asks for what the boards or the line do not have.
        UserError: a motor has no curve.
        LinkLost: the port could not be opened.
        DeviceTimeout: a board does not answer.
        DeviceFault: a board does not take its configuration.
    """
    from vvvaltr.drivers.links.serial import SerialLink

    table.check()
    for motor in table.motor:
        if not motor.curve:
            raise UserError(f"line {table.port}: the motor on {motor.place} has no curve; run vvvaltr calibrate first")
    return arm_or_close(QikLine(SerialLink(table.port, table.baud), table))


class QikLine:
    """The boards on one line: a ``MotorLine``."""

    def __init__(self, link: Link, table: QikLineTable) -> None:
        motors = table.motor
        self._link = link
        self._table = table
        self._motors = motors
        self._curves = tuple(Curve(motor.curve) for motor in motors)
        # The greatest speed that does not exceed the motor's max_hz.
        self._max_speeds = tuple(math.floor(motor.max_command + 1e-6) for motor in motors)
        self._boards = tuple(dict.fromkeys(motor.board for motor in motors))
        self._next_motors = itertools.cycle(range(len(motors)))
        self._asking = itertools.cycle(self._boards)
        self._asked: tuple[int, float, tuple[int, ...]] | None = None
        self._next_ask_s = 0.0
        self._wanted = self._applied = (0,) * len(motors)
        self._sent = [0] * len(motors)
        self._spun_up_until_s = [0.0] * len(motors)
        self._heard_s = dict.fromkeys(self._boards, time.monotonic())
        self._is_resting = False

    @property
    def name(self) -> str:
        """The port."""
        return self._link.name

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return len(self._motors)

    @property
    def quantities(self) -> frozenset[Quantity]:
        """Frequencies only."""
        return frozenset({Quantity.FREQUENCY})

    @property
    def period_s(self) -> float:
        """Set-points are sent one motor at a time, so that a new one never waits long for the line."""
        return TELL_PERIOD_S / len(self._motors)

    @property
    def watchdog_s(self) -> float:
        """The boards' serial timeout."""
        return watchdog_timeout_s(self._table.timeout)

    @property
    def heard_s(self) -> float:
        """Time of the last answer of the board that has been silent for longest."""
        return min(self._heard_s.values())

    def check(self, gait: Gait) -> None:
        """Raise ValueError for a frequency that a calibration curve does not reach."""
        to_commands(self._curves, gait.frequency_hz, self.name)

    def send(self, gait: Gait) -> None:
        """Send all speeds to motors at rest. ``repeat`` sends later changes: the line has no capacity for more."""
        now_s = time.monotonic()
        self._want(gait, now_s)
        if self._is_resting:
            self._is_resting = False
            self._link.write(b"".join(self._speed(number, now_s) for number in range(len(self._motors))))

    def repeat(self, gait: Gait) -> None:
        """Send the speed of the next motor."""
        now_s = time.monotonic()
        self._want(gait, now_s)
        self._link.write(self._speed(next(self._next_motors), now_s))

    def rest(self) -> None:
        """Send speed 0 to all motors, and once that has been done, to the next motor."""
        self._wanted = (0,) * len(self._motors)
        numbers = (next(self._next_motors),) if self._is_resting else range(len(self._motors))
        self._link.write(b"".join(self._speed(number, time.monotonic()) for number in numbers))
        self._is_resting = True

    def listen(self, until_s: float) -> None:
        """Poll the boards' error bytes in turn. Raises DeviceFault for an error, DeviceTimeout for no answer."""
        while True:
            now_s = time.monotonic()
            if self._asked is None and now_s >= self._next_ask_s:
                self._ask(now_s)
            if answer := self._link.read(1, max(0.0, until_s - now_s)):
                self._take(answer[0])
            # Judged by what had arrived before the line was read: this thread itself may have been held up since.
            elif self._asked is not None and now_s - self._asked[1] > _ANSWER_S:
                board, self._asked = self._asked[0], None
                raise DeviceTimeout(
                    f"{self.name}: board {board} did not answer within {_ANSWER_S:g} s; check its wiring"
                )
            if now_s >= until_s:
                return

    def state(self) -> MotorState:
        """Return the frequencies of the speeds that the boards have accepted."""
        applied_hz = tuple(c.frequency_hz(speed) for c, speed in zip(self._curves, self._applied, strict=True))
        return MotorState(self.heard_s, applied_hz, measured=False)

    def close(self) -> None:
        """Release the line."""
        self._link.close()

    def arm(self) -> None:
        """Find all boards, configure them and read that back. Raises as ``open_line`` does."""
        # A packet that an earlier program left unfinished makes the first ones fail; the error byte is read at the end.
        self._link.write(bytes((START,)))
        while self._link.read(64, _QUIET_S):
            pass  # answers to an earlier program
        for board in self._boards:
            self._find(board)
            self._configure(board, Parameter.PWM, int(self._table.eight_bit))
            self._configure(board, Parameter.SHUT_DOWN, 1)
            self._configure(board, Parameter.TIMEOUT, self._table.timeout)
        self.rest()
        for board in self._boards:
            self._query(board, Opcode.ERRORS)
            self._heard_s[board] = time.monotonic()

    def _find(self, board: int) -> None:
        for attempt in range(1, _ATTEMPTS + 1):
            try:
                return self._greet(board)
            except (DeviceTimeout, DeviceFault):
                if attempt == _ATTEMPTS:
                    raise

    def _greet(self, board: int) -> None:
        try:
            version = self._query(board, Opcode.FIRMWARE)
        except DeviceTimeout:
            raise DeviceTimeout(
                f"{self.name}: no board answers as number {board}; check power, wiring, baud rate and the board's "
                "device id"
            ) from None
        if version == START:
            raise DeviceFault("echo", f"{self.name}: what is sent comes back: {ECHO_CURE}")
        if version not in b"12":
            raise DeviceFault(
                "firmware", f"{self.name}: board {board} answers {version:#04x}, which is not a qik 2s9v1; correct port"
            )

    def _configure(self, board: int, parameter: Parameter, value: int) -> None:
        # The permanent memory wears out, so it is written only where a value has to change.
        if self._query(board, Opcode.GET, parameter) == value:
            return
        self._query(board, Opcode.SET, parameter, value, *SET_KEY)
        if (kept := self._query(board, Opcode.GET, parameter)) != value:
            raise DeviceFault(
                "configuration",
                f"{self.name}: board {board} keeps {kept} as its {parameter.name.lower()} parameter instead of "
                f"{value}; check the wiring, then switch the board off and on",
            )

    def _query(self, board: int, command: Opcode, *data: int) -> int:
        discard(self._link)
        self._link.write(encode_packet(board, command, *data, has_crc=self._table.crc))
        return read_exactly(self._link, 1, time.monotonic() + _ANSWER_S)[0]

    def _want(self, gait: Gait, now_s: float) -> None:
        """Note the commands, negative for reverse, and until when which motors are spun up."""
        commands = tuple(map(round, to_commands(self._curves, gait.frequency_hz, self.name)))
        for number, (before, after) in enumerate(zip(self._wanted, commands, strict=True)):
            if not 0 < abs(after) < self._table.spin_up_below:
                self._spun_up_until_s[number] = now_s
            elif before * after <= 0:
                self._spun_up_until_s[number] = now_s + self._table.spin_up_s
        self._wanted = commands

    def _speed(self, number: int, now_s: float) -> bytes:
        motor, speed = self._motors[number], self._wanted[number]
        is_spinning_up = speed and now_s < self._spun_up_until_s[number]
        magnitude = max(abs(speed), self._max_speeds[number]) if is_spinning_up else abs(speed)
        self._sent[number] = -magnitude if speed < 0 else magnitude
        command = Opcode.SPEED + 4 * motor.output + 2 * (speed < 0) + (magnitude > 127)
        return encode_packet(motor.board, command, magnitude & 0x7F, has_crc=self._table.crc)

    def _ask(self, now_s: float) -> None:
        board = next(self._asking)
        self._asked = (board, now_s, tuple(self._sent))
        self._next_ask_s = now_s + ASK_PERIOD_S
        self._link.write(encode_packet(board, Opcode.ERRORS, has_crc=self._table.crc))

    def _take(self, answer: int) -> None:
        if self._asked is None:
            raise DeviceFault(
                "sequence", f"{self.name}: the byte {answer:#04x} came without a request; check the wiring for noise"
            )
        (board, _, sent), self._asked = self._asked, None
        if answer:
            code, what = describe_errors(answer)
            raise DeviceFault(code, f"{self.name}: board {board} reports {what}")
        self._heard_s[board] = time.monotonic()
        self._applied = tuple(
            now if motor.board == board else before
            for motor, now, before in zip(self._motors, sent, self._applied, strict=True)
        )
