"""What is believed of all movements and of the floor's drift together, and how a driven gait changes it.

A movement is a velocity in the robot's own frame: forward, left (m/s) and turn (rad/s). While a gait is driven the
centre of the robot moves by

    dp/dt = R(yaw) (v_i + e) + q_i s,    d yaw/dt = w_i + e_w + a_i cos yaw + b_i sin yaw

with v_i, w_i of the gait, s the floor's drift, the same for all gaits, and e what differs from trial to trial but stays
within one. The more the motors shake the robot, the more the floor carries it off: q_i is the drive, the sum of the
gait's squared frequencies, over the usual one. On an inclined floor the turning depends on the heading, in each gait
in its own way: a_i and b_i. All of it is linear in (v, w, a, b, s): the posterior is a Gaussian, and its update that of
a Kalman filter [1]. The turning within a trial tells v from s.

[1] S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, MIT Press 2005, section 3.2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.transfer.steering.passage import Passage

WANDER_M = 0.0015  # of the path about an even walk, after a second
WANDER_RAD = 0.03
_DRIFT_SHARE = 0.35  # by which the drift of one gait differs from what its drive lets expect
FLOOR_TURN = 0.3  # of the usual turn, that a floor adds which carries the robot off at its usual speed
_TAIL = 4.0  # degrees of freedom of Student's t
_BAD = 0.06  # share of bad trials


@dataclass(frozen=True, slots=True)
class Belief:
    """A Gaussian over n movements and the floor's drift.

    Args:
        mean: (5 n + 2,) forward, left, turn of each movement, and how its turn changes with cosine and sine of the
            heading; after them the drift's x and y.
        covariance: (5 n + 2, 5 n + 2).
        scatter: (n, 3) standard deviation from trial to trial of forward, left and turn.
        drive: (n,) of each movement over the usual one, by which the floor's drift carries it.
    """

    mean: Array
    covariance: Array
    scatter: Array
    drive: Array

    @property
    def movements(self) -> Array:
        """Means of forward, left (m/s) and turn (rad/s), shape (n, 3)."""
        return self.mean[:-2].reshape(-1, 5)[:, :3]

    @property
    def floor(self) -> Array:
        """Means of what the floor adds to each movement, shape (n, 4).

        The turn with the cosine and with the sine of the heading (rad/s), and the drift's x and y (m/s).
        """
        turns = self.mean[:-2].reshape(-1, 5)[:, 3:]
        return np.concatenate([turns, self.drive[:, None] * self.drift_m_s], axis=1)

    @property
    def deviations(self) -> Array:
        """Standard deviations of the movements' means, shape (n, 3)."""
        return np.sqrt(np.diag(self.covariance)[:-2].reshape(-1, 5)[:, :3])

    @property
    def drift_m_s(self) -> Array:
        """Mean of the floor's drift, shape (2,)."""
        return self.mean[-2:]

    def first(self, count: int) -> Belief:
        """Return the belief of the first movements alone, and of the drift."""
        kept = np.append(np.arange(5 * count), [-2, -1])
        return Belief(self.mean[kept], self.covariance[np.ix_(kept, kept)], self.scatter[:count], self.drive[:count])

    def extended(self, other: Belief) -> Belief:
        """Return another belief with what this one says of its first movements and of the drift."""
        kept = np.append(np.arange(5 * len(self.drive)), [-2, -1])
        mean, covariance = other.mean.copy(), other.covariance.copy()
        mean[kept], covariance[np.ix_(kept, kept)] = self.mean, self.covariance
        return replace(other, mean=mean, covariance=covariance)

    def aged(self, numbers: Array, drift_m_s: float) -> Belief:
        """Return the belief after things may have changed.

        Args:
            numbers: (5,) standard deviations of the change of each movement's numbers.
            drift_m_s: of the drift's.
        """
        added = np.append(np.tile(numbers, len(self.drive)), [drift_m_s, drift_m_s])
        return replace(self, covariance=self.covariance + np.diag(added**2))

    def on_new_floor(self, drift_m_s: float, turn_rad_s: float) -> Belief:
        """Return the belief on a floor of which only the usual size is known, of its drift and of the turns it adds."""
        n = len(self.drive)
        places = np.append(np.arange(5 * n).reshape(n, 5)[:, 3:].ravel(), [5 * n, 5 * n + 1])
        mean, covariance = self.mean.copy(), self.covariance.copy()
        mean[places] = 0.0
        covariance[places, :] = covariance[:, places] = 0.0
        covariance[places, places] = np.append(np.full(2 * n, turn_rad_s**2), np.full(2, drift_m_s**2))
        return replace(self, mean=mean, covariance=covariance)

    def observed(self, movement: int, seen: Passage, usual: Array | None = None) -> tuple[Belief, float]:
        """Return the belief after a driven gait, and the logarithm of how probable what was seen had been.

        What is improbable counts less, as with noise of Student's distribution.

        Args:
            movement: which gait, counted from 0.
            seen: what it did.
            usual: usual size of forward, left and turn, shape (3,). With it a trial may be a bad one, in which a motor
                did not turn or somebody touched the robot: it may do anything of this size, and teaches nothing.
        """
        index = self._index(movement)
        h, y, noise = _linear(seen, float(self.drive[movement]))
        within = h[:, :3] * self.scatter[movement]
        drift = h[:, 5:] * _DRIFT_SHARE * float(np.hypot(*self.drift_m_s))
        noise = noise + drift @ drift.T
        error = y - h @ self.mean[index]
        prior = h @ self.covariance[np.ix_(index, index)] @ h.T
        expected = prior + noise + within @ within.T
        surprise = float(error @ np.linalg.solve(expected, error))
        log_density = math.log(1.0 - _BAD) + _log_student(surprise, expected)
        if usual is not None:
            anything = h[:, :3] * usual
            of_bad = noise + anything @ anything.T
            away = y - h[:, 5:] @ self.drift_m_s
            log_bad = math.log(_BAD) + _log_student(float(away @ np.linalg.solve(of_bad, away)), of_bad)
            if log_bad > log_density:
                return self, log_bad
        # Only the excess over what is usual for so many numbers is taken for an outlier.
        excess = max(1.0, (_TAIL + surprise) / (_TAIL + 2.0 * len(y)))
        gain = np.linalg.solve(prior + excess * (expected - prior), h @ self.covariance[index]).T
        covariance = gain @ (h @ self.covariance[index])
        np.subtract(self.covariance, covariance, out=covariance)  # in place: of many movements it is large
        covariance = covariance + covariance.T
        covariance *= 0.5
        return replace(self, mean=self.mean + gain @ error, covariance=covariance), log_density

    def underway(self, movement: int, seen: Passage | None) -> tuple[Array, Array]:
        """Return what is known of the trial that is being driven, with what has been seen of it.

        Returns:
            mean: (7,) its velocity, and what the floor adds to it as in ``floor``.
            covariance: (7, 7).
        """
        index = self._index(movement)
        mean = self.mean[index]
        covariance = self.covariance[np.ix_(index, index)] + np.diag([*self.scatter[movement] ** 2, *np.zeros(4)])
        acting = np.append(np.ones(5), [self.drive[movement], self.drive[movement]])
        mean, covariance = acting * mean, acting[:, None] * covariance * acting
        if seen is not None:
            h, y, noise = _linear(seen, 1.0)
            gain = np.linalg.solve(h @ covariance @ h.T + noise, h @ covariance).T
            mean, covariance = mean + gain @ (y - h @ mean), covariance - gain @ h @ covariance
        return mean, covariance

    def around(self, movement: int, width: Array) -> Array:
        """Return the covariance (5, 5) of a velocity of some width (3,) and of the drift that is put on it."""
        drift = _DRIFT_SHARE * float(self.drive[movement] * np.hypot(*self.drift_m_s))
        return np.diag(np.append(width, [drift, drift]) ** 2)

    def drawn(self, random: np.random.Generator) -> tuple[Array, Array]:
        """Return movements (n, 3) and drift (2,) drawn from the belief: Thompson sampling tries what may be good."""
        numbers = random.multivariate_normal(self.mean, self.covariance, method="cholesky", check_valid="ignore")
        return numbers[:-2].reshape(-1, 5)[:, :3], numbers[-2:]

    def _index(self, movement: int) -> Array:
        n = len(self.mean)
        return np.append(5 * movement + np.arange(5), [n - 2, n - 1])


