"""The calibration curve of a motor: the frequency at each command."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise


@dataclass(frozen=True, slots=True)
class Curve:
    """Command to frequency, linear between the measured points, and the same in both senses of rotation.

    Below the first point is the dead band, in which the motor does not rotate: such a frequency is off. Above the last
    point nothing is known, so nothing is allowed.

    Args:
        points: (command, frequency in Hz) of at least two measurements, both rising, all above 0.

    Raises:
        ValueError: the points are too few, not finite, or do not rise.
    """

    points: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        if len(self.points) < 2:
            raise ValueError(f"a calibration curve needs two points or more, not {len(self.points)}")
        for before, after in pairwise(((0.0, 0.0), *self.points)):
            if not all(low < high < math.inf for low, high in zip(before, after, strict=True)):
                raise ValueError(f"the points of a calibration curve must rise, but {after} follows {before}")

    @property
    def lowest_hz(self) -> float:
        """The upper end of the dead band."""
        return self.points[0][1]

    @property
    def highest_hz(self) -> float:
        """The greatest frequency that was measured."""
        return self.points[-1][1]

    def command(self, frequency_hz: float) -> float:
        """Return the command for a frequency; 0 in the dead band. Raises ValueError for one above the last point."""
        if abs(frequency_hz) > self.highest_hz + 1e-9:
            raise ValueError(f"{frequency_hz:g} Hz is beyond the calibrated {self.highest_hz:g} Hz")
        return _interpolate([(hz, command) for command, hz in self.points], frequency_hz)

    def frequency_hz(self, command: float) -> float:
        """Return the frequency at a command; 0 within the dead band, the last point's beyond it."""
        return _interpolate(self.points, command)


@dataclass(frozen=True, slots=True)
class Uncorrected:
    """Stands in for a curve, for a device whose commands are frequencies."""

    def command(self, frequency_hz: float) -> float:
        """Return ``frequency_hz``."""
        return frequency_hz

    def frequency_hz(self, command: float) -> float:
        """Return ``command``."""
        return command


UNCORRECTED = Uncorrected()


def to_commands(curves: Sequence[Curve | Uncorrected], frequency_hz: Sequence[float], name: str) -> tuple[float, ...]:
    """Return the command of each motor of the line called ``name``.

    Raises:
        ValueError: a frequency is beyond the motor's curve.
    """
    commands = []
    for number, (curve, hz) in enumerate(zip(curves, frequency_hz, strict=True), start=1):
        try:
            commands.append(curve.command(hz))
        except ValueError as error:
            raise ValueError(f"{name}, motor {number} of the line: {error}") from None
    return tuple(commands)


def _interpolate(points: Sequence[tuple[float, float]], signed: float) -> float:
    """Return the value at ``abs(signed)`` with the sign of ``signed``; 0 before the first point."""
    place = min(abs(signed), points[-1][0])
    # Rounding must not push the first point itself into the dead band.
    if place < points[0][0] * (1.0 - 1e-9):
        return 0.0
    after = max(1, bisect_left(points, (place,)))
    (low, low_value), (high, high_value) = points[after - 1 : after + 1]
    return math.copysign(low_value + (place - low) / (high - low) * (high_value - low_value), signed)
