"""The tables of qik 2s9v1 boards in a robot's file."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import msgspec
from msgspec import Meta

from vvvaltr.drivers.qik.protocol import GREATEST_BAUD, check_baud, check_commands, check_timeout
from vvvaltr.drivers.table import LineTable, MotorTable, NotNegative


class QikMotorTable(MotorTable, frozen=True, kw_only=True):
    """A motor at an output (0 or 1) of the board with this device id."""

    board: Annotated[int, Meta(ge=0, le=127)]
    output: Literal[0, 1]

    @property
    def place(self) -> str:
        """Board and output."""
        return f"board {self.board}, output {self.output}"


class QikLineTable(LineTable, frozen=True, kw_only=True, tag="qik"):
    """Pololu qik 2s9v1 boards on a serial line, and how they are run.

    Args:
        port: the serial port.
        baud: bits per second.
        motor: the motors, each with its curve.
        eight_bit: speeds of 0 to 255 instead of 0 to 127.
        crc: the boards' CRC jumper is in place.
        timeout: the value of the serial timeout parameter; 1 is the shortest, 0.262 s.
        spin_up_s: how long a motor that starts slowly first gets the speed of its ``max_hz``.
        spin_up_below: a command below this is slow.
    """

    port: str
    baud: Annotated[int, Meta(ge=1200, le=GREATEST_BAUD)] = 19200
    motor: tuple[QikMotorTable, ...]
    eight_bit: bool = False
    crc: bool = False
    timeout: Annotated[int, Meta(ge=0, le=127)] = 1
    spin_up_s: NotNegative = 0.2
    spin_up_below: Annotated[int, Meta(ge=0, le=255)] = 25

    @property
    def max_speed(self) -> float:
        """The greatest command that the boards have."""
        return 255.0 if self.eight_bit else 127.0

    def check(self) -> None:
        """Raise ValueError for no watchdog, a line too slow for its motors, or a curve beyond the boards' commands."""
        check_timeout(self.timeout)
        check_baud(self.baud, len(self.motor), self.crc)
        for number, motor in enumerate(self.motor, start=1):
            try:
                check_commands(motor.curve, self.eight_bit)
            except ValueError as error:
                raise ValueError(f"motor[{number}].curve: {error}") from None

    def remove_curves(self) -> Self:
        """Return the line with a curve by which each motor's frequency is its command."""
        straight = ((1.0, 1.0), (self.max_speed, self.max_speed))
        motors = tuple(motor.by_command(self.max_speed, straight) for motor in self.motor)
        return msgspec.structs.replace(self, motor=motors)
