"""The planar twin: a robot in the vertical plane x-z, on pymunk. Light enough for the robot's own computer.

A body is laid into the plane as it is seen along its axis of symmetry, see ``plane.flatten``. The forces of its
motors rotate in that plane, in the frame of their strut.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.twin.body import Body
from vvvaltr.twin.engine import LEVEL, Start
from vvvaltr.twin.planar.plane import Plane, Posture, flatten
from vvvaltr.twin.planar.stepper import STEPS_AT_ONCE
from vvvaltr.twin.rotors import Rotors
from vvvaltr.twin.world import World

FORMING_S, SETTLING_S = 1.0, 2.0
"""Simulated time in which a body finds its form without gravity, and then comes to rest on the ground."""


def choose_time_step_s(body: Body) -> float:
    """Return the time step in seconds: 2 ms for three struts, 1 ms for more. Gaits rank as they do at finer steps."""
    return 0.002 if len(body.struts) <= 3 else 0.001


class PlanarEngine:
    """``Engine`` in the vertical plane y = 0. Yaw and roll are 0; the rotation in the plane is the pitch.

    Args:
        body: body that moves.
        world: world that it moves in.
        time_step_s: time step of the integration; 0 for ``choose_time_step_s``.

    Raises:
        Diverged: the body cannot even be put down.
    """

    def __init__(self, body: Body, world: World, time_step_s: float = 0.0) -> None:
        self.body = body
        self.world = world
        self.time_step_s = time_step_s or choose_time_step_s(body)
        self._settled = _settle(body, world.gravity_m_s2, world.friction, self.time_step_s)
        self._settled_rad = float(self._settled.angles_rad.mean())
        self._incline_rad = 0.0
        self.reset()

    def reset(self, start: Start = LEVEL) -> None:
        """See ``Engine``. The space is made anew: the contacts that the old one remembers would change the motion."""
        posture = _put_down(self._settled, flatten(self.body).lengths_m, start, self.world)
        self._plane = Plane(self.body, self.world, posture, self.time_step_s, self._incline_rad)
        self._rotors = Rotors(self.body.motors, self.time_step_s)
        self._due_s = 0.0
        self._steps = 0

    @property
    def time_s(self) -> float:
        """See ``Engine``."""
        return self._steps * self.time_step_s

    def incline(self, angle_rad: float, azimuth_rad: float) -> None:
        """See ``Engine``. The robot is put down anew."""
        self._incline_rad = math.copysign(angle_rad, math.cos(azimuth_rad))
        self.reset()

    def step(self, gait: Gait, duration_s: float) -> None:
        """See ``Engine``."""
        if gait.motor_count != len(self.body.motors):
            raise ValueError(f"a gait for {gait.motor_count} motors, but {self.body.name} has {len(self.body.motors)}")
        self._due_s += duration_s
        steps = round(self._due_s / self.time_step_s) - self._steps
        for _ in range(steps // STEPS_AT_ONCE):
            self._run(gait, STEPS_AT_ONCE)
        if steps % STEPS_AT_ONCE:
            self._run(gait, steps % STEPS_AT_ONCE)

    def _run(self, gait: Gait, steps: int) -> None:
        _, forces_n = self._rotors.spin(gait, steps)
        self._plane.run(forces_n)
        self._steps += steps

    def nodes_m(self) -> Array:
        """See ``Engine``."""
        nodes = np.zeros((len(self.body.nodes_m), 3))
        nodes[:, 0::2] = self._plane.nodes_m()
        return nodes

    def angles_rad(self) -> tuple[float, float, float]:
        """See ``Engine``. A positive pitch takes z towards x."""
        return 0.0, self._settled_rad - self._plane.mean_angle_rad(), 0.0

    def applied_hz(self) -> tuple[float, ...]:
        """See ``Engine``."""
        return tuple(self._rotors.applied_hz.tolist())

    def forces(self) -> None:
        """See ``Engine``. None: asking pymunk for each contact takes as long as the steps to the next pose."""


@lru_cache(maxsize=64)
def _settle(body: Body, gravity_m_s2: float, friction: float, time_step_s: float) -> Posture:
    """Return the posture in which the body stands on level ground, formed without gravity first."""
    layout = flatten(body)
    floating = Plane(body, World(gravity_m_s2=0.0), layout.posture.move(0.0, 0.0, 1.0), time_step_s)
    formed = _leave_alone(floating, round(FORMING_S / time_step_s))
    lowest_m = formed.nodes_m(layout.lengths_m)[:, 1].min()
    lowered = formed.move(0.0, 0.0, body.struts[0].radius_m - lowest_m)
    standing = Plane(body, World(gravity_m_s2, friction), lowered, time_step_s)
    return _leave_alone(standing, round(SETTLING_S / time_step_s))


def _leave_alone(plane: Plane, steps: int) -> Posture:
    for _ in range(steps // STEPS_AT_ONCE):
        plane.run(np.zeros((STEPS_AT_ONCE, 1), complex))
    return plane.posture()


def _put_down(settled: Posture, lengths_m: Array, start: Start, world: World) -> Posture:
    """Return the settled posture at ``start``, with its lowest node as far from the ground as on level ground."""
    placed = settled.move(-start.pitch_rad, start.x_m - float(settled.middles_m[:, 0].mean()), 0.0)
    nodes = placed.nodes_m(lengths_m)
    gap_m = np.min(nodes[:, 1] - world.height_m(nodes[:, 0], np.zeros(1)))
    return placed.move(0.0, 0.0, float(settled.nodes_m(lengths_m)[:, 1].min() - gap_m))
