"""Gaits, and the space of gaits that a search may try."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Gait:
    """What the motors are asked to do: one entry per motor in each tuple.

    Args:
        frequency_hz: revolutions per second; the sign is the sense of rotation, 0 is off.
        phase_rad: angle of the motor's force at time 0; empty means all zero.
        amplitude: share of the motor's force, 0 to 1; empty means all one.

    Raises:
        ValueError: a value is not finite, an amplitude is outside 0 to 1, or the lengths differ.
    """

    frequency_hz: tuple[float, ...]
    phase_rad: tuple[float, ...] = ()
    amplitude: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        motors = len(self.frequency_hz)
        # Frozen, so the normal forms (floats, defaults written out) are set behind the dataclass's back.
        object.__setattr__(self, "frequency_hz", tuple(map(float, self.frequency_hz)))
        object.__setattr__(self, "phase_rad", tuple(map(float, self.phase_rad)) or (0.0,) * motors)
        object.__setattr__(self, "amplitude", tuple(map(float, self.amplitude)) or (1.0,) * motors)
        for name, values in (
            ("frequency_hz", self.frequency_hz),
            ("phase_rad", self.phase_rad),
            ("amplitude", self.amplitude),
        ):
            if len(values) != motors:
                raise ValueError(f"{name} has {len(values)} values for {motors} motors")
            if not all(map(math.isfinite, values)):
                raise ValueError(f"{name} {values} is not finite")
        if not all(0.0 <= share <= 1.0 for share in self.amplitude):
            raise ValueError(f"amplitude {self.amplitude} is outside 0 to 1")

    @property
    def motor_count(self) -> int:
        """How many motors the gait is for."""
        return len(self.frequency_hz)

    def scaled(self, share: float) -> Gait:
        """Return the gait with every frequency multiplied by ``share``: a step of a ramp."""
        if share == 1.0:
            return self
        return replace(self, frequency_hz=tuple(share * frequency for frequency in self.frequency_hz))

    def __str__(self) -> str:
        text = " ".join(f"{frequency:.2f}" for frequency in self.frequency_hz) + " Hz"
        if any(self.phase_rad):
            text += ", phase " + " ".join(f"{phase:.2f}" for phase in self.phase_rad) + " rad"
        if any(share != 1.0 for share in self.amplitude):
            text += ", amplitude " + " ".join(f"{share:.2f}" for share in self.amplitude)
        return text


class Quantity(StrEnum):
    """What of a motor a gait can vary."""

    FREQUENCY = "frequency"
    PHASE = "phase"
    AMPLITUDE = "amplitude"

    @property
    def field(self) -> str:
        """The field of ``Gait`` that holds this quantity."""
        return {"frequency": "frequency_hz", "phase": "phase_rad", "amplitude": "amplitude"}[self.value]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One searched number of a gait: a quantity of one motor (counted from 0) and its bounds in its own unit."""

    quantity: Quantity
    motor: int
    low: float
    high: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ValueError(f"{self.name}: the range {self.low:g} to {self.high:g} is empty or not finite")

    @property
    def name(self) -> str:
        """Name with unit, motors counted from 1 as on the robot: ``frequency_1_hz``."""
        quantity, _, unit = self.quantity.field.partition("_")
        return f"{quantity}_{self.motor + 1}" + (f"_{unit}" if unit else "")


@dataclass(frozen=True, slots=True)
class GaitSpace:
    """The gaits that a search may try, and the only place that knows the unit cube.

    Args:
        rest: the gait that gives every number that is not searched.
        parameters: the searched numbers, in the order of the unit cube's axes.
    """

    rest: Gait
    parameters: tuple[Parameter, ...]

    @classmethod
    def over(
        cls,
        motor_count: int,
        low_hz: float,
        high_hz: float,
        quantities: Sequence[Quantity] = (Quantity.FREQUENCY,),
    ) -> Self:
        """Return the space of all ``quantities`` of all motors; phases span -pi to pi, amplitudes 0 to 1."""
        bounds = {
            Quantity.FREQUENCY: (low_hz, high_hz),
            Quantity.PHASE: (-math.pi, math.pi),
            Quantity.AMPLITUDE: (0.0, 1.0),
        }
        parameters = (
            Parameter(quantity, motor, *bounds[quantity]) for quantity in quantities for motor in range(motor_count)
        )
        return cls(Gait((0.0,) * motor_count), tuple(parameters))

    @property
    def dimension(self) -> int:
        """Number of searched parameters."""
        return len(self.parameters)

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return self.rest.motor_count

    def to_unit(self, gait: Gait) -> NDArray[np.float64]:
        """Return the gait's place in the unit cube, shape (dimension,); outside of it if the gait is out of bounds."""
        place: NDArray[np.float64] = self.to_units((gait,))[0]
        return place

    def to_units(self, gaits: Sequence[Gait]) -> NDArray[np.float64]:
        """Return the gaits' places in the unit cube, shape (gaits, dimension)."""
        import numpy as np  # here, so that the command line's help need not wait for it

        fields = {p.quantity: p.quantity.field for p in self.parameters}
        of_motors = {it: np.array([getattr(gait, field) for gait in gaits]) for it, field in fields.items()}
        places = np.empty((len(gaits), self.dimension))
        for at, p in enumerate(self.parameters if gaits else ()):
            places[:, at] = (of_motors[p.quantity][:, p.motor] - p.low) / (p.high - p.low)
        return places

    def from_unit(self, unit: NDArray[np.float64]) -> Gait:
        """Return the gait at a place of the unit cube, shape (dimension,).

        Raises:
            ValueError: the place has another shape, or lies outside the cube by more than rounding.
        """
        places = unit.tolist()
        if unit.shape != (self.dimension,) or not all(-1e-9 <= place <= 1.0 + 1e-9 for place in places):
            raise ValueError(f"{unit} is not a place in the unit cube of {self.dimension} parameters")
        numbers = {quantity: list(getattr(self.rest, quantity.field)) for quantity in Quantity}
        for p, place in zip(self.parameters, places, strict=True):
            numbers[p.quantity][p.motor] = min(max(p.low + place * (p.high - p.low), p.low), p.high)
        return Gait(*(tuple(numbers[quantity]) for quantity in Quantity))


def make_lively_gait(high_hz: Sequence[float]) -> Gait:
    """Return a gait that drives the motors at frequencies from ``high_hz`` (motors,) down to half of it.

    No two motors that could turn alike do: of equal ones, chance decides what the robot does.
    """
    apart = min(0.1, 0.5 / max(1, len(high_hz) - 1))
    return Gait(tuple(hz * (1.0 - apart * motor) for motor, hz in enumerate(high_hz)))
