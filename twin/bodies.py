"""The bodies by name: three struts or six, of parts whose numbers a twin chooses."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.spelling import unknown
from vvvaltr.twin.body import Body, ForceLaw, Motor, Shape, Spring, Strut


@dataclass(frozen=True, slots=True)
class Parts:
    """The numbers of a robot's parts. Each twin has its own, because two and three dimensions need different ones.

    Args:
        total_kg: mass of the whole robot, motors included.
        motor_kg: mass of each motor.
        law, max_hz, spin_up_s, rotor_kg_m2: properties of each motor, see ``Motor``.
        stiffness_n_m, damping_n_s_m: properties of each spring, see ``Spring``.
        rest_share: rest length of each spring, as a share of its length in the design state.
        strut_m: length of each strut.
        radius_m, shape: cross-section of each strut, see ``Strut``.
        tension_only: whether springs only pull, see ``Body``.
    """

    total_kg: float
    motor_kg: float
    law: ForceLaw
    max_hz: float
    stiffness_n_m: float
    damping_n_s_m: float
    rest_share: float
    radius_m: float
    tension_only: bool
    strut_m: float = 0.094
    shape: Shape = Shape.CAPSULE
    spin_up_s: float = 0.05
    rotor_kg_m2: float = 0.0


# Strut ends of the six-strut robot joined by springs, as its builders number them: struts 1 to 6, t(op) and b(ottom).
ICOSAHEDRON_SPRINGS = """
1t-5t 1t-6t 1t-3t 1t-3b 2t-5b 2t-6b 2t-3t 2t-3b 1b-5t 1b-6t 1b-4t 1b-4b
2b-5b 2b-6b 2b-4t 2b-4b 3t-5t 3t-5b 3b-6t 3b-6b 4t-5t 4t-5b 4b-6t 4b-6b
"""
# The same for the prism: all tops, all bottoms, and each top to the bottom of its neighbour.
PRISM_SPRINGS = "1t-2t 2t-3t 3t-1t 1b-2b 2b-3b 3b-1b 1t-2b 2t-3b 3t-1b"


def prism3(parts: Parts) -> Body:
    """Return the three-strut prism with a motor on each strut, standing on a triangle.

    Each strut's top is rotated by 150 degrees against its bottom. The two triangles are then 30 degrees apart, the only
    angle at which a three-strut prism is stable. Radius and height make all nine springs equally long.
    """
    height = math.sqrt(1.0 + math.sqrt(3.0))  # in radii: an edge of a triangle, sqrt(3), is as long as a rising spring
    radius_m = parts.strut_m / math.sqrt(height**2 + (2.0 * math.sin(math.radians(75.0))) ** 2)
    nodes = []
    for strut in range(3):
        bottom = math.radians(120.0 * strut)
        top = bottom + math.radians(150.0)
        nodes += [(math.cos(top), math.sin(top), height), (math.cos(bottom), math.sin(bottom), 0.0)]
    return _assemble("prism3", radius_m * np.array(nodes), PRISM_SPRINGS, (0, 1, 2), parts)


def icosahedron6(parts: Parts) -> Body:
    """Return the six-strut robot with motors on struts 0, 2 and 4, standing on a triangle.

    Its struts form three parallel pairs along three orthogonal axes; the two of a pair are half a strut's length apart.
    """
    half, side = 0.5, 0.25
    nodes = np.array(
        [
            *((side, 0, half), (side, 0, -half), (-side, 0, half), (-side, 0, -half)),
            *((0, half, side), (0, -half, side), (0, half, -side), (0, -half, -side)),
            *((half, side, 0), (-half, side, 0), (half, -side, 0), (-half, -side, 0)),
        ]
    )
    # The diagonal of the three axes becomes the vertical: about it, the body repeats every 120 degrees.
    east, north = np.array([1.0, -1.0, 0.0]) / math.sqrt(2.0), np.array([1.0, 1.0, -2.0]) / math.sqrt(6.0)
    turned = nodes @ np.array([east, north, np.cross(east, north)]).T
    return _assemble("icosahedron6", parts.strut_m * turned, ICOSAHEDRON_SPRINGS, (0, 2, 4), parts)


BODIES: Mapping[str, Callable[[Parts], Body]] = {"prism3": prism3, "icosahedron6": icosahedron6}


def make_body(name: str, parts: Parts) -> Body:
    """Return the body called ``name``, a key of ``BODIES``. Raises ValueError for an unknown name."""
    if name not in BODIES:
        raise ValueError(unknown("body", name, BODIES))
    return BODIES[name](parts)


def _assemble(name: str, nodes_m: Array, springs: str, motor_struts: tuple[int, ...], parts: Parts) -> Body:
    nodes_m = nodes_m - [0.0, 0.0, nodes_m[:, 2].min()]
    struts = len(nodes_m) // 2
    strut_kg = (parts.total_kg - len(motor_struts) * parts.motor_kg) / struts
    return Body(
        name=name,
        nodes_m=tuple((float(x), float(y), float(z)) for x, y, z in nodes_m),
        struts=(Strut(parts.radius_m, strut_kg, parts.shape),) * struts,
        springs=tuple(_make_spring(text, nodes_m, parts) for text in springs.split()),
        motors=tuple(_make_motor(strut, parts) for strut in motor_struts),
        tension_only=parts.tension_only,
    )


def _make_motor(strut: int, parts: Parts) -> Motor:
    return Motor(strut, parts.law, parts.motor_kg, parts.max_hz, parts.spin_up_s, parts.rotor_kg_m2)


def _make_spring(text: str, nodes_m: Array, parts: Parts) -> Spring:
    first, second = (2 * int(end[0]) - 2 + "tb".index(end[1]) for end in text.split("-"))
    design_m = float(np.linalg.norm(nodes_m[first] - nodes_m[second]))
    return Spring((first, second), parts.rest_share * design_m, parts.stiffness_n_m, parts.damping_n_s_m)
