"""What a physics engine does for a twin. It knows no task, no score and no randomness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.errors import DeviceFault
from vvvaltr.controller.core.values import Forces, Gait
from vvvaltr.twin.body import Body
from vvvaltr.twin.world import World


@dataclass(frozen=True, slots=True)
class Start:
    """How the robot is put down: the centre's place on the ground, the heading and a small tilt.

    The planar twin has no use for ``y_m`` and ``yaw_rad``.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0


LEVEL = Start()


class Diverged(DeviceFault):
    """The simulated state is no longer a motion: not finite, or with an energy that nothing could have put in."""

    def __init__(self, message: str) -> None:
        super().__init__("diverged", message)


class Engine(Protocol):
    """Physics of one body in one world. The same calls after a reset give the same motion, bit for bit."""

    @property
    def body(self) -> Body:
        """The body, damage included."""
        ...

    @property
    def world(self) -> World:
        """The world."""
        ...

    @property
    def time_s(self) -> float:
        """Simulated time since the reset."""
        ...

    def reset(self, start: Start = LEVEL) -> None:
        """Put the settled robot down at ``start``, at rest, motors still, time 0."""
        ...

    def step(self, gait: Gait, duration_s: float) -> None:
        """Drive with ``gait`` for a while; what does not fill a time step is made up for in the next call.

        The actual frequency follows the commanded one with each motor's lag and within its ``max_hz``. The force's
        angle is the integral of the actual frequency plus the gait's phase, so a change of frequency never jumps it.

        Raises:
            Diverged: the simulation broke down; only ``reset`` is possible now.
            ValueError: the gait is for another number of motors.
        """
        ...

    def nodes_m(self) -> Array:
        """Positions of the strut ends, shape (2 * struts, 3)."""
        ...

    def angles_rad(self) -> tuple[float, float, float]:
        """Yaw, pitch and roll of the robot as a whole against its settled posture; without jumps at half a turn."""
        ...

    def applied_hz(self) -> tuple[float, ...]:
        """Return the actual frequency of each motor."""
        ...

    def forces(self) -> Forces | None:
        """Return what pulls and pushes at the robot now; None where telling would cost more than the physics."""
        ...
