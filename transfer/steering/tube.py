"""Where a driven movement is expected to take the robot, at each time: the tube of the posterior predictive.

The velocity of the drive, e included, and the floor's drift are Gaussian, so that to first order place and heading are,

    cov p(t) = J cov(v, w, s) J^T + noise (t - t0),    J = dp(t) / d(v, w, s)

with p(t) of ``planner``. Its width is what is not known of the movement, what differs from trial to trial, and the
wandering about an even walk. Once a part of the drive has been seen, the tube goes on from there and is narrow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.steering.arcs import travel
from vvvaltr.transfer.steering.belief import WANDER_M, WANDER_RAD
from vvvaltr.transfer.steering.passage import rotation

WIDTH = 6.25  # squared distance, in deviations, of nine out of ten drives (chi squared of 3 numbers)
_SEEN_M, _SEEN_RAD = 0.0005, 0.01  # deviation of a tracked pose
_DELAY_S = 0.2  # by how much the start's delay differs from drive to drive


@dataclass(frozen=True, slots=True)
class Tube:
    """The expected course of a drive, and how far from it a drive may be.

    Args:
        start: (3,) x, y, yaw at ``from_s``.
        from_s: time in the drive at which it begins.
        delay_s: time after it in which nothing moves yet.
        mean: (5,) forward, left (m/s), turn (rad/s) and the floor's drift in x and y (m/s).
        covariance: (5, 5) of the mean.
    """

    start: Array
    from_s: float
    delay_s: float
    mean: Array
    covariance: Array

    def pose(self, t_s: float) -> Array:
        """Return the expected x, y, yaw at a time in the drive, shape (3,)."""
        return self._reached(self.mean, self._moving_s(t_s))

    def holds(self, pose: Array, t_s: float) -> bool:
        """Whether a pose (3,) at a time in the drive is inside."""
        return self.distance(pose, t_s) <= WIDTH

    def distance(self, pose: Array, t_s: float) -> float:
        """Return the squared distance of a pose (3,) from the expected one, in deviations."""
        moving_s = self._moving_s(t_s)
        away = pose - self._reached(self.mean, moving_s)
        away[2] = (away[2] + np.pi) % (2.0 * np.pi) - np.pi
        jacobian = self._jacobian(moving_s)
        noise = np.diag([WANDER_M**2, WANDER_M**2, WANDER_RAD**2]) * moving_s
        noise += np.diag([_SEEN_M**2, _SEEN_M**2, _SEEN_RAD**2])
        if self.delay_s > 0.0:
            early = _DELAY_S * self._reached(self.mean, 1.0) - _DELAY_S * self.start
            noise += np.outer(early, early)
        return float(away @ np.linalg.solve(jacobian @ self.covariance @ jacobian.T + noise, away))

    def _moving_s(self, t_s: float) -> float:
        return max(t_s - self.from_s - self.delay_s, 0.0)

    def _reached(self, mean: Array, moving_s: float) -> Array:
        moved_m, turn_rad = travel(mean[:3], np.array(moving_s))
        place_m = self.start[:2] + rotation(float(self.start[2])) @ moved_m + mean[3:] * moving_s
        return np.append(place_m, self.start[2] + turn_rad)

    def _jacobian(self, moving_s: float) -> Array:
        steps = 1e-5 * np.eye(5)
        sides = [
            (self._reached(self.mean + step, moving_s), self._reached(self.mean - step, moving_s)) for step in steps
        ]
        return np.stack([(ahead - behind) / 2e-5 for ahead, behind in sides], axis=1)
