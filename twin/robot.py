"""A twin as a robot: motors whose commands expire, a tracker, and a clock that steps the physics."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Gait, MotorState, Pose, Quantity, Structure
from vvvaltr.twin.engine import Engine, Start
from vvvaltr.twin.scatter import Scatter
from vvvaltr.twin.world import sample_terrain


class TwinRobot:
    """``Robot`` on an engine. The scatter of each trial depends on (seed, trial, purpose) alone.

    Args:
        engine: the physics.
        range_hz: range of frequencies worth searching; its end is the highest that may be commanded.
        seed: seed of the scatter.
        scatter: what differs from trial to trial.
    """

    def __init__(self, engine: Engine, range_hz: tuple[float, float], seed: int, scatter: Scatter) -> None:
        self.range_hz = range_hz
        self.max_hz = (range_hz[1],) * len(engine.body.motors)
        self._seed = seed
        self._scatter = scatter
        self._driven = _DrivenEngine(engine)
        self.clock = TwinClock(self._driven)
        self.motors = TwinMotors(self._driven)
        self.tracker = TwinTracker(self._driven, scatter)

    @property
    def engine(self) -> Engine:
        """The physics."""
        return self._driven.engine

    @property
    def structure(self) -> Structure:
        """What a viewer needs to draw the robot, with its terrain."""
        return self.engine.body.structure(sample_terrain(self.engine.world))

    def place(self, trial: int) -> None:
        """Put the robot down again, with the scatter of this trial, a number >= 0. The clock continues."""
        self.put_down(self._scatter.draw_start(stream(self._seed, trial, "start")))
        self.carry_on(trial)

    def put_down(self, start: Start) -> None:
        """Put the robot down at a chosen place, at rest. The clock continues."""
        self.motors.stop()
        self._driven.engine.reset(start)

    def carry_on(self, trial: int) -> None:
        """Begin a trial where the robot is, with this trial's scatter of motors and tracker; the number is >= 0."""
        self.motors.stop()
        motors = stream(self._seed, trial, "motors")
        self._driven.begin(np.exp(motors.normal(0.0, self._scatter.frequency, len(self.max_hz))).tolist())
        self.tracker.random = stream(self._seed, trial, "tracker")

    def close(self) -> None:
        """Stop the motors. Idempotent."""
        self.motors.close()


class _DrivenEngine:
    """An engine, twin time, and the command in force."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.now_s = 0.0
        self.until_s = 0.0
        self._rest = Gait((0.0,) * len(engine.body.motors))
        self.begin([1.0] * len(engine.body.motors))

    def begin(self, factors: Sequence[float]) -> None:
        """Begin a trial in which each motor turns at its factor times the commanded frequency."""
        self._factors = factors
        self._commanded = self._actual = self._rest

    def command(self, gait: Gait, hold_s: float) -> None:
        self.until_s = self.now_s + hold_s
        if gait is not self._commanded:  # most commands of a trial repeat the one before
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
    """Twin time. Only ``sleep`` advances it, from trial to trial."""

    def __init__(self, driven: _DrivenEngine) -> None:
        self._driven = driven

    def now_s(self) -> float:
        """Return the seconds of twin time since the robot was made."""
        return self._driven.now_s

    def sleep(self, duration_s: float) -> None:
        """Let the robot move for ``duration_s``. Raises Diverged where the physics breaks down."""
        self._driven.advance(duration_s)


class TwinMotors:
    """``MotorDriver`` of a twin. A motor saturates at its limit; ``state`` shows the actual frequency."""

    quantities = frozenset(Quantity)

    def __init__(self, driven: _DrivenEngine) -> None:
        self._driven = driven

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        return len(self._driven.engine.body.motors)

    def drive(self, gait: Gait, hold_s: float) -> None:
        """Apply ``gait`` for ``hold_s`` of twin time. Raises ValueError for other motors or a bad hold."""
        if gait.motor_count != self.motor_count:
            raise ValueError(f"a gait for {gait.motor_count} motors, but the twin has {self.motor_count}")
        if not (math.isfinite(hold_s) and hold_s > 0.0):
            raise ValueError(f"hold_s is {hold_s:g}, which is not a time above 0")
        self._driven.command(gait, hold_s)

    def state(self) -> MotorState:
        """Return the actual frequencies in Hz, at this moment of twin time."""
        return MotorState(self._driven.now_s, self._driven.engine.applied_hz())

    def stop(self) -> None:
        """Switch the motors off; they run down with their lag. Idempotent."""
        self._driven.until_s = self._driven.now_s

    def close(self) -> None:
        """Stop the motors. Idempotent."""
        self.stop()


class TwinTracker:
    """``Tracker`` of a twin: it sees the centre of mass and the strut ends, with seeded noise on each coordinate."""

    def __init__(self, driven: _DrivenEngine, scatter: Scatter) -> None:
        self._driven = driven
        self._node_shares = driven.engine.body.node_shares
        nodes = len(self._node_shares)
        self._noise = np.repeat([scatter.position_m, scatter.angle_rad], [3 * (1 + nodes), 3])
        self.random = stream(0, 0, "tracker")

    def pose(self) -> Pose:
        """Return the robot's pose now, with the forces on it where the engine tells them."""
        engine = self._driven.engine
        nodes_m = engine.nodes_m()
        yaw_rad, *tilt_rad = engine.angles_rad()
        heading_rad = math.remainder(yaw_rad, math.tau)  # trackers do not count turns
        seen = np.concatenate([self._node_shares @ nodes_m, nodes_m.ravel(), [heading_rad, *tilt_rad]])
        numbers = (seen + self._noise * self.random.standard_normal(len(seen))).tolist()
        centre_m, *markers_m, angles_rad = zip(*(iter(numbers),) * 3, strict=True)
        return Pose(self._driven.now_s, centre_m, *angles_rad, tuple(markers_m), engine.forces())
