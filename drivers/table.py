"""What the tables of a robot's file have in common; each device adds its own keys in the ``table.py`` of its folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Self

import msgspec
from msgspec import Meta

from vvvaltr.drivers.links.curve import UNCORRECTED, Curve, Uncorrected

# Beyond 1e6 is no length, time or frequency of a robot, and infinity times nothing is no number.
Positive = Annotated[float, Meta(gt=0, le=1e6)]
NotNegative = Annotated[float, Meta(ge=0, le=1e6)]
Finite = Annotated[float, Meta(ge=-1e6, le=1e6)]
AgeLimit = Annotated[float, Meta(gt=0, le=10)]
"""In s: an older pose is no longer the robot's, or a tracker that has died would never be missed."""

Points = tuple[tuple[Positive, Positive], ...]


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of the file. A misspelt key is refused."""


class MotorTable(Table, frozen=True, kw_only=True):
    """What every motor has.

    Args:
        max_hz: the greatest frequency in either sense of rotation.
        ramp_hz_s: the fastest change of frequency; 0 for no limit.
        curve: calibration, (command, Hz) points; empty for none.
    """

    max_hz: Positive
    ramp_hz_s: NotNegative = 0.0
    curve: Points = ()

    @property
    def place(self) -> str:
        """Where the motor is connected, in words; no two motors of a line may share it. Empty: the order decides."""
        return ""

    @property
    def calibration(self) -> Curve | Uncorrected:
        """The motor's curve; without one, a command is a frequency."""
        return Curve(self.curve) if self.curve else UNCORRECTED

    @property
    def max_command(self) -> float:
        """The command at which the motor turns at ``max_hz``."""
        return self.calibration.command(self.max_hz)

    def by_command(self, greatest: float, curve: Points = ()) -> Self:
        """Return the motor with commands of up to ``greatest`` in place of frequencies; its ramp is as steep."""
        per_hz = (self.max_command if self.curve else greatest) / self.max_hz
        return msgspec.structs.replace(self, curve=curve, max_hz=greatest, ramp_hz_s=per_hz * self.ramp_hz_s)


class LineTable(Table, frozen=True, kw_only=True, tag_field="driver"):
    """A line to one device, or to several of one kind. A subclass sets ``tag`` to the name of its driver."""

    addresses: ClassVar[frozenset[str]] = frozenset({"port", "interface", "channel"})
    """The keys that say where the device is; they alone may change when a run goes on."""

    motor: tuple[MotorTable, ...]

    @property
    def reverses(self) -> bool:
        """Whether the motors can turn both ways."""
        return True

    def check(self) -> None:
        """Raise ValueError, its text beginning with the key, where the table makes no sense as a whole."""

    def remove_curves(self) -> Self:
        """Return the line with commands in place of frequencies, each motor limited to its ``max_command``."""
        motors = tuple(motor.by_command(motor.max_command) for motor in self.motor)
        return msgspec.structs.replace(self, motor=motors)


class TrackerTable(Table, frozen=True, kw_only=True, tag_field="kind"):
    """A tracker. A subclass sets ``tag`` to the name of its kind."""

    addresses: ClassVar[frozenset[str]] = frozenset({"host", "port", "data_port", "multicast", "source"})
    """The keys that say where the poses come from; they alone may change when a run goes on."""

    def located(self, folder: Path) -> Self:
        """Return the table with paths, which count from the folder of the robot's file, as they are from here."""
        return self
