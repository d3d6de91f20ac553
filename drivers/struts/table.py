"""The tables of radio struts in a robot's file."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

import msgspec
from msgspec import Meta

from vvvaltr.drivers.struts.protocol import GREATEST_BYTE, GREATEST_RPM, SLOWEST_BYTE, check_bytes
from vvvaltr.drivers.table import LineTable, MotorTable

NO_WATCHDOG_CURE = (
    "flash the firmware of drivers/struts/firmware, which has one, or set allow_no_watchdog = true in the robot's file "
    "and keep a hand at the switch of the struts"
)
_UUID = "^([0-9A-Fa-f]{4}|[0-9A-Fa-f]{8}(-[0-9A-Fa-f]{4}){3}-[0-9A-Fa-f]{12})?$"


class StrutTable(MotorTable, frozen=True, kw_only=True):
    """A strut: a board with one motor.

    Args:
        strut: the name that it advertises, or its address.
        characteristic: UUID of its characteristic; empty for the only one that serves.
    """

    strut: Annotated[str, Meta(min_length=1, max_length=60)]
    characteristic: Annotated[str, Meta(pattern=_UUID)] = ""

    @property
    def place(self) -> str:
        """The strut's name."""
        return self.strut


class StrutsLineTable(LineTable, frozen=True, kw_only=True, tag="struts"):
    """Struts on the air, opened together.

    Args:
        adapter: name of the Bluetooth adapter, as ``hci0``; empty for the first one. A path is the socket of a mock.
        firmware: ``auto`` for ours and the laboratory's, which are told apart by what they report; ``rfduino`` for the
            thesis' boards.
        allow_no_watchdog: whether struts may be driven whose motors run on when the radio link is lost.
        spin_up_s: how long a motor may take to start.
        least_battery_v: below this voltage a battery is empty, where the strut measures it; 0 for any.
    """

    addresses: ClassVar[frozenset[str]] = frozenset({"adapter"})

    adapter: Annotated[str, Meta(pattern=r"^[^\x00-\x1f]{0,100}$")] = ""
    firmware: Literal["auto", "rfduino"] = "auto"
    allow_no_watchdog: bool = False
    spin_up_s: Annotated[float, Meta(gt=0, le=10)] = 0.5
    least_battery_v: Annotated[float, Meta(ge=0, le=60)] = 3.0
    motor: tuple[StrutTable, ...]

    @property
    def is_rfduino(self) -> bool:
        """Whether these are the thesis' boards."""
        return self.firmware == "rfduino"

    @property
    def reverses(self) -> bool:
        """An RFduino's motor turns one way."""
        return not self.is_rfduino

    def check(self) -> None:
        """Raise ValueError for boards without a watchdog that are not allowed, or speeds beyond the boards'."""
        if self.is_rfduino and not self.allow_no_watchdog:
            raise ValueError(
                "allow_no_watchdog is false, and an RFduino has no watchdog: its motor runs on when the radio link is "
                "lost or this program is killed; use the boards of drivers/struts/firmware, or set "
                "allow_no_watchdog = true and keep a hand at the switch of the struts"
            )
        for number, motor in enumerate(self.motor, start=1):
            try:
                self._check_motor(motor)
            except ValueError as error:
                raise ValueError(f"motor[{number}].{error}") from None

    def remove_curves(self) -> Self:
        """Return the line with commands in place of frequencies; an RFduino's are bytes."""
        if not self.is_rfduino:
            return super().remove_curves()
        straight = ((float(SLOWEST_BYTE), float(SLOWEST_BYTE)), (float(GREATEST_BYTE), float(GREATEST_BYTE)))
        motors = tuple(motor.by_command(float(GREATEST_BYTE), straight) for motor in self.motor)
        return msgspec.structs.replace(self, motor=motors)

    def _check_motor(self, motor: StrutTable) -> None:
        if self.is_rfduino:
            try:
                check_bytes(motor.curve)
            except ValueError as error:
                raise ValueError(f"curve: {error}") from None
        elif motor.max_command > (limit_hz := GREATEST_RPM / 60.0) + 1e-9:
            raise ValueError(
                f"max_hz is {motor.max_hz:g}; allowed: up to {limit_hz:.2f}, since the boards cut a target to "
                f"{GREATEST_RPM} turns a minute"
            )
