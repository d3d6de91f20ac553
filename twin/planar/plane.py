"""A body laid into a vertical plane, and the pymunk space that holds it there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.twin.body import Body, Shape, Spring
from vvvaltr.twin.engine import Diverged
from vvvaltr.twin.planar.stepper import Stepper
from vvvaltr.twin.world import World

if TYPE_CHECKING:
    import pymunk


SOLVER_ITERATIONS = 10
PENETRATION_M = 1e-4  # depth to which shapes may sink into each other; pymunk's default of 0.1 is meant for pixels
MOST_KINETIC_J = 20.0  # the whole robot at 22 m/s; strong gaits reach some thousandths of it
GROUND_THICKNESS_M = 0.02  # thickness of the ground


@dataclass(frozen=True, slots=True)
class Posture:
    """Where the struts are in the plane.

    Args:
        middles_m: x and z of their middles, (struts, 2).
        angles_rad: angles of their axes, bottom to top, from x towards z, (struts,).
    """

    middles_m: Array
    angles_rad: Array

    def nodes_m(self, lengths_m: Array) -> Array:
        """Return x and z of the strut ends in metres, (2 * struts, 2), for struts of these lengths (struts,)."""
        along = np.stack([np.cos(self.angles_rad), np.sin(self.angles_rad)], axis=1) * lengths_m[:, None] / 2.0
        return np.stack([self.middles_m + along, self.middles_m - along], axis=1).reshape(-1, 2)

    def move(self, angle_rad: float, x_m: float, z_m: float) -> Posture:
        """Return the posture rotated about its centre, from x towards z, and then shifted."""
        cos, sin = math.cos(angle_rad), math.sin(angle_rad)
        centre = self.middles_m.mean(axis=0)
        middles = (self.middles_m - centre) @ np.array([[cos, sin], [-sin, cos]]) + centre + [x_m, z_m]
        return Posture(middles, self.angles_rad + angle_rad)


@dataclass(frozen=True, slots=True)
class Layout:
    """A body laid into the plane.

    Args:
        posture: posture in the design state.
        lengths_m: lengths of the struts, (struts,).
        rests_m: rest lengths of the springs, (springs,).
    """

    posture: Posture
    lengths_m: Array
    rests_m: Array


@lru_cache(maxsize=64)
def flatten(body: Body) -> Layout:
    """Lay a body into the plane.

    It is projected along its z axis, scaled until the struts have their lengths again, and rotated so that the longest
    side of its outline lies on z = 0 below the origin. A spring's rest length scales with its length.
    """
    solid = np.array(body.nodes_m)
    shadow = solid[:, :2]
    scale = np.linalg.norm(solid[0] - solid[1]) / np.linalg.norm(shadow[0] - shadow[1])
    nodes = _lay_on_longest_side(shadow * scale)
    along = nodes[0::2] - nodes[1::2]
    ends = np.array([spring.nodes for spring in body.springs], dtype=int).reshape(-1, 2)
    rests_m = np.array([spring.rest_m for spring in body.springs])
    return Layout(
        Posture((nodes[0::2] + nodes[1::2]) / 2.0, np.arctan2(along[:, 1], along[:, 0])),
        np.linalg.norm(along, axis=1),
        rests_m * _measure_distances(nodes, ends) / _measure_distances(solid, ends),
    )


def _measure_distances(nodes: Array, pairs: NDArray[np.int_]) -> Array:
    return np.asarray(np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1))


def _lay_on_longest_side(nodes: Array) -> Array:
    """Return the nodes, moved so that the longest side of their outline lies on z = 0 with its middle at 0."""
    sides = [pair for pair in permutations(range(len(nodes)), 2) if _is_side(nodes, *pair)]
    # Rounded, so that every machine chooses the first of equally long sides.
    first, second = max(sides, key=lambda pair: round(math.dist(nodes[pair[0]], nodes[pair[1]]), 9))
    east = (nodes[second] - nodes[first]) / math.dist(nodes[first], nodes[second])
    middle = (nodes[first] + nodes[second]) / 2.0
    return np.asarray((nodes - middle) @ np.array([[east[0], -east[1]], [east[1], east[0]]]))


def _is_side(nodes: Array, first: int, second: int) -> bool:
    """Return whether all nodes lie to the left of the line from the first node to the second."""
    along, offsets = nodes[second] - nodes[first], nodes - nodes[first]
    return bool(np.all(along[0] * offsets[:, 1] - along[1] * offsets[:, 0] > -1e-9))


class Plane:
    """A pymunk space with the body in a posture, at rest, on the world's ground.

    Args:
        body: body that moves.
        world: world that it moves in.
        posture: posture in which the struts start.
        time_step_s: time step of the integration.
        incline_rad: angle of the floor, which goes down towards positive x.
    """

    def __init__(
        self, body: Body, world: World, posture: Posture, time_step_s: float, incline_rad: float = 0.0
    ) -> None:
        import pymunk

        layout = flatten(body)
        self._world = world
        self._halves_m = (layout.lengths_m / 2.0).tolist()
        self.space = pymunk.Space()
        self.space.iterations = SOLVER_ITERATIONS
        self.space.collision_slop = PENETRATION_M
        self.space.gravity = (
            world.gravity_m_s2 * math.sin(incline_rad),
            -world.gravity_m_s2 * math.cos(incline_rad),
        )
        self.struts = [self._add_strut(body, strut, posture) for strut in range(len(body.struts))]
        self._ends = [self._end(node) for node in range(len(body.nodes_m))]
        for spring, rest_m in zip(body.springs, layout.rests_m.tolist(), strict=True):
            self._add_spring(spring, rest_m, body.tension_only)
        self._stretches: set[int] = set()
        self._stretch: int | None = None
        self._lay_ground()
        self._stepper = Stepper(self.space, [self.struts[motor.strut] for motor in body.motors], time_step_s)

    def posture(self) -> Posture:
        """Return where the struts are now."""
        return Posture(np.array([s.position for s in self.struts]), np.array([s.angle for s in self.struts]))

    def nodes_m(self) -> Array:
        """Return x and z of the strut ends now, in metres, shape (2 * struts, 2)."""
        nodes = []
        for strut, half_m in zip(self.struts, self._halves_m, strict=True):
            (x_m, z_m), (cos, sin) = strut.position, strut.rotation_vector
            nodes += [(x_m + half_m * cos, z_m + half_m * sin), (x_m - half_m * cos, z_m - half_m * sin)]
        return np.array(nodes)

    def mean_angle_rad(self) -> float:
        """Return the mean of the struts' angles now, in radians."""
        return sum(strut.angle for strut in self.struts) / len(self.struts)

    def run(self, forces_n: NDArray[np.complex128]) -> None:
        """Make a step for each row of the motors' forces in newtons, shape (steps, motors); see ``Stepper.run``.

        Raises:
            Diverged: the kinetic energy is not finite, or greater than anything could have caused.
        """
        self._stepper.run(forces_n)
        kinetic_j = sum(strut.kinetic_energy for strut in self.struts) / 2.0  # pymunk leaves out the half
        if not kinetic_j < MOST_KINETIC_J:
            raise Diverged(f"the planar twin broke down: its struts move with {kinetic_j:.3g} J")
        self._lay_ground()

    def _lay_ground(self) -> None:
        """Lay the missing ground around the robot, enough for the steps that are made at once."""
        from pymunk import Segment

        stretch = round(self.struts[0].position.x / self._stretch_m())
        if stretch == self._stretch:
            return
        self._stretch = stretch
        for number in sorted({stretch - 1, stretch, stretch + 1} - self._stretches):
            self._stretches.add(number)
            knots = [tuple(knot) for knot in self._knots(number).tolist()]
            for before, here, there, after in zip(knots, knots[1:], knots[2:], knots[3:], strict=False):
                segment = Segment(self.space.static_body, here, there, GROUND_THICKNESS_M / 2.0)
                segment.set_neighbors(before, after)
                segment.friction = self._world.friction
                self.space.add(segment)

    def _stretch_m(self) -> float:
        return max(0.25, self._world.ground.straight_m)

    def _knots(self, stretch: int) -> Array:
        """Return the ends of the ground's segments in a stretch and one knot beyond each end, half a thickness deep.

        Stretches meet half way between the multiples of their length, so that the robot does not start on a joint.
        """
        pieces = round(self._stretch_m() / self._world.ground.straight_m)
        x_m = (stretch - 0.5 + np.arange(-1, pieces + 2) / pieces) * self._stretch_m()
        z_m = self._world.height_m(x_m, np.zeros(1))
        rise = np.gradient(z_m, x_m)
        down = np.stack([rise, -np.ones_like(rise)], axis=1) / np.hypot(rise, 1.0)[:, None]
        return np.asarray(np.stack([x_m, z_m], axis=1) + down * GROUND_THICKNESS_M / 2.0)

    def _add_strut(self, body: Body, strut: int, posture: Posture) -> pymunk.Body:
        import pymunk

        half_m, radius_m = self._halves_m[strut], body.struts[strut].radius_m
        ends = ((half_m, 0.0), (-half_m, 0.0))
        size = (2.0 * half_m, 2.0 * radius_m)
        box = body.struts[strut].shape is Shape.BOX
        # A motor sits at the middle and adds nothing to the moment of inertia.
        own_kg = body.struts[strut].mass_kg
        moment = pymunk.moment_for_box(own_kg, size) if box else pymunk.moment_for_segment(own_kg, *ends, radius_m)
        moving = pymunk.Body(float(body.masses_kg[strut]), moment)
        moving.position = tuple(posture.middles_m[strut].tolist())
        moving.angle = float(posture.angles_rad[strut])
        shape = pymunk.Poly.create_box(moving, size) if box else pymunk.Segment(moving, *ends, radius_m)
        shape.friction = 1.0  # pymunk multiplies the two surfaces' coefficients; the world's is the ground's
        shape.filter = pymunk.ShapeFilter(group=1)  # struts pass beside each other
        self.space.add(moving, shape)
        return moving

    def _add_spring(self, spring: Spring, rest_m: float, tension_only: bool) -> None:
        from pymunk import DampedSpring

        (a, at_a), (b, at_b) = (self._ends[node] for node in spring.nodes)
        damped = DampedSpring(a, b, at_a, at_b, rest_m, spring.stiffness_n_m, spring.damping_n_s_m)
        if tension_only:
            # pymunk counts a push as positive.
            damped.force_func = lambda held, distance_m: min(0.0, held.stiffness * (held.rest_length - distance_m))
        self.space.add(damped)

    def _end(self, node: int) -> tuple[pymunk.Body, tuple[float, float]]:
        half_m = self._halves_m[node // 2]
        return self.struts[node // 2], (-half_m if node % 2 else half_m, 0.0)
