"""A twin as a robot: motors whose commands expire, a tracker, and a clock that steps the physics."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from vvvaltr.controller.core.spelling import unknown
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Gait, MotorState, Pose, Quantity, Structure
from vvvaltr.twin.body import ForceLaw, Parts, body_named, damaged
from vvvaltr.twin.engine import Engine, Start
from vvvaltr.twin.planar.engine import LAWS, PLANAR_PARTS, PlanarEngine
from vvvaltr.twin.world import PLAIN, World, terrain_grid


@dataclass(frozen=True, slots=True)
class Scatter:
    """What differs from trial to trial: standard deviations of normal distributions around nothing.

    Args:
        place_m: of the start's x and y.
        heading_rad: of the start's yaw; the planar twin has none.
        tilt_rad: of the start's pitch.
        frequency: of the logarithm of each motor's actual over its commanded frequency, fixed within a trial (battery,
            load); the actual frequency stays within the motor's limit all the same.
        position_m: of the tracker, for each coordinate of each reading.
        angle_rad: of the tracker, for each angle of each reading.
    """

    place_m: float = 0.005
    heading_rad: float = 0.05
    tilt_rad: float = 0.02
    frequency: float = 0.10
    position_m: float = 0.0002
    angle_rad: float = 0.002

    @classmethod
    def none(cls) -> Self:
        """Return no scatter: every trial of a gait is the same."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def start(self, random: np.random.Generator) -> Start:
        """Return how the robot is put down."""
        return Start(*(random.normal(0.0, [self.place_m, self.place_m, self.heading_rad, self.tilt_rad]).tolist()))


SPATIAL_SCATTER = Scatter(frequency=0.05)


class TwinRobot:
    """``Robot`` on an engine. Each trial draws its scatter from (seed, trial, purpose) alone.

    Args:
        engine: the physics.
        range_hz: the frequencies worth searching; the upper one is the most that may be asked of a motor.
        seed: of all scatter.
        scatter: what differs from trial to trial.
    """

    def __init__(self, engine: Engine, range_hz: tuple[float, float], seed: int, scatter: Scatter) -> None:
        self.range_hz = range_hz
        self.max_hz = (range_hz[1],) * len(engine.body.motors)
        self._seed = seed
        self._scatter = scatter
        self._motion = _Motion(engine)
        self.clock = TwinClock(self._motion)
        self.motors = TwinMotors(self._motion)
        self.tracker = TwinTracker(self._motion, scatter)

    @property
    def engine(self) -> Engine:
        """The physics."""
        return self._motion.engine

    @property
    def structure(self) -> Structure:
        """How to draw the robot, with its terrain."""
        return self.engine.body.structure(terrain_grid(self.engine.world))

    def place(self, trial: int) -> None:
        """Put the robot down afresh, with the scatter of this trial (>= 0). The clock goes on."""
        self.motors.stop()
        self._motion.engine.reset(self._scatter.start(stream(self._seed, trial, "start")))
        motors = stream(self._seed, trial, "motors")
        self._motion.begin(np.exp(motors.normal(0.0, self._scatter.frequency, len(self.max_hz))).tolist())
        self.tracker.random = stream(self._seed, trial, "tracker")

    def close(self) -> None:
        """Stop the motors. Idempotent."""
        self.motors.close()


