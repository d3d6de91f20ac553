"""The robot's surroundings: gravity, friction and the ground."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature

import numpy as np

from vvvaltr.controller.core import values as types
from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.spelling import unknown
from vvvaltr.controller.core.streams import stream


def _check_range(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name} is {value:g}; allowed: {low:g} to {high:g}")


@dataclass(frozen=True, slots=True)
class Flat:
    """Level ground."""

    @property
    def straight_m(self) -> float:
        """Length over which the ground is straight in effect, in metres."""
        return 100.0

    def at(self, x_m: Array, y_m: Array) -> Array:
        """Return the heights in metres at points of the plane, arrays that broadcast against each other."""
        return 0.0 * (x_m + y_m)


@dataclass(frozen=True, slots=True)
class Slope:
    """Ground that rises towards positive x, with height 0 at the origin.

    Args:
        angle_rad: angle of the slope.
    """

    angle_rad: float = 0.05

    def __post_init__(self) -> None:
        _check_range("angle_rad", self.angle_rad, -0.5, 0.5)

    @property
    def straight_m(self) -> float:
        """Length over which the ground is straight in effect, in metres."""
        return 100.0

    def at(self, x_m: Array, y_m: Array) -> Array:
        """Return the heights in metres at points of the plane, arrays that broadcast against each other."""
        return math.tan(self.angle_rad) * (x_m + 0.0 * y_m)


@dataclass(frozen=True, slots=True)
class Hills:
    """Rolling ground: the sum of three waves, roughly 60 degrees apart, with height 0 at the origin.

    Args:
        height_m: greatest possible height of a peak above a valley.
        wavelength_m: mean length of the waves.
        seed: seed of the waves' phases, lengths and directions.
    """

    height_m: float = 0.006
    wavelength_m: float = 0.2
    seed: int = 0

    def __post_init__(self) -> None:
        _check_range("height_m", self.height_m, 0.0, 0.1)
        _check_range("wavelength_m", self.wavelength_m, 0.02, 10.0)
        _check_range("seed", self.seed, 0, 2**31)

    @property
    def straight_m(self) -> float:
        """Length over which the ground is straight in effect, in metres."""
        return self.wavelength_m / 20.0

    def at(self, x_m: Array, y_m: Array) -> Array:
        """Return the heights in metres at points of the plane, arrays that broadcast against each other."""
        random = stream(self.seed, 0, "hills")
        heights = 0.0 * (x_m + y_m)
        for direction in (0.0, math.pi / 3.0, -math.pi / 3.0):
            direction += random.uniform(-0.25, 0.25)
            number = 2.0 * math.pi / (self.wavelength_m * random.uniform(0.85, 1.15))
            phase = random.uniform(0.0, 2.0 * math.pi)
            along_m = x_m * math.cos(direction) + y_m * math.sin(direction)
            heights += self.height_m / 6.0 * (np.sin(number * along_m + phase) - math.sin(phase))
        return heights


Ground = Flat | Hills | Slope


@dataclass(frozen=True, slots=True)
class World:
    """Where a twin moves.

    Args:
        gravity_m_s2: acceleration of gravity, downwards.
        friction: Coulomb coefficient between robot and ground.
        ground: shape of the ground.
    """

    gravity_m_s2: float = 9.81
    friction: float = 0.5
    ground: Ground = Flat()

    def __post_init__(self) -> None:
        _check_range("gravity_m_s2", self.gravity_m_s2, 0.0, 100.0)
        _check_range("friction", self.friction, 0.0, 10.0)

    def height_m(self, x_m: Array, y_m: Array) -> Array:
        """Return the ground's heights in metres at points of the plane, arrays that broadcast against each other."""
        return self.ground.at(np.asarray(x_m, dtype=np.float64), np.asarray(y_m, dtype=np.float64))


PLAIN = World()

_MOST_PIECES = 500  # of a viewer's ground along each side: a log keeps it all


def sample_terrain(world: World, half_width_m: float = 0.5) -> types.Terrain:
    """Return the ground around the origin, to ``half_width_m`` on each side, as a square grid for a viewer."""
    points = 1 + min(max(1, math.ceil(2.0 * half_width_m / world.ground.straight_m)), _MOST_PIECES)
    line = np.linspace(-half_width_m, half_width_m, points)
    heights = world.height_m(line[:, None], line[None, :])
    return types.Terrain(tuple(line.tolist()), tuple(line.tolist()), tuple(map(tuple, heights.tolist())))


GROUNDS: dict[str, Callable[..., Ground]] = {"flat": Flat, "hills": Hills, "slope": Slope}


def parse_world(text: str, gravity_m_s2: float | None = None, friction: float | None = None) -> World:
    """Return the world that the command line writes as ``flat``, ``hills:height_m=0.004,seed=3`` or ``slope``.

    Args:
        text: kind of ground and its settings.
        gravity_m_s2: gravity; None for the usual 9.81.
        friction: Coulomb coefficient; None for the usual 0.5.

    Raises:
        ValueError: the text or a value is wrong; one line that names what is wrong and what is allowed.
    """
    given = {"gravity_m_s2": gravity_m_s2, "friction": friction}
    ground = _ground(text)
    return World(ground=ground, **{name: value for name, value in given.items() if value is not None})


def _ground(text: str) -> Ground:
    kind, _, settings = text.partition(":")
    if kind not in GROUNDS:
        raise ValueError(unknown("world", kind, GROUNDS))
    try:
        return GROUNDS[kind](**dict(_setting(kind, part) for part in settings.split(",") if settings))
    except ValueError as error:
        raise ValueError(f"world {text!r}: {error}") from None


def _setting(kind: str, text: str) -> tuple[str, float]:
    """Return name and value of ``name=value``."""
    name, _, value = text.partition("=")
    names = list(signature(GROUNDS[kind]).parameters)
    if name not in names:
        raise ValueError(unknown(f"setting of {kind}", name, names) if names else f"{kind} has no settings")
    try:
        return name, int(value) if name == "seed" else float(value)
    except ValueError:
        raise ValueError(f"{name} is {value!r}, which is not a {'whole ' * (name == 'seed')}number") from None
