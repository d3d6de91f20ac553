"""A twin as a robot: motors whose commands expire, a tracker, and a clock that steps the physics."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vvvaltr.controller.core.errors import DeviceFault
from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import MotorState, Pose, Structure
from vvvaltr.twin.engine import Engine, Start
from vvvaltr.twin.scatter import USUAL_NOISE, Scatter, TrackerNoise
from vvvaltr.twin.world import sample_terrain


class TwinRobot:
    """``Robot`` on an engine. What is drawn for a trial depends on (seed, trial, purpose) alone.

    A robot that is left where it stopped depends on the trials before, too.

    Args:
        engine: the physics.
        range_hz: range of frequencies worth searching; its end is the highest that may be commanded.
        seed: seed of the scatter.
        scatter: what differs from trial to trial.
        noise: noise of the tracker.
    """

    def __init__(
        self,
        engine: Engine,
        range_hz: tuple[float, float],
        seed: int,
        scatter: Scatter,
        noise: TrackerNoise = USUAL_NOISE,
    ) -> None:
        self.range_hz = range_hz
        self.max_hz = (range_hz[1],) * len(engine.body.motors)
        self._seed = seed
        self._scatter = scatter
        if scatter.incline_rad:
            engine.incline(scatter.incline_rad, scatter.draw_azimuth_rad(seed))
        self._driven = _DrivenEngine(engine)
        self._lies = False  # whether the robot has been put down and is where the last trial left it
        self.clock = TwinClock(self._driven)
        self.motors = TwinMotors(self._driven, scatter.telling)
        self.tracker = TwinTracker(self._driven, noise)

    @property
    def engine(self) -> Engine:
        """The physics."""
        return self._driven.engine

    @property
    def structure(self) -> Structure:
        """What a viewer needs to draw the robot, with its terrain."""
        return self.engine.body.structure(sample_terrain(self.engine.world))

    def place(self, trial: int) -> None:
        """Begin a trial, a number >= 0, with its scatter: put the robot down, or leave it where it is. Time goes on."""
        if not (self._scatter.left and self._lies and self._is_inside()):
            self.put_down(self._scatter.draw_start(stream(self._seed, trial, "start")))
        self.carry_on(trial)

    def put_down(self, start: Start) -> None:
        """Put the robot down at a chosen place, at rest. The clock continues."""
        self.motors.stop()
        self._driven.reset(start)
        self._lies = True

    def carry_on(self, trial: int) -> None:
        """Begin a trial where the robot is, with this trial's scatter of motors and tracker; the number is >= 0."""
        self.motors.stop()
        scatter, motors = self._scatter, len(self.max_hz)
        errors = stream(self._seed, trial, "motors").normal(0.0, scatter.frequency, motors)
        failure = scatter.draw_failure(stream(self._seed, trial, "failure"), motors)
        self._driven.begin(np.exp(errors).tolist(), scatter.strength(self._seed, trial), failure)
        self.tracker.random = stream(self._seed, trial, "tracker")

    def close(self) -> None:
        """Stop the motors. Idempotent."""
        self.motors.close()

    def _is_inside(self) -> bool:
        """Return whether the robot can be left where it is: inside the border, on an engine that has not broken."""
        if self._driven.is_broken:
            return False
        x_m, y_m, _ = self.engine.body.node_shares @ self.engine.nodes_m()
        return bool(max(abs(x_m), abs(y_m)) <= self._scatter.border_m)


