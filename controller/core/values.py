"""The nouns of the product: frozen values that every room passes to the others.

Units are in the names: ``_hz``, ``_s``, ``_m``, ``_rad``, ``_a``, ``_m_s``. The ground is the plane z = 0, z points up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Self

from vvvaltr.controller.core.conditions import Conditions, check_finite
from vvvaltr.controller.core.resting import RestingPose

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Vector = tuple[float, float, float]


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


@dataclass(frozen=True, slots=True)
class Command:
    """A request to the motors: what was asked, when, and for how long at most. Not what happened."""

    t_s: float
    gait: Gait
    hold_s: float


@dataclass(frozen=True, slots=True)
class MotorState:
    """What the device applies.

    Args:
        t_s: when, on the robot's clock; in a trial since the drive began.
        frequency_hz: (motors,) measured where the device has a sensor, else what its output stage is set to.
        measured: whether ``frequency_hz`` comes from a sensor.
        current_a: (motors,) or empty where the device does not tell.
        temperature_c: (motors,) or empty where the device does not tell.
    """

    t_s: float
    frequency_hz: tuple[float, ...]
    measured: bool = True
    current_a: tuple[float, ...] = ()
    temperature_c: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Forces:
    """What pulls and pushes at the robot at one moment. Only a twin can tell. Vectors along the world's axes.

    Args:
        tensions_n: of each spring in ``Structure.springs``; negative where it pushes.
        motors_n: of each motor on its strut.
        contacts_m: where the ground touches the robot.
        contacts_n: what the ground does there.
    """

    tensions_n: tuple[float, ...]
    motors_n: tuple[Vector, ...]
    contacts_m: tuple[Vector, ...]
    contacts_n: tuple[Vector, ...]


@dataclass(frozen=True, slots=True)
class Pose:
    """Where the robot's centre is and how it is turned (intrinsic z-y'-x'' angles: yaw, then pitch, then roll).

    Args:
        t_s: when, on the robot's clock; in a trial since the drive began.
        position_m: x, y, z of the centre of the robot.
        yaw_rad, pitch_rad, roll_rad: the angles; yaw is the heading on the ground.
        markers_m: positions of the strut ends where the tracker sees them, (2 * struts) of them, else empty.
        forces: where the tracker is a twin's that tells them.
        uncertainty_m: of the position, where the tracker tells it.
    """

    t_s: float
    position_m: Vector
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    markers_m: tuple[Vector, ...] = ()
    forces: Forces | None = None
    uncertainty_m: float | None = None

    @property
    def is_finite(self) -> bool:
        """Whether time, position and angles are finite numbers."""
        numbers = (self.t_s, *self.position_m, self.yaw_rad, self.pitch_rad, self.roll_rad)
        # A finite sum has finite terms; only where great ones overflow it, each is looked at.
        return math.isfinite(sum(numbers)) or all(map(math.isfinite, numbers))


class Outcome(StrEnum):
    """How a trial ended. A trial has exactly one."""

    COMPLETED = "completed"  # drove for as long as asked
    CUT_SHORT = "cut_short"  # a guard ended it (heading, arena); measured over the time it ran
    TRACKING_LOST = "tracking_lost"  # no trustworthy pose
    LINK_LOST = "link_lost"  # the motors' device went away
    FAULTED = "faulted"  # a motor or the twin failed
    CRASHED = "crashed"  # the program failed
    INTERRUPTED = "interrupted"  # the operator stopped it

    @property
    def is_valid(self) -> bool:
        """Whether the trial measured something: only then may it be scored."""
        return self in (Outcome.COMPLETED, Outcome.CUT_SHORT)


@dataclass(frozen=True, slots=True)
class Photo:
    """A picture of a tracker's camera.

    Args:
        t_s: when it was taken, on the robot's clock; in a trial since the drive began.
        jpeg: the picture as a JPEG file.
    """

    t_s: float
    jpeg: bytes


@dataclass(frozen=True, slots=True)
class Trial:
    """One gait, driven once. Times within are in seconds since the drive began.

    Args:
        number: counted from 1 within a run.
        gait: the gait that was asked for.
        outcome: how it ended.
        reason: why, in a sentence; empty for a completed trial.
        started_unix_s: wall time at which the trial began.
        duration_s: how long the motors were driven.
        poses: from the start of the drive to its end, both included.
        commands: every request that was sent.
        states: what the device applied.
        conditions: battery, session, tracker: what else was read.
        start: where the robot lay before the drive; None where only the first pose tells.
        end: where it lay once the motors had run down; None where only the last pose tells.
        photos: what the tracker's camera saw, where it keeps pictures.

    Raises:
        ValueError: a time is not finite.
    """

    number: int
    gait: Gait
    outcome: Outcome
    reason: str
    started_unix_s: float
    duration_s: float
    poses: tuple[Pose, ...] = ()
    commands: tuple[Command, ...] = ()
    states: tuple[MotorState, ...] = ()
    conditions: Conditions = field(default_factory=Conditions)
    start: RestingPose | None = None
    end: RestingPose | None = None
    photos: tuple[Photo, ...] = ()

    def __post_init__(self) -> None:
        check_finite(started_unix_s=self.started_unix_s, duration_s=self.duration_s)


@dataclass(frozen=True, slots=True)
class Estimate:
    """A posterior mean with its central 95 % interval, in the unit of the score."""

    mean: float
    low: float
    high: float


class Phase(StrEnum):
    """What a trial is for."""

    SEARCH = "search"  # to find a better gait
    CONFIRMATION = "confirmation"  # to repeat a promising gait
    ASKED = "asked"  # to measure a gait that a person chose
    REFERENCE = "reference"  # to see whether the robot has changed
    STEERING = "steering"  # to come closer to a goal


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A gait to try next, and why.

    Args:
        gait: the gait.
        origin: what proposed it, in two or three words ("initial design", "expected improvement").
        expected: what the model expects of its true score; None while there is no model.
        hyperparameters: the model's, by name; empty while there is no model.
        phase: what the trial is for.
    """

    gait: Gait
    origin: str
    expected: Estimate | None = None
    hyperparameters: Mapping[str, float] = field(default_factory=dict)
    phase: Phase = Phase.SEARCH


