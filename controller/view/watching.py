"""A robot that shows what it reads: the loop leaves its last reading where a view may look, and never waits for it."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.protocols import Clock, MotorDriver, Photographer, Robot, Tracker
from vvvaltr.controller.core.values import MotorState, Photo, Pose, Structure
from vvvaltr.drivers.links.remote_clock import RemoteClock


@dataclass(frozen=True, slots=True)
class Moment:
    """The last reading of a running trial.

    Args:
        trial: its number.
        started_unix_s: wall time at which it began.
        drive_s: when its drive began, on the robot's clock; None while the robot still settles.
        asked: the gait that was asked for last; None before the drive.
        pose, state: what tracker and motors said last, with times on the robot's clock; None where nothing was read.
    """

    trial: int
    started_unix_s: float
    drive_s: float | None = None
    asked: Gait | None = None
    pose: Pose | None = None
    state: MotorState | None = None


class WatchedRobot:
    """A robot that keeps its last reading in ``moment``; everything else is left to the robot that it watches.

    Args:
        robot: with guarded motors.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.moment: Moment | None = None
        self.motors: MotorDriver = _WatchedMotors(self, robot.motors)
        self.tracker: Tracker = _WatchedTracker(self, robot.tracker)

    @property
    def clock(self) -> Clock:
        """The clock."""
        return self._robot.clock

    @property
    def structure(self) -> Structure | None:
        """How to draw the robot."""
        return self._robot.structure

    def place(self, trial: int) -> None:
        """Make the robot ready for a trial."""
        self.moment = Moment(trial, time.time())
        self._robot.place(trial)

    def carry_on(self, trial: int) -> None:
        """Make the robot ready for a trial that begins where it is."""
        self.moment = Moment(trial, time.time())
        self._robot.carry_on(trial)

    def close(self) -> None:
        """Close the robot."""
        self._robot.close()


class _WatchedMotors:
    def __init__(self, watch: WatchedRobot, motors: MotorDriver) -> None:
        self._watch, self._motors = watch, motors

    @property
    def motor_count(self) -> int:
        return self._motors.motor_count

    @property
    def quantities(self) -> frozenset[Quantity]:
        return self._motors.quantities

    def drive(self, gait: Gait, hold_s: float) -> None:
        self._motors.drive(gait, hold_s)
        if (moment := self._watch.moment) is not None:
            drive_s = self._watch.clock.now_s() if moment.drive_s is None else moment.drive_s
            self._watch.moment = replace(moment, asked=gait, drive_s=drive_s)

    def state(self) -> MotorState:
        state = self._motors.state()
        if (moment := self._watch.moment) is not None:
            self._watch.moment = replace(moment, state=state)
        return state

    def stop(self) -> None:
        self._watch.moment = None  # the trial's record follows, with all of it
        self._motors.stop()

    def close(self) -> None:
        self._motors.close()


class _WatchedTracker:
    def __init__(self, watch: WatchedRobot, tracker: Tracker) -> None:
        self._watch, self._tracker = watch, tracker
        self.is_exact: bool = getattr(tracker, "is_exact", False)

    @property
    def clock(self) -> RemoteClock | None:
        return getattr(self._tracker, "clock", None)

    def take_photos(self) -> tuple[Photo, ...]:
        return self._tracker.take_photos() if isinstance(self._tracker, Photographer) else ()

    def pose(self) -> Pose:
        pose = self._tracker.pose()
        if (moment := self._watch.moment) is not None and pose.is_finite:
            self._watch.moment = replace(moment, pose=pose)
        return pose
