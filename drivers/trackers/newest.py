"""The newest pose of a tracker, or why there is none: what every tracker that receives poses has in common."""

from __future__ import annotations

import logging
import math
import time
from dataclasses import replace

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose, Vector
from vvvaltr.drivers.links.remote_clock import RemoteClock
from vvvaltr.drivers.trackers.attitude import Angles, Matrix, angles_of, is_rotation

_log = logging.getLogger(__name__)

_FARTHEST_M = 1000.0  # no laboratory is as large
_SMALL_STEP_S = 0.02  # times that are further back than any sender's wobble are a clock that was set back
_FAR_AHEAD = 2**15  # frames; a number that far ahead is an old one, from before the counter wrapped
UNSEEN = "the tracker does not see the robot"


class NewestPose:
    """Keeps the newest pose. One thread writes, any thread reads.

    Args:
        age_limit_s: the greatest age of a pose that is still the robot's.
        reason: why there is no pose before the first one.
        cure: what to do about it.
    """

    def __init__(self, age_limit_s: float, reason: str, cure: str = "") -> None:
        self.age_limit_s = age_limit_s
        self.clock = RemoteClock()
        self._frame, self._sent_s, self._heard_s = -1, -math.inf, -math.inf
        self._hangs, self._missing = False, ""
        self._last_rad: Angles = (0.0, 0.0, 0.0)
        # The pose, or why there is none and the cure: one attribute, for two threads share it.
        self._newest: Pose | tuple[str, str] = (reason, cure)

    def pose(self) -> Pose:
        """Return the newest pose. Raises TrackingLost if it is too old, or the robot was not seen."""
        newest = self._newest
        if isinstance(newest, tuple):
            raise TrackingLost(*newest)
        age_s = time.monotonic() - newest.t_s
        if age_s > self.age_limit_s:
            cause = f"the tracker hangs: it repeats frame {self._frame}" if self._hangs else self._missing
            limit = f"the last pose is {age_s:.2f} s old; the limit is {self.age_limit_s:g} s"
            raise TrackingLost(f"{limit}; {cause}" if cause else limit)
        return newest

    def lose(self, reason: str, cure: str = "") -> None:
        """Have no pose until the next one is taken in."""
        self._newest = (reason, cure)

    def miss(self, reason: str) -> None:
        """Note why a frame shows nothing; the pose before it is the robot's until it is too old."""
        self._missing = reason
        if isinstance(self._newest, tuple):
            self._newest = (reason, "")

    def take(self, frame: int, t_s: float, pose: Pose | str, received_s: float) -> bool:
        """Take in a frame; returns whether it is news: a repeated or overtaken one changes nothing.

        Args:
            frame: its number, which counts up, and may wrap or begin anew.
            t_s: when it was taken, on the tracker's clock. A clock that is set to another time, forwards or backwards,
                is noticed by the numbers, which go on.
            pose: what it shows, whatever its time; or why it shows no pose.
            received_s: when it came, as ``time.monotonic()`` counts.
        """
        if frame == self._frame:
            self._hangs = True  # and the pose grows old
            return False
        back_s = self._sent_s - t_s
        if back_s > 0.0 and not self._is_set_back(frame, back_s):
            if received_s - self._heard_s < self.age_limit_s:
                return False  # overtaken on its way
            _log.info("the poses' clock restarted: frame %d follows frame %d", frame, self._frame)
            self.clock = RemoteClock()  # after a silence another sender may begin, at any number and time
        elif back_s > 0.0:
            _log.warning("the tracker's clock was set back by %.3g s", back_s)
            self.clock = RemoteClock()
        self._frame, self._sent_s, self._heard_s = frame, t_s, received_s
        self._hangs, self._missing = False, ""
        if isinstance(pose, str):
            self._newest = (pose, "")
        else:
            self._newest = replace(pose, t_s=self.clock.here_s(t_s, received_s))
        return True

    def _is_set_back(self, frame: int, back_s: float) -> bool:
        """Return whether a frame follows the last one although its time does not: an overtaken one does neither."""
        return 0 < frame - self._frame < _FAR_AHEAD and back_s > _SMALL_STEP_S

    def take_body(
        self,
        frame: int,
        t_s: float,
        position_m: Vector,
        rotation: Matrix,
        uncertainty_m: float | None,
        received_s: float,
    ) -> bool:
        """Take in a frame that shows a rigid body, as ``take`` does; without a place and a rotation it shows none."""
        is_near = all(abs(x_m) < _FARTHEST_M for x_m in position_m)  # which NaN is not
        if not (is_near and is_rotation(rotation)):
            return self.take(frame, t_s, UNSEEN, received_s)
        self._last_rad = angles_of(rotation, self._last_rad)
        # Within half a turn: a pose with more than a full turn is taken for degrees.
        yaw_rad, pitch_rad, roll_rad = (math.remainder(angle_rad, math.tau) for angle_rad in self._last_rad)
        pose = Pose(t_s, position_m, yaw_rad, pitch_rad, roll_rad, uncertainty_m=uncertainty_m)
        return self.take(frame, t_s, pose, received_s)