@dataclass(frozen=True, slots=True)
class Recommendation:
    """The gait that the model believes is best, and what it believes of its true score."""

    gait: Gait
    estimate: Estimate


@dataclass(frozen=True, slots=True)
class Source:
    """Valid trials of an earlier condition, to learn from: gaits and their scores, in the order they were run.

    Raises:
        ValueError: there is none, the numbers of both differ, or a score is not finite.
    """

    name: str
    gaits: tuple[Gait, ...]
    scores: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.gaits) != len(self.scores):
            raise ValueError(f"source {self.name}: {len(self.gaits)} gaits but {len(self.scores)} scores")
        if not self.gaits:
            raise ValueError(f"source {self.name} has no valid trial to learn from")
        for number, score in enumerate(self.scores, start=1):
            if not math.isfinite(score):
                raise ValueError(f"source {self.name}, trial {number}: the score is {score}, which is not finite")


@dataclass(frozen=True, slots=True)
class Terrain:
    """Ground as a grid of heights: ``height_m[i][j]`` at ``x_m[i]``, ``y_m[j]``."""

    x_m: tuple[float, ...]
    y_m: tuple[float, ...]
    height_m: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class Structure:
    """What a viewer needs to draw the robot; indices are into ``Pose.markers_m``.

    Args:
        struts: pairs of strut ends joined by a strut.
        springs: pairs of strut ends joined by a spring.
        motor_struts: for each motor the index of its strut.
        terrain: the ground, where it is known.
    """

    struts: tuple[tuple[int, int], ...]
    springs: tuple[tuple[int, int], ...]
    motor_struts: tuple[int, ...]
    terrain: Terrain | None = None
