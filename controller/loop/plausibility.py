"""Whether a pose can be the robot's: what cannot be is dropped and counted, and ends the trial where it goes on."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.loop.at_rest import (
    DEGREES,
    SHOW,
    UNSEEN,
    average_at_rest,
    check_repeats,
    check_yaws,
    is_same_place,
    most_central,
)

_WINDOW_S = 1.0  # in which the share of dropped poses is judged
_LARGEST_SHARE = 0.4
_FEWEST_DROPPED = 4  # one outlier among few poses is still one outlier
_FEWEST_FROZEN = 5  # poses with new time stamps at one place
_FAR_M, _HIGH_M = 50.0, 2.0  # from the origin of the tracker's frame, and above its floor: 2 cm in centimetres
_CM_HIGH_M = 20.0  # what is higher is more likely millimetres
_FULL_TURN_RAD = 6.5  # 2 pi and a little: no heading, pitch or roll is written with more
_STEEP_RAD = 1.0  # of pitch: the yaw of a robot that stands on end may be any
_TURN_RAD, _TURN_RAD_S = 0.5, 4.0  # from one pose to the next, and over a gap; the twins reach 0.2 and 1.3
_LARGEST_SHARE_AT_REST = 0.25
_BODY_LENGTH_M = 0.15  # of the published robots
_LENGTHS_PER_TURN = 0.1  # ten times what the fastest known gait does
_RUN_DOWN_S = 0.1  # for which a robot goes on at speed once its motors are off


@dataclass(frozen=True, slots=True)
class Plausibility:
    """What a pose of the robot can be.

    Args:
        max_speed_m_s: greatest speed of the robot's centre along the ground, over a trial or a long gap.
        shake_m: how far the centre may move beside that from one pose to the next, by shaking.
        max_lift_m: how far the centre may rise or fall from where it was at the start.
        lost_s: how long poses may be implausible before the trial ends.
        frozen_s: how long the position may stay the same to the last digit while motors turn; infinite for a tracker
            without noise, which may repeat one at rest as well.
    """

    max_speed_m_s: float = 1.0
    shake_m: float = 0.05
    max_lift_m: float = 0.15
    lost_s: float = 0.25
    frozen_s: float = 0.5


def plausible_speed_m_s(max_hz: float) -> float:
    """Return the speed that no robot of the published size exceeds with motors of ``max_hz``.

    A tenth of a body length of 0.15 m per turn of the motors: ten times the fastest gait that is known.
    """
    return _BODY_LENGTH_M * _LENGTHS_PER_TURN * max_hz


@dataclass(frozen=True, slots=True)
class _Stray:
    """A place to which the robot cannot have come: what stays there stays wrong, however old the last good pose is.

    Args:
        pose: the latest one there.
        problem: why the robot cannot have come there.
        apart: how far apart two poses are, in what was wrong about it.
    """

    pose: Pose
    problem: str
    apart: Callable[[Pose, Pose], float]


class PoseFilter:
    """Lets the plausible poses of one trial through, counts the others, and ends the trial where they persist.

    Before the drive ``rest`` or the first pose tells where the robot is; after it ``rest_after`` does.
    """

    def __init__(self, limits: Plausibility) -> None:
        self._limits = limits
        self._last: Pose | None = None
        self._stray: _Stray | None = None  # what was seen since then
        self._start_z_m: float | None = None
        self._at_start: Sequence[Pose] = ()
        self._seen: deque[tuple[float, bool]] = deque()
        self._frozen_since_s = math.nan
        self._frozen = 0
        self._has_frozen = False  # while motors turned, and ever since
        self.dropped = 0

    def rest(self, poses: Sequence[Pose]) -> RestingPose:
        """Return where the robot lies before the drive: an average that outliers have no say in.

        Raises:
            TrackingLost: the poses are not plausible, or do not agree.
        """
        problems = [self._problem(pose) or _origin_problem(pose, poses) for pose in poses]
        possible = [pose for pose, problem in zip(poses, problems, strict=True) if not problem]
        if not possible:
            raise TrackingLost(f"no pose of the robot at rest is plausible: {problems[-1]}")
        middle_m = most_central(possible).position_m
        near = [pose for pose in possible if math.dist(pose.position_m, middle_m) <= self._limits.shake_m]
        dropped = len(poses) - len(near)
        self.dropped += dropped
        if not near or dropped > max(1.0, _LARGEST_SHARE_AT_REST * len(poses)):
            farthest_m = max(math.dist(pose.position_m, middle_m) for pose in possible)
            problem = next(filter(None, problems), f"they are up to {farthest_m:.3g} m apart; {_TWO_BODIES}")
            raise TrackingLost(f"{dropped} of {len(poses)} poses of the robot at rest are implausible: {problem}")
        check_yaws(near)
        self._at_start = near
        return average_at_rest(near)

    def rest_after(self, poses: Sequence[Pose], driven: Sequence[Pose]) -> RestingPose:
        """Return where the robot lies after the drive.

        Raises:
            TrackingLost: the tracker has hung since before, or the yaw at rest is not in radians.
        """
        if math.isfinite(self._limits.frozen_s):
            check_repeats(self._at_start, poses)
        fresh = [pose for pose in poses if not driven or not is_same_place(pose, driven[-1])]
        if not fresh and self._has_frozen:
            raise TrackingLost(f"the tracker has repeated one position to the last digit since the drive: {UNSEEN}")
        check_yaws(self._at_start, fresh or poses)
        return average_at_rest(fresh or poses)

    def begin_at(self, rest: RestingPose, t_s: float) -> None:
        """Take ``rest`` as the place where the robot lies at ``t_s``, before the drive."""
        self._last = Pose(t_s, rest.position_m, rest.yaw_rad, rest.pitch_rad, rest.roll_rad)
        self._start_z_m = rest.position_m[2]

    def accepts(self, pose: Pose, motors_turn: bool) -> bool:
        """Return whether ``pose`` can be the robot's.

        Raises:
            TrackingLost: implausible poses have gone on for too long, or the tracker repeats one pose.
        """
        if self._is_repeat(pose, motors_turn):
            return True
        problem = self._problem(pose, motors_turn)
        self._note(pose, problem)
        if problem:
            return False
        self._last, self._stray = pose, None
        return True

    def _is_repeat(self, pose: Pose, motors_turn: bool) -> bool:
        """Return whether nothing in ``pose`` is new. Raises TrackingLost when its time alone is, for too long."""
        last = self._last
        if last is None or not is_same_place(pose, last):
            self._frozen, self._frozen_since_s, self._has_frozen = 0, pose.t_s, False
            return False
        if pose.t_s == last.t_s:
            return True  # read twice
        self._frozen += 1
        self._has_frozen = self._has_frozen or (motors_turn and math.isfinite(self._limits.frozen_s))
        if not motors_turn:
            self._frozen, self._frozen_since_s = 0, pose.t_s
        frozen_s = pose.t_s - self._frozen_since_s
        if self._frozen >= _FEWEST_FROZEN and frozen_s > self._limits.frozen_s:
            raise TrackingLost(
                f"the tracker has repeated one position to the last digit for {frozen_s:.2f} s while motors turn: "
                f"{UNSEEN}"
            )
        return False

    def _problem(self, pose: Pose, motors_turn: bool = True) -> str:
        """Return why ``pose`` cannot be the robot's; empty if it can."""
        problem = _absolute_problem(pose)
        if problem:
            return problem
        limits, last = self._limits, self._last
        if self._start_z_m is not None and abs(lift_m := pose.position_m[2] - self._start_z_m) > limits.max_lift_m:
            return (
                f"the robot's centre is {lift_m:+.2f} m from its height at the start; put it on the ground, or set "
                'up = "y" if that axis points up'
            )
        return "" if last is None else _origin_problem(pose, (last,)) or self._jump_problem(pose, last, motors_turn)

    def _jump_problem(self, pose: Pose, last: Pose, motors_turn: bool) -> str:
        """Return why the robot cannot have come from ``last`` to ``pose``; empty if it can."""
        if not any(_place(last)) and pose.position_m[2]:
            return f"the poses were zero to the last digit before: the tracker did not see the robot; {SHOW}"
        if (stray := self._stray) is not None and stray.apart(pose, stray.pose) < stray.apart(pose, last):
            problem, apart = stray.problem, stray.apart
        else:
            problem, apart = self._step_problem(pose, last, motors_turn)
        if problem:
            self._stray = _Stray(pose, problem, apart)
        return problem

    def _step_problem(self, pose: Pose, last: Pose, motors_turn: bool) -> tuple[str, Callable[[Pose, Pose], float]]:
        """Return why the robot cannot have moved so far, and what measures how far it moved."""
        gap_s = max(0.0, pose.t_s - last.t_s)
        moved_m, turned_rad = _distance_m(pose, last), _turn_rad(pose, last)
        moving_s = gap_s if motors_turn else min(gap_s, _RUN_DOWN_S)
        if moved_m > (allowed_m := self._limits.shake_m + self._limits.max_speed_m_s * moving_s):
            return (
                f"the position jumped by {moved_m:.3g} m in {gap_s:.2f} s, where {allowed_m:.2g} m is plausible; "
                f"{_TWO_BODIES}"
            ), _distance_m
        if turned_rad > (allowed_rad := _TURN_RAD + _TURN_RAD_S * gap_s):
            return (
                f"the yaw jumped by {turned_rad:.2g} rad in {gap_s:.2f} s, where {allowed_rad:.2g} rad is plausible; "
                f"{DEGREES}"
            ), _turn_rad
        return "", _distance_m

    def _note(self, pose: Pose, problem: str) -> None:
        """Count a pose, and raise TrackingLost if too many were dropped."""
        self._seen.append((pose.t_s, bool(problem)))
        while self._seen[0][0] < pose.t_s - _WINDOW_S:
            self._seen.popleft()
        if not problem:
            return
        self.dropped += 1
        dropped = sum(bad for _, bad in self._seen)
        last = self._last
        is_long = last is not None and pose.t_s - last.t_s > self._limits.lost_s
        if dropped >= _FEWEST_DROPPED and (is_long or dropped > _LARGEST_SHARE * len(self._seen)):
            raise TrackingLost(f"{dropped} of the last {len(self._seen)} poses are implausible: {problem}")


