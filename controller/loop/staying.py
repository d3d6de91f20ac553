"""A robot that nobody puts back between trials."""

from __future__ import annotations

from vvvaltr.controller.core.protocols import Clock, MotorDriver, Robot, Tracker
from vvvaltr.controller.core.values import Structure


class Staying:
    """A robot each trial of which begins where the last one ended: satisfies ``Robot``.

    Args:
        robot: with guarded motors.
        clock: in place of the robot's own; None for that.
    """

    def __init__(self, robot: Robot, clock: Clock | None = None) -> None:
        self._robot = robot
        self.motors: MotorDriver = robot.motors
        self.tracker: Tracker = robot.tracker
        self.clock: Clock = clock or robot.clock
        self.structure: Structure | None = robot.structure

    def place(self, trial: int) -> None:
        """Make the robot ready where it is. Raises DeviceError."""
        self._robot.carry_on(trial)

    def carry_on(self, trial: int) -> None:
        """Do as ``place`` does."""
        self._robot.carry_on(trial)

    def close(self) -> None:
        """Stop the motors and let go of everything."""
        self._robot.close()
