"""A robot as a list of parts: struts, springs, motors; and damage as pure functions on a body.

Both twins build from the same ``Body``. Struts, springs and motors are indices here, counted from 0. People count them
from 1: ``damaged`` reads such numbers. Strut ``i`` has the ends (nodes) ``2 * i`` (top) and ``2 * i + 1`` (bottom).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeVar

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Structure, Terrain, Vector

Number = TypeVar("Number", float, Array)


class Shape(StrEnum):
    """The cross-section of a strut."""

    CAPSULE = "capsule"
    BOX = "box"


@dataclass(frozen=True, slots=True)
class Strut:
    """A stiff rod between two nodes.

    Args:
        radius_m: radius of a capsule, half the side of a box.
        mass_kg: mass without the motor.
        shape: cross-section.
    """

    radius_m: float
    mass_kg: float
    shape: Shape = Shape.CAPSULE


@dataclass(frozen=True, slots=True)
class Spring:
    """A spring between two nodes, which pulls with stiffness * (distance - rest length) + damping * lengthening speed.

    Args:
        nodes: indices of the two nodes.
        rest_m: rest length.
        stiffness_n_m: stiffness.
        damping_n_s_m: damping.
    """

    nodes: tuple[int, int]
    rest_m: float
    stiffness_n_m: float
    damping_n_s_m: float


@dataclass(frozen=True, slots=True)
class ConstantForce:
    """The thesis' motor: a force of the same size at every frequency.

    Below 1 Hz it fades in proportion to the frequency, so that a motor at rest exerts no force.

    Args:
        force_n: size of the force.
    """

    force_n: float

    def at(self, frequency_hz: Number) -> Number:
        """Return the size of the force in newtons, for one frequency in Hz or an array of them."""
        fade: Number = np.minimum(1.0, abs(frequency_hz))
        return self.force_n * fade


@dataclass(frozen=True, slots=True)
class EccentricForce:
    """A real vibration motor, with an eccentric mass m_e at the radius r: F = m_e r (2 pi f)^2.

    Args:
        mass_radius_kg_m: m_e r.
    """

    mass_radius_kg_m: float

    def at(self, frequency_hz: Number) -> Number:
        """Return the size of the force in newtons, for one frequency in Hz or an array of them."""
        return self.mass_radius_kg_m * (2.0 * math.pi * frequency_hz) ** 2


ForceLaw = ConstantForce | EccentricForce


@dataclass(frozen=True, slots=True)
class Motor:
    """A motor at the middle of a strut, whose force rotates about the strut's axis.

    Args:
        strut: index of the strut that carries it.
        law: size of the force as a function of frequency.
        mass_kg: mass of the motor, which adds to the strut's own.
        max_hz: limit of the actual frequency; 0 for a motor that does not turn.
        spin_up_s: time constant with which the actual frequency approaches the commanded one.
        rotor_kg_m2: inertia of the rotor; as it speeds up, the strut turns the other way.
        spin_down_s: time constant where the frequency falls; None for that of the spin-up.
    """

    strut: int
    law: ForceLaw
    mass_kg: float
    max_hz: float
    spin_up_s: float
    rotor_kg_m2: float = 0.0
    spin_down_s: float | None = None


@dataclass(frozen=True, slots=True)
class Body:
    """A tensegrity robot.

    Args:
        name: name on the command line.
        nodes_m: strut ends in the design state, (2 * struts) points; z is the axis of symmetry and the lowest z is 0.
        struts, springs, motors: parts of the robot.
        tension_only: whether springs only pull; otherwise they pull and push (the thesis' Hooke law).
    """

    name: str
    nodes_m: tuple[Vector, ...]
    struts: tuple[Strut, ...]
    springs: tuple[Spring, ...]
    motors: tuple[Motor, ...]
    tension_only: bool

    @property
    def masses_kg(self) -> Array:
        """Masses of the struts, each with its motors, shape (struts,)."""
        masses = np.array([strut.mass_kg for strut in self.struts])
        for motor in self.motors:
            masses[motor.strut] += motor.mass_kg
        return masses

    @property
    def node_shares(self) -> Array:
        """Share of the whole mass that counts at each strut end, shape (2 * struts,): half of its strut's mass."""
        masses_kg = self.masses_kg
        return np.asarray(np.repeat(masses_kg, 2) / (2.0 * masses_kg.sum()))

    def centre_m(self, nodes_m: Array) -> Array:
        """Return the centre of mass sum(m_i r_i) / sum(m_i), shape (3,), of nodes in metres, shape (2 * struts, 3)."""
        return np.asarray(self.node_shares @ nodes_m)

    def structure(self, terrain: Terrain | None = None) -> Structure:
        """Return what a viewer needs to draw the robot, on its terrain."""
        return Structure(
            struts=tuple((2 * strut, 2 * strut + 1) for strut in range(len(self.struts))),
            springs=tuple(spring.nodes for spring in self.springs),
            motor_struts=tuple(motor.strut for motor in self.motors),
            terrain=terrain,
        )


def snap(body: Body, springs: Iterable[int]) -> Body:
    """Return the body without these springs (indices). Raises ValueError for a spring that the body does not have."""
    gone = {_check_index("spring", spring, len(body.springs)) for spring in springs}
    return replace(body, springs=tuple(spring for i, spring in enumerate(body.springs) if i not in gone))


def lighten(body: Body, strut: int, factor: float) -> Body:
    """Return the body with a strut (index) of ``factor`` times its mass, 0.2 to 1; its motor keeps its own mass.

    A strut lighter than that would swing on its springs too fast for the twins' time steps.

    Raises:
        ValueError: the body does not have this strut, or the factor is out of range.
    """
    _check_index("strut", strut, len(body.struts))
    if not 0.2 <= factor <= 1.0:
        raise ValueError(f"the factor is {factor:g}; allowed: 0.2 to 1")
    lighter = replace(body.struts[strut], mass_kg=factor * body.struts[strut].mass_kg)
    return replace(body, struts=(*body.struts[:strut], lighter, *body.struts[strut + 1 :]))


def disable(body: Body, motor: int) -> Body:
    """Return the body with a motor (index) that does not turn. Raises ValueError for a motor it does not have."""
    _check_index("motor", motor, len(body.motors))
    dead = replace(body.motors[motor], max_hz=0.0)
    return replace(body, motors=(*body.motors[:motor], dead, *body.motors[motor + 1 :]))


def apply_damage(body: Body, specs: Sequence[str]) -> Body:
    """Return the body with damage as the command line writes it: ``snap:4,18``, ``lighten:3:0.5``, ``disable:2``.

    Numbers count from 1 and always mean the parts of the undamaged body, whatever the order of the specs.

    Raises:
        ValueError: a spec is wrong; one line that names it, what is wrong with it and what is allowed.
    """
    snapped: set[int] = set()
    hurt = body
    for spec in specs:
        try:
            match spec.split(":"):
                case ["snap", springs]:
                    snapped.update(_parse_index("spring", text, len(body.springs)) for text in springs.split(","))
                case ["lighten", strut, factor]:
                    hurt = lighten(hurt, _parse_index("strut", strut, len(body.struts)), _parse_number(factor))
                case ["disable", motor]:
                    hurt = disable(hurt, _parse_index("motor", motor, len(body.motors)))
                case _:
                    raise ValueError("damage is snap:SPRING,..., lighten:STRUT:FACTOR or disable:MOTOR")
        except ValueError as error:
            raise ValueError(f"damage {spec!r}: {error}") from None
    return snap(hurt, snapped)


def _parse_index(kind: str, text: str, count: int) -> int:
    """Return the index of the part whose number, counted from 1, is ``text``."""
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise ValueError(f"{text!r} is not a whole number from 1")
    if not 1 <= int(text) <= count:
        raise ValueError(f"there is no {kind} {int(text)}; {kind}s are numbered 1 to {count}")
    return int(text) - 1


def _parse_number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{text!r} is not a number") from None


def _check_index(kind: str, index: int, count: int) -> int:
    if not 0 <= index < count:
        raise ValueError(f"there is no {kind} with index {index}; indices are 0 to {count - 1}")
    return index