def facing(yaw_rad: float) -> Array:
    """Return what makes velocity and drift (5,) at a heading of a velocity and what the floor adds to it (7,)."""
    made = np.zeros((5, 7))
    made[[0, 1, 2, 3, 4], [0, 1, 2, 5, 6]] = 1.0
    made[2, 3:5] = math.cos(yaw_rad), math.sin(yaw_rad)
    return made


def drives(gaits: Sequence[Gait]) -> Array:
    """Return the sum of each gait's squared frequencies over their mean, shape (n,)."""
    squares = np.array([sum(hz**2 for hz in gait.frequency_hz) for gait in gaits])
    return squares / squares.mean() if squares.any() else np.ones(len(squares))


def _linear(seen: Passage, drive: float) -> tuple[Array, Array, Array]:
    """Return h, y and the noise's covariance of y = h (velocity, turn with cosine and sine, drift) + noise."""
    pieces = len(seen.duration_s)
    h = np.zeros((2 * pieces + 1, 7))
    h[:-1, :2] = (seen.duration_s[:, None, None] * seen.rotation).reshape(-1, 2)
    h[:-1, 5] = drive * np.repeat(seen.duration_s, 2) * np.tile([1.0, 0.0], pieces)
    h[:-1, 6] = drive * np.repeat(seen.duration_s, 2) * np.tile([0.0, 1.0], pieces)
    h[-1, 2:5] = seen.total_s, *(seen.duration_s @ seen.rotation[:, :, 0])
    y = np.append(seen.moved_m.ravel(), seen.turned_rad)
    variances = np.append(WANDER_M**2 * np.repeat(seen.duration_s, 2), WANDER_RAD**2 * seen.total_s)
    return h, y, np.diag(variances)


def _log_student(surprise: float, expected: Array) -> float:
    """Return the logarithm of the density of Student's t of the covariance's shape."""
    size = len(expected)
    of_size = math.lgamma(0.5 * (_TAIL + size)) - math.lgamma(0.5 * _TAIL) - 0.5 * size * math.log(math.pi * _TAIL)
    tail = 0.5 * (_TAIL + size) * math.log1p(surprise / _TAIL)
    return of_size - 0.5 * float(np.linalg.slogdet(expected)[1]) - tail