class _DrivenEngine:
    """An engine, twin time, and the command in force."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.now_s = 0.0
        self.until_s = 0.0
        self.is_broken = False
        self._rest = Gait((0.0,) * len(engine.body.motors))
        self.begin([1.0] * len(engine.body.motors))

    @property
    def commanded(self) -> Gait:
        """What the device's output stages are set to."""
        return self._commanded if self.now_s < self.until_s else self._rest

    def begin(self, factors: Sequence[float], strength: float = 1.0, failure: tuple[int, float] | None = None) -> None:
        """Begin a trial.

        Args:
            factors: of each motor's commanded frequency, at which it turns.
            strength: of its force.
            failure: the motor that fails, as an index, and when, in s since the first command; None for none.
        """
        self._factors, self._strength, self._failure = factors, strength, failure
        self._began_s: float | None = None
        self._commanded = self._actual = self._rest

    def reset(self, start: Start) -> None:
        self.engine.reset(start)
        self.is_broken = False

    def command(self, gait: Gait, hold_s: float) -> None:
        self.until_s = self.now_s + hold_s
        if self._began_s is None:
            self._began_s = self.now_s
        fails = self._failure is not None and self.now_s - self._began_s >= self._failure[1] - 1e-9
        if fails and self._failure is not None:
            self._factors = [0.0 if motor == self._failure[0] else it for motor, it in enumerate(self._factors)]
            self._failure = None
        if gait is not self._commanded or fails:  # most commands of a trial repeat the one before
            self._commanded, self._actual = gait, self._actually(gait)

    def _actually(self, gait: Gait) -> Gait:
        """Return what the motors make of a gait."""
        frequency_hz = tuple(map(operator.mul, gait.frequency_hz, self._factors))
        if self._strength == 1.0:
            return replace(gait, frequency_hz=frequency_hz)
        amplitude = tuple(self._strength * share for share in gait.amplitude)
        return replace(gait, frequency_hz=frequency_hz, amplitude=amplitude)

    def advance(self, duration_s: float) -> None:
        driven_s = min(duration_s, max(0.0, self.until_s - self.now_s))
        self.now_s += duration_s
        try:
            if driven_s > 0.0:
                self.engine.step(self._actual, driven_s)
            if driven_s < duration_s:
                self.engine.step(self._actual.scaled(0.0), duration_s - driven_s)
        except DeviceFault:
            self.is_broken = True
            raise


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
    """``MotorDriver`` of a twin. A motor saturates at its limit.

    ``state`` shows the actual frequency, or what was commanded where the device cannot measure.
    """

    quantities = frozenset(Quantity)

    def __init__(self, driven: _DrivenEngine, measures: bool = True) -> None:
        self._driven = driven
        self._measures = measures

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
        """Return the frequencies in Hz at this moment of twin time: measured, or as the output stages are set."""
        if not self._measures:
            return MotorState(self._driven.now_s, self._driven.commanded.frequency_hz, measured=False)
        return MotorState(self._driven.now_s, self._driven.engine.applied_hz())

    def stop(self) -> None:
        """Switch the motors off; they run down with their lag. Idempotent."""
        self._driven.until_s = self._driven.now_s

    def close(self) -> None:
        """Stop the motors. Idempotent."""
        self.stop()


class TwinTracker:
    """``Tracker`` of a twin: it sees the centre of mass and the strut ends, with seeded noise on each coordinate."""

    def __init__(self, driven: _DrivenEngine, noise: TrackerNoise) -> None:
        self._driven = driven
        self._node_shares = driven.engine.body.node_shares
        nodes = len(self._node_shares)
        self._noise = np.repeat([noise.position_m, noise.angle_rad], [3 * (1 + nodes), 3])
        self.is_exact = noise.position_m == 0.0
        self.random = stream(0, 0, "tracker")

    def pose(self) -> Pose:
        """Return the robot's pose now, with the forces on it where the engine tells them."""
        engine = self._driven.engine
        nodes_m = engine.nodes_m()
        seen = np.concatenate([self._node_shares @ nodes_m, nodes_m.ravel(), engine.angles_rad()])
        numbers = (seen + self._noise * self.random.standard_normal(len(seen))).tolist()
        centre_m, *markers_m, angles_rad = zip(*(iter(numbers),) * 3, strict=True)
        yaw_rad, pitch_rad, roll_rad = (math.remainder(it, math.tau) for it in angles_rad)  # trackers count no turns
        return Pose(self._driven.now_s, centre_m, yaw_rad, pitch_rad, roll_rad, tuple(markers_m), engine.forces())
