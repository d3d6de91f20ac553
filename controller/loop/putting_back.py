"""Where a trial may begin, and how the robot gets there: by an operator, or by the hand of a mock."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from vvvaltr.controller.core.attending import Hand, StartPlace
from vvvaltr.controller.core.errors import DeviceError, TrackingLost
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.loop.safety import Arena

_STILL_M, _STILL_RAD = 0.003, 0.05
_DECIDE_S, _BLIND_S = 2.0, 10.0  # after which a robot that does not lie still, or is not seen, is judged as it is
_HAND_TRIES, _HAND_S = 3, 5.0
_BORDER = 0.05  # share of the arena's extent; nearer to its border no trial begins
_MIDDLE = 0.25  # share of the arena's lesser extent that its middle is, where there is no start circle


class Reposition(StrEnum):
    """When the robot is put back to its start."""

    EACH = "each"  # before each trial
    ARENA = "arena"  # when it is at the border of its arena
    NEVER = "never"


@dataclass(frozen=True, slots=True)
class Placement:
    """Where a trial may begin.

    Args:
        reposition: when the robot is put back.
        start: the start circle; None for the middle of the arena.
        arena: where the robot may be; None for everywhere.

    Raises:
        ValueError: the robot is to be put back each time, and nothing says where.
    """

    reposition: Reposition = Reposition.NEVER
    start: StartPlace | None = None
    arena: Arena | None = None

    def __post_init__(self) -> None:
        if self.reposition is Reposition.EACH and self.start is None:
            raise ValueError("reposition each needs a start: write [start] into the robot's file, or choose arena")

    @classmethod
    def usual(cls, start: StartPlace | None, arena: Arena | None) -> Placement:
        """Return what is done unless something else is asked for."""
        return cls(Reposition.EACH if start else Reposition.ARENA, start, arena)

    @property
    def target(self) -> StartPlace:
        """Where the robot is put back to."""
        if self.start is not None or self.arena is None:
            return self.start or StartPlace()
        (left_m, right_m), (low_m, high_m) = self.arena.x_m, self.arena.y_m
        radius_m = _MIDDLE * min(right_m - left_m, high_m - low_m)
        return StartPlace((left_m + right_m) / 2, (low_m + high_m) / 2, within_m=radius_m)

    def is_at_border(self, x_m: float, y_m: float) -> bool:
        """Return whether the robot is outside its arena, or so near to the border that no trial should begin."""
        sides = ((x_m, self.arena.x_m), (y_m, self.arena.y_m)) if self.arena else ()
        return any(not low <= at <= high for at, (low, high) in ((at, _inner(side)) for at, side in sides))


def _inner(side: tuple[float, float]) -> tuple[float, float]:
    margin = _BORDER * (side[1] - side[0])
    return side[0] + margin, side[1] - margin


@dataclass(slots=True)
class Sight:
    """The robot's last poses, and whether it lies still."""

    robot: Robot
    window_s: float
    poses: deque[Pose] = field(default_factory=deque)

    def forget(self) -> None:
        """Drop what was seen before."""
        self.poses.clear()

    def look(self) -> Pose | None:
        """Return the present pose; None where the tracker does not see the robot."""
        try:
            pose = self.robot.tracker.pose()
        except TrackingLost:
            self.poses.clear()
            return None
        if not self.poses or pose.t_s > self.poses[-1].t_s:
            self.poses.append(pose)
        while pose.t_s - self.poses[0].t_s > 1.5 * self.window_s:
            self.poses.popleft()
        return pose

    @property
    def is_still(self) -> bool:
        """Whether the means of the window's two halves agree, which the noise of single poses does not disturb."""
        poses = list(self.poses)
        if len(poses) < 4 or poses[-1].t_s - poses[0].t_s < self.window_s:
            return False
        (x_m, y_m, yaw_rad), (then_x_m, then_y_m, then_yaw_rad) = (
            _mean(poses[len(poses) // 2 :]),
            _mean(poses[: len(poses) // 2]),
        )
        turn_rad = math.remainder(yaw_rad - then_yaw_rad, math.tau)
        return math.hypot(x_m - then_x_m, y_m - then_y_m) < _STILL_M and abs(turn_rad) < _STILL_RAD


def _mean(poses: Sequence[Pose]) -> tuple[float, float, float]:
    x_m, y_m = (math.fsum(pose.position_m[axis] for pose in poses) / len(poses) for axis in (0, 1))
    sine, cosine = (math.fsum(part(pose.yaw_rad) for pose in poses) for part in (math.sin, math.cos))
    return x_m, y_m, math.atan2(sine, cosine)


class Return:
    """What one trial waits for until the robot lies where it should.

    Times are those of the robot's clock, so that a twin's hand may be as quick as its physics.
    """

    def __init__(self, placement: Placement, sight: Sight, hand: Hand | None) -> None:
        self._placement, self._sight, self._hand = placement, sight, hand
        self._must_return = {Reposition.EACH: True, Reposition.NEVER: False}.get(placement.reposition)
        if placement.arena is None and placement.reposition is Reposition.ARENA:
            self._must_return = False
        self._began_s = sight.robot.clock.now_s()
        self._asked, self._asked_s = 0, -math.inf
        self._problem = ""
        sight.forget()

    def obstacle(self) -> str:
        """Return what keeps the trial from beginning, in words for the operator; empty for nothing."""
        if self._must_return is False:
            return ""
        pose = self._sight.look()
        if self._must_return is None:
            self._must_return = self._is_at_border(pose)
            if not self._must_return:
                return "the robot moves" if self._must_return is None else ""
        if pose is None:
            return self._problem or "the tracker does not see the robot"
        place, at = self._placement.target, (*pose.position_m[:2], pose.yaw_rad)
        if not place.holds(*at):
            self._use_hand(place)
            return describe_move(place, *at)
        return "" if self._sight.is_still else "in its place; hands off, it must lie still"

    @property
    def is_for_somebody(self) -> bool:
        """Whether the robot has to be put back."""
        return self._must_return is True

    @property
    def is_hopeless(self) -> bool:
        """Whether nobody but an operator could bring the robot back."""
        if not self._must_return:
            return False
        now_s = self._sight.robot.clock.now_s()
        if not self._sight.poses:
            return now_s - self._began_s > _BLIND_S
        if self._hand is None:  # a robot may still roll: judged after a moment
            return now_s - self._began_s > _DECIDE_S
        return self._asked >= _HAND_TRIES and now_s - self._asked_s > _HAND_S

    @property
    def cure(self) -> str:
        """What the user can do about it."""
        if not self._sight.poses:
            return "check what it sees by vvvaltr track"
        if self._hand is not None:
            return "the mock's hand did not put it there" + (f": {self._problem}" if self._problem else "")
        other = "arena or never" if self._placement.reposition is Reposition.EACH else "never"
        return f"nobody is there to put it back: run it --attended, or choose --reposition {other}"

    def _is_at_border(self, pose: Pose | None) -> bool | None:
        """Return whether the robot is at its arena's border; None while that is not certain."""
        if pose is not None and not self._placement.is_at_border(*pose.position_m[:2]):
            return False
        late = self._sight.robot.clock.now_s() - self._began_s > _DECIDE_S
        if pose is None:
            return False if late else None  # the trial will say that the tracker is blind
        return True if self._sight.is_still or late else None

    def _use_hand(self, place: StartPlace) -> None:
        now_s = self._sight.robot.clock.now_s()
        if self._hand is None or self._asked >= _HAND_TRIES or now_s - self._asked_s < _HAND_S / 2:
            return
        self._asked += 1
        try:
            self._hand.put_back(place)
        except DeviceError as error:
            self._problem = str(error)
        self._asked_s = self._sight.robot.clock.now_s()
        self._sight.forget()


def describe_move(place: StartPlace, x_m: float, y_m: float, yaw_rad: float) -> str:
    """Return how far and which way a robot has to be moved and turned, in the tracker's frame, for a line of 60."""
    words = []
    if (distance_m := place.distance_m(x_m, y_m)) > place.within_m:
        words.append(f"move {distance_m:.2f} m (x {place.x_m - x_m:+.2f} y {place.y_m - y_m:+.2f})")
    turn_rad = place.turn_rad(yaw_rad)
    if abs(turn_rad) > place.within_rad:
        words.append(f"turn {math.degrees(abs(turn_rad)):.0f} deg {'left' if turn_rad > 0 else 'right'}")
    return ", ".join(words)