_TWO_BODIES = "let the tracker see one body alone, the robot"


def _absolute_problem(pose: Pose) -> str:
    """Return why no robot can have this pose, wherever it was before; empty if one can."""
    if not pose.is_finite:
        return f"the pose is not a number; {SHOW}"
    x_m, y_m, z_m = pose.position_m
    if max(map(abs, pose.position_m)) > _FAR_M or abs(z_m) > _HIGH_M:
        return f"the position ({x_m:.3g}, {y_m:.3g}, {z_m:.3g}) m is outside any laboratory; {_unit_cure(z_m)}"
    for name, angle_rad in (("yaw", pose.yaw_rad), ("pitch", pose.pitch_rad), ("roll", pose.roll_rad)):
        if abs(angle_rad) > _FULL_TURN_RAD:
            return f"{name} is {angle_rad:.1f} rad, more than a full turn; {DEGREES}"
    return ""


def _unit_cure(z_m: float) -> str:
    if _HIGH_M < abs(z_m) < _CM_HIGH_M:
        return 'if it is centimetres, set unit = "cm", and if millimetres, unit = "mm"'
    return 'if it is millimetres, set unit = "mm"'


def _origin_problem(pose: Pose, others: Sequence[Pose]) -> str:
    """Return why a pose of zeros alone, among others that are not, or another one after it, is not the robot's."""
    if not any(_place(pose)) and any(any(_place(other)) for other in others):
        return f"the pose is zero to the last digit, as trackers report a body that they do not see; {SHOW}"
    return ""


def _distance_m(pose: Pose, other: Pose) -> float:
    """Return how far apart two poses are along the ground."""
    return math.dist(pose.position_m[:2], other.position_m[:2])


def _turn_rad(pose: Pose, other: Pose) -> float:
    """Return by how much two headings differ; by nothing where the robot stands on end, for its yaw may then be any."""
    if max(abs(pose.pitch_rad), abs(other.pitch_rad)) >= _STEEP_RAD:
        return 0.0
    return abs(math.remainder(pose.yaw_rad - other.yaw_rad, math.tau))


def _place(pose: Pose) -> tuple[float, ...]:
    return (*pose.position_m, pose.yaw_rad, pose.pitch_rad, pose.roll_rad)
