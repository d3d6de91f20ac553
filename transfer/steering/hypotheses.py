"""What a repertoire from elsewhere is worth here, and what it is worth after a change on the way.

Three hypotheses are weighed by what they foretell of each driven gait: that nothing has changed, that the floor is
another one, that the body is. Each says how the movements now come from those before the change,

    v_i = c v0_i + own_i,    w_i = a w0_i + own_i

with a complex factor c common to all movements (strength, and a turn of the robot's frame), a factor a of the turns,
and a correction of each movement of its own; further how strong the floor's drift may be. Each has a filter of its own.
From one primitive to the next a change may occur: then a filter begins again from what the best one believes [1].

[1] H. Blom, Y. Bar-Shalom, The interacting multiple model algorithm, IEEE Transactions on Automatic Control 33 (1988),
    here with the most probable past in place of the mixture of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.steering.belief import FLOOR_TURN, Belief
from vvvaltr.transfer.steering.passage import Passage
from vvvaltr.transfer.steering.repertoire import Repertoire

_CHANGE = 0.02  # probability that from one primitive to the next another hypothesis becomes the right one


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """How things here differ from where the repertoire was learned; shares are of the movements' usual size.

    Args:
        name: in one word.
        weight: its probability before anything is seen.
        factor: what is left of the old movements.
        common: standard deviation of the common factors.
        own: standard deviation of each movement's own correction.
        drift: of the floor's drift.
        unrest: of each movement's change from one primitive to the next.
        drift_unrest: of the drift's change.
    """

    name: str
    weight: float
    factor: float
    common: float
    own: float
    drift: float
    unrest: float
    drift_unrest: float

    def changed(self, belief: Belief, size: Array) -> Belief:
        """Return what is believed once the change has occurred; ``size`` is that of ``usual_size``."""
        v = belief.movements
        common = np.zeros((3, len(v), 5))
        common[0, :, :2], common[1, :, :2] = v[:, :2], np.stack([-v[:, 1], v[:, 0]], axis=1)
        common[2, :, 2] = v[:, 2]
        directions = common.reshape(3, -1) * self.common
        covariance = self.factor**2 * belief.covariance
        own = _numbers(self.own * size, FLOOR_TURN * size[2])
        covariance[:-2, :-2] += directions.T @ directions + np.diag(np.tile(own**2, len(v)))
        covariance[-2:, :-2] = covariance[:-2, -2:] = 0.0
        covariance[-2:, -2:] = belief.covariance[-2:, -2:] + (self.drift * size[0]) ** 2 * np.eye(2)
        mean = np.append(self.factor * belief.mean[:-2], belief.mean[-2:])
        return replace(belief, mean=mean, covariance=covariance)

    def aged(self, belief: Belief, size: Array) -> Belief:
        """Return what is believed one primitive later."""
        numbers = _numbers(self.unrest * size, self.drift_unrest * FLOOR_TURN * size[2])
        return belief.aged(numbers, self.drift_unrest * size[0])


def _numbers(velocity: Array, floor_rad_s: float) -> Array:
    """Return the standard deviations of a movement's numbers, shape (5,)."""
    return np.append(velocity, [floor_rad_s, floor_rad_s])


HYPOTHESES = (
    Hypothesis("alike", 0.5, factor=1.0, common=0.1, own=0.05, drift=0.15, unrest=0.02, drift_unrest=0.02),
    Hypothesis("floor", 0.3, factor=1.0, common=0.3, own=0.25, drift=1.0, unrest=0.03, drift_unrest=0.15),
    Hypothesis("body", 0.2, factor=0.3, common=0.6, own=0.9, drift=0.5, unrest=0.05, drift_unrest=0.1),
)
_UNCHANGED = 0  # of them, the one by which nothing happens on the way


def usual_size(velocities: Array) -> Array:
    """Return the usual size of forward, left (m/s, alike) and turn (rad/s), shape (3,)."""
    along = np.sqrt(np.mean(velocities[:, :2] ** 2)) if len(velocities) else 0.0
    turn = np.sqrt(np.mean(velocities[:, 2] ** 2)) if len(velocities) else 0.0
    return np.maximum([along, along, turn], [1e-4, 1e-4, 1e-3])


class Knowledge:
    """What is believed of movements and floor, updated by every driven primitive."""

    def __init__(self, repertoire: Repertoire, hypotheses: Sequence[Hypothesis] = HYPOTHESES) -> None:
        self._hypotheses = tuple(hypotheses)
        self._prior = np.array([hypothesis.weight for hypothesis in hypotheses]) / sum(h.weight for h in hypotheses)
        self._size = usual_size(repertoire.velocities)
        self.beliefs = [hypothesis.changed(repertoire.belief(), self._size) for hypothesis in hypotheses]
        self.weights = self._prior.copy()

    @property
    def likely(self) -> Belief:
        """What the most probable hypothesis believes."""
        return self.beliefs[int(np.argmax(self.weights))]

    @property
    def likely_name(self) -> str:
        """The most probable hypothesis."""
        return self._hypotheses[int(np.argmax(self.weights))].name

    def observe(self, movement: int, seen: Passage) -> None:
        """Learn from a driven primitive."""
        best = int(np.argmax(self.weights))
        stays, comes = (1.0 - _CHANGE) * self.weights, _CHANGE * self._prior * self.weights[best]
        log_weights = np.log(stays + comes)
        begun = self.beliefs[best]
        for index, hypothesis in enumerate(self._hypotheses):
            belief = self.beliefs[index]
            if index != best and comes[index] > stays[index]:
                belief = begun if index == _UNCHANGED else hypothesis.changed(begun, self._size)
            aged = hypothesis.aged(belief, self._size)
            self.beliefs[index], log_density = aged.observed(movement, seen, self._size)
            log_weights[index] += log_density
        weights = np.exp(log_weights - log_weights.max())
        self.weights = weights / weights.sum()

    def draw(self, random: np.random.Generator) -> Belief:
        """Return one of the beliefs, drawn by its weight."""
        return self.beliefs[int(random.choice(len(self.beliefs), p=self.weights))]
