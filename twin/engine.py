"""The interface of a physics engine. An engine knows no task, no score and no randomness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.errors import DeviceFault
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Forces
from vvvaltr.twin.body import Body
from vvvaltr.twin.world import World


@dataclass(frozen=True, slots=True)
class Start:
    """How the robot is put down.

    Args:
        x_m, y_m: place of the centre on the ground; the planar twin ignores y.
        yaw_rad: heading, counter-clockwise from x; the planar twin ignores it.
        pitch_rad: tilt, on top of the slope of the ground.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0


LEVEL = Start()


class Diverged(DeviceFault):
    """The simulation broke down: its state is not finite, or has more energy than anything could have put in."""

    def __init__(self, message: str) -> None:
        super().__init__("diverged", message)


class Engine(Protocol):
    """The physics of one body in one world. The same calls after a reset give the same motion, bit for bit."""

    @property
    def body(self) -> Body:
        """The body, with its damage."""
        ...

    @property
    def world(self) -> World:
        """The world that the body moves in."""
        ...

    @property
    def time_s(self) -> float:
        """Simulated time since the reset, in seconds."""
        ...

    def reset(self, start: Start = LEVEL) -> None:
        """Put the settled robot down at ``start``, at rest, with its motors off, and set the time to 0."""
        ...

    def incline(self, angle_rad: float, azimuth_rad: float) -> None:
        """Incline the whole floor, with all axes on it; ``azimuth_rad`` is the direction downhill, from x to y.

        It is gravity that turns: heights, angles and positions still count from the floor. The planar twin's floor goes
        down towards positive or negative x, whichever is nearer.
        """
        ...

    def step(self, gait: Gait, duration_s: float) -> None:
        """Drive with ``gait`` for ``duration_s``; the part that does not fill a time step is added to the next call.

        The actual frequency follows the commanded one with each motor's lag and within its ``max_hz``. The angle of the
        force is the integral of the actual frequency plus the gait's phase, so it has no jump where the frequency
        changes.

        Raises:
            Diverged: the simulation broke down; from now on, only ``reset`` is possible.
            ValueError: the gait is for another number of motors.
        """
        ...

    def nodes_m(self) -> Array:
        """Return the positions of the strut ends in metres, shape (2 * struts, 3)."""
        ...

    def angles_rad(self) -> tuple[float, float, float]:
        """Return yaw, pitch and roll of the whole robot against its settled posture, without jumps at half a turn."""
        ...

    def applied_hz(self) -> tuple[float, ...]:
        """Return the actual frequency of each motor in Hz, with the sign of its rotation."""
        ...

    def forces(self) -> Forces | None:
        """Return the forces on the robot now; None where computing them would take longer than the physics."""
        ...
