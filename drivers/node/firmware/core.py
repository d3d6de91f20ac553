"""The motor node without its hardware: bytes and time in, bytes and motor outputs out.

Runs under MicroPython and CPython. docs/node-protocol.md tells the protocol, board.py what a board has to offer.
"""

import struct

from .control import TICKS, SpeedLoop, SpeedMeter
from .framing import FrameReader, encode

TYPE_CHECKING = False  # MicroPython has no typing; type checkers know the name
if TYPE_CHECKING:
    from .board import Board

PROTOCOL = 1
VERSION = (1, 0, 0)
WATCHDOG_MS = 250
TELEMETRY_MS = 20
UNKNOWN = -32768

# Commands and answers
HELLO, DRIVE, STOP, CLEAR = 0x01, 0x02, 0x03, 0x04
WELCOME, ACK, TELEMETRY = 0x81, 0x82, 0x83
# How a command was taken
OK, NOT_GREETED, REPEATED, OUT_OF_ORDER, BAD_VALUE, FAULTED, UNKNOWN_COMMAND = range(7)
# Faults: they stay until cleared
NO_FAULT, STALL, OVER_TEMPERATURE = range(3)
# Sensors
CURRENT, MOTOR_TEMPERATURE, BOARD_TEMPERATURE, ACCELEROMETER = 1, 2, 4, 8
# Flags of the telemetry
GREETED, DRIVING = 1, 2

_CONTROL_MS = 10
_MOTOR_LIMIT_DC = 800
_BOARD_LIMIT_DC = 700
_COOLER_DC = 50  # a fault of heat can be cleared this far below its limit


