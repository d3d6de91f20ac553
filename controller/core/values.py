"""The nouns of the product: frozen values that every room passes to the others.

Units are in the names: ``_hz``, ``_s``, ``_m``, ``_rad``, ``_a``, ``_m_s``. The ground is the plane z = 0, z points up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from vvvaltr.controller.core.conditions import Conditions, check_finite
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.resting import RestingPose

Vector = tuple[float, float, float]


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

    @property
    def words(self) -> str:
        """The outcome as a person reads it."""
        return self.replace("_", " ")


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

    @property
    def ending(self) -> str:
        """How it ended, and why, as a person reads it."""
        return f"{self.outcome.words}: {self.reason}"


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