class _Motion:
    """Twin time, and the command that is in force."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.now_s = 0.0
        self.until_s = 0.0
        self._rest = Gait((0.0,) * len(engine.body.motors))
        self.begin([1.0] * len(engine.body.motors))

    def begin(self, factors: Sequence[float]) -> None:
        """Begin a trial, in which the motors turn so many times as fast as they are told to."""
        self._factors = factors
        self._commanded = self._actual = self._rest

    def command(self, gait: Gait, hold_s: float) -> None:
        self.until_s = self.now_s + hold_s
        if gait is not self._commanded:  # most commands of a trial are the one before
            frequency_hz = tuple(map(operator.mul, gait.frequency_hz, self._factors))
            self._commanded, self._actual = gait, replace(gait, frequency_hz=frequency_hz)

    def advance(self, duration_s: float) -> None:
        driven_s = min(duration_s, max(0.0, self.until_s - self.now_s))
        self.now_s += duration_s
        if driven_s > 0.0:
            self.engine.step(self._actual, driven_s)
        if driven_s < duration_s:
            self.engine.step(self._actual.scaled(0.0), duration_s - driven_s)


class TwinClock:
    """Twin time: it grows with ``sleep`` alone, over all trials."""

    def __init__(self, motion: _Motion) -> None:
        self._motion = motion

    def now_s(self) -> float:
        """Seconds of twin time since the robot was made."""
        return self._motion.now_s

    def sleep(self, duration_s: float) -> None:
        """Let the robot move for ``duration_s``. Raises Diverged when the physics breaks down."""
        self._motion.advance(duration_s)


class TwinMotors:
    """``MotorDriver`` of a twin. What is beyond a motor's limit is asked for in vain, as ``state`` shows."""

    quantities = frozenset(Quantity)

    def __init__(self, motion: _Motion) -> None:
        self._motion = motion

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return len(self._motion.engine.body.motors)

    def drive(self, gait: Gait, hold_s: float) -> None:
        """Apply ``gait`` for ``hold_s`` of twin time. Raises ValueError for another number of motors or a bad hold."""
        if gait.motor_count != self.motor_count:
            raise ValueError(f"a gait for {gait.motor_count} motors, but the twin has {self.motor_count}")
        if not (math.isfinite(hold_s) and hold_s > 0.0):
            raise ValueError(f"hold_s is {hold_s:g}, which is not a time above 0")
        self._motion.command(gait, hold_s)

    def state(self) -> MotorState:
        """Return the actual frequencies."""
        return MotorState(self._motion.now_s, self._motion.engine.applied_hz())

    def stop(self) -> None:
        """Let the motors run down from now on. Idempotent."""
        self._motion.until_s = self._motion.now_s

    def close(self) -> None:
        """Stop. Idempotent."""
        self.stop()


class TwinTracker:
    """``Tracker`` of a twin: it sees the centre of mass and the strut ends, with seeded noise on each number."""

    def __init__(self, motion: _Motion, scatter: Scatter) -> None:
        self._motion = motion
        self._node_shares = motion.engine.body.node_shares
        nodes = len(self._node_shares)
        self._noise = np.repeat([scatter.position_m, scatter.angle_rad], [3 * (1 + nodes), 3])
        self.random = stream(0, 0, "tracker")

    def pose(self) -> Pose:
        """Return where the robot is now."""
        engine = self._motion.engine
        nodes_m = engine.nodes_m()
        seen = np.concatenate([self._node_shares @ nodes_m, nodes_m.ravel(), engine.angles_rad()])
        numbers = (seen + self._noise * self.random.standard_normal(len(seen))).tolist()
        centre_m, *markers_m, angles_rad = zip(*(iter(numbers),) * 3, strict=True)
        return Pose(self._motion.now_s, centre_m, *angles_rad, tuple(markers_m), engine.forces())


def planar_robot(
    body: str = "prism3",
    world: World = PLAIN,
    damage: Sequence[str] = (),
    law: str = "eccentric",
    seed: int = 0,
    scatter: Scatter = Scatter(),
    time_step_s: float = 0.0,
) -> TwinRobot:
    """Return a robot on the planar twin.

    Args:
        body: prism3 or icosahedron6.
        world: where it is.
        damage: as ``body.damaged`` takes it.
        law: of the motors' force, eccentric or constant; each has its own range of frequencies.
        seed: of all scatter.
        scatter: what differs from trial to trial.
        time_step_s: of the physics; 0 for ``planar.default_time_step_s``.

    Raises:
        ValueError: an unknown body or law, or impossible damage; one line.
        Diverged: the body cannot even be put down.
    """
    parts, range_hz = _with_law(PLANAR_PARTS, LAWS, law)
    engine = PlanarEngine(damaged(body_named(body, parts), damage), world, time_step_s)
    return TwinRobot(engine, range_hz, seed, scatter)


def spatial_robot(
    body: str = "icosahedron6",
    world: World = PLAIN,
    damage: Sequence[str] = (),
    law: str = "eccentric",
    seed: int = 0,
    scatter: Scatter = SPATIAL_SCATTER,
    time_step_s: float = 0.0,
) -> TwinRobot:
    """Return a robot on the spatial twin; see ``planar_robot``. Raises ValueError also where MuJoCo is missing."""
    from vvvaltr.twin.spatial import engine as spatial

    parts, range_hz = _with_law(spatial.SPATIAL_PARTS, spatial.LAWS, law)
    engine = spatial.SpatialEngine(damaged(body_named(body, parts), damage), world, time_step_s)
    return TwinRobot(engine, range_hz, seed, scatter)


def _with_law(
    parts: Parts, laws: Mapping[str, tuple[ForceLaw, tuple[float, float]]], law: str
) -> tuple[Parts, tuple[float, float]]:
    if law not in laws:
        raise ValueError(unknown("force law", law, laws))
    force, range_hz = laws[law]
    return replace(parts, law=force, max_hz=range_hz[1]), range_hz