class Node:
    """A motor node.

    Args:
        board: the hardware.
        settings: ``motors``, ``max_mhz``, ``no_load_mhz``, ``ramp_mhz_s``, ``counts_per_turn`` and ``sensors``.
        boot_id: 30 bits that differ from boot to boot.
        now_ms: the present.
    """

    def __init__(self, board: "Board", settings: dict[str, int], boot_id: int, now_ms: int) -> None:
        motors = settings["motors"]
        self.loops = [SpeedLoop(settings["no_load_mhz"], settings["ramp_mhz_s"]) for _ in range(motors)]
        self.meters = [SpeedMeter(settings["counts_per_turn"]) for _ in range(motors)]
        self.motor_faults = [NO_FAULT] * motors
        self.fault = NO_FAULT
        self.is_driving = False
        self.is_expired = False  # hold or watchdog has stopped the motors, and no command came since
        self._board = board
        self._settings = settings
        self._boot_id = boot_id & TICKS
        self._reader = FrameReader()
        self._greeted = False
        self._sequence = 0  # of the last command that was taken
        self._lost = 0
        self._expiries = 0
        self._heard_ms = self._controlled_ms = self._told_ms = now_ms
        self._hold_ms = 0
        self._control_now = False
        self._told = 0
        self._release()

    def on_bytes(self, data: bytes, now_ms: int) -> bytes:
        """Take bytes from the line; return the bytes of the answers."""
        return b"".join([encode(self._answer(payload, now_ms)) for payload in self._reader.feed(data)])

    def tick(self, now_ms: int, now_us: int) -> bytes:
        """Do what is due, at least every few milliseconds; return the bytes of telemetry, if any."""
        if self.is_driving:
            self._expire(now_ms)
        elapsed_ms = (now_ms - self._controlled_ms) & TICKS
        if elapsed_ms >= _CONTROL_MS or (self._control_now and elapsed_ms):
            self._control_now = False
            self._controlled_ms = now_ms
            self._control(min(elapsed_ms, 5 * _CONTROL_MS), now_us)
        if (now_ms - self._told_ms) & TICKS < TELEMETRY_MS:
            return b""
        # From deadline to deadline, so that the rate is kept; but after a pause not one for each that was missed.
        self._told_ms = (self._told_ms + TELEMETRY_MS) & TICKS
        if (now_ms - self._told_ms) & TICKS >= TELEMETRY_MS:
            self._told_ms = now_ms
        return encode(self._telemetry(now_ms))

    def _answer(self, payload: bytes, now_ms: int) -> bytes:
        if len(payload) < 3:
            return struct.pack("<BHBB", ACK, 0, payload[0], UNKNOWN_COMMAND)
        command, sequence = struct.unpack_from("<BH", payload)
        if command == HELLO and len(payload) == 4:
            return self._greet(sequence, payload[3], now_ms)
        return struct.pack("<BHBB", ACK, sequence, command, self._obey(command, sequence, payload, now_ms))

    def _greet(self, sequence: int, protocol: int, now_ms: int) -> bytes:
        self._release()  # nothing of an earlier host stays in force, except faults
        self._greeted = protocol == PROTOCOL
        self._sequence = sequence
        self._lost = self._expiries = 0
        s = self._settings
        return struct.pack(
            "<BHBBBBBBHHIIII",
            WELCOME,
            sequence,
            PROTOCOL,
            VERSION[0],
            VERSION[1],
            VERSION[2],
            s["motors"],
            s["sensors"],
            WATCHDOG_MS,
            TELEMETRY_MS,
            s["max_mhz"],
            s["ramp_mhz_s"],
            self._boot_id,
            now_ms & TICKS,
        )

    def _obey(self, command: int, sequence: int, payload: bytes, now_ms: int) -> int:
        order = self._order(sequence)
        if command == STOP:
            self._release()  # always: a stop is never too old, and needs no greeting
            return OK
        if order != OK:
            return order
        if command == DRIVE:
            return self._drive(payload, now_ms)
        return self._clear() if command == CLEAR else UNKNOWN_COMMAND

    def _order(self, sequence: int) -> int:
        """Take a command's number; return ``OK`` if it is the command's turn."""
        if not self._greeted:
            return NOT_GREETED
        ahead = (sequence - self._sequence) & 0xFFFF
        if ahead == 0:
            return REPEATED
        if ahead > 0x7FFF:
            return OUT_OF_ORDER
        self._lost = (self._lost + ahead - 1) & 0xFFFF
        self._sequence = sequence
        return OK

    def _drive(self, payload: bytes, now_ms: int) -> int:
        motors = len(self.loops)
        if len(payload) != 5 + 4 * motors:
            return BAD_VALUE
        hold_ms = struct.unpack_from("<H", payload, 3)[0]
        targets = struct.unpack_from("<" + "i" * motors, payload, 5)
        limit = self._settings["max_mhz"]
        if hold_ms == 0 or max(targets) > limit or min(targets) < -limit:
            return BAD_VALUE
        if self.has_fault:
            return FAULTED
        for motor in range(motors):
            self.loops[motor].target_mhz = targets[motor]
        self._hold_ms = hold_ms
        self._heard_ms = now_ms
        self.is_driving = self._control_now = True
        self.is_expired = False
        return OK

    def _clear(self) -> int:
        self._release()
        if self._is_hot(_COOLER_DC):
            return FAULTED
        self.fault = NO_FAULT
        for motor in range(len(self.motor_faults)):
            self.motor_faults[motor] = NO_FAULT
        return OK

    @property
    def has_fault(self) -> bool:
        """Whether the node, or any of its motors, has a fault."""
        return self.fault != NO_FAULT or any(self.motor_faults)

    def _expire(self, now_ms: int) -> None:
        if (now_ms - self._heard_ms) & TICKS >= min(self._hold_ms, WATCHDOG_MS):
            self._release()
            self.is_expired = True
            self._expiries = (self._expiries + 1) & 0xFFFF

    def _control(self, elapsed_ms: int, now_us: int) -> None:
        for motor in range(len(self.loops)):
            loop = self.loops[motor]
            meter = self.meters[motor]
            count, edge_us = self._board.encoder(motor)
            meter.update(count, edge_us, now_us)
            self._board.set_output(motor, loop.regulate(meter.mhz, meter.is_news, elapsed_ms))
            if loop.is_stalled(meter.edge_mhz, elapsed_ms):
                self._fail(STALL, motor)

    def _fail(self, fault: int, motor: int | None = None) -> None:
        """Stop all motors, since a trial with one missing is worth nothing, and keep the reason."""
        if motor is None:
            self.fault = fault
        else:
            self.motor_faults[motor] = fault
        self._release()

    def _release(self) -> None:
        self.is_driving = self.is_expired = False
        for motor in range(len(self.loops)):
            self.loops[motor].release()
            self._board.set_output(motor, 0)

    def _watch_heat(self) -> None:
        if self._board.board_temperature_dc() > _BOARD_LIMIT_DC:
            self._fail(OVER_TEMPERATURE)
        for motor in range(len(self.loops)):
            if self._board.temperature_dc(motor) > _MOTOR_LIMIT_DC:
                self._fail(OVER_TEMPERATURE, motor)

    def _is_hot(self, margin_dc: int) -> bool:
        motors = [self._board.temperature_dc(motor) for motor in range(len(self.loops))]
        board = self._board.board_temperature_dc()
        return board > _BOARD_LIMIT_DC - margin_dc or max(motors) > _MOTOR_LIMIT_DC - margin_dc

    def _telemetry(self, now_ms: int) -> bytes:
        self._watch_heat()
        board = self._board
        acceleration = board.acceleration_mg()
        self._told = (self._told + 1) & 0xFFFF
        head = struct.pack(
            "<BHIIHHHHBBhhhh",
            TELEMETRY,
            self._told,
            now_ms & TICKS,
            self._boot_id,
            self._sequence,
            self._lost,
            self._expiries,
            self._reader.bad_frames,
            (GREETED if self._greeted else 0) | (DRIVING if self.is_driving else 0),
            self.fault,
            board.board_temperature_dc(),
            acceleration[0],
            acceleration[1],
            acceleration[2],
        )
        return head + b"".join([self._motor_telemetry(motor) for motor in range(len(self.loops))])

    def _motor_telemetry(self, motor: int) -> bytes:
        return struct.pack(
            "<iihhhB",
            self.meters[motor].mhz,
            self.loops[motor].ramped_mhz,
            self.loops[motor].output,
            self._board.current_ma(motor),
            self._board.temperature_dc(motor),
            self.motor_faults[motor],
        )
