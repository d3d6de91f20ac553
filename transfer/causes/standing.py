"""Trials in which the robot stood still, or nearly, because a motor did not turn: told from the gait's other trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_FAR_BELOW = 0.3  # of what the gait does when it moves
_PRIOR = (0.5, 9.5)  # Beta distribution of the probability of standing still: one trial in twenty


@dataclass(frozen=True, slots=True)
class Standing:
    """How often a gait moves.

    Args:
        trials: number of trials.
        moving: number of those in which the robot moved.
        speed_m_s: mean speed of these; NaN where there is none.
        probability: of standing still in the next trial, the posterior mean.
    """

    trials: int
    moving: int
    speed_m_s: float
    probability: float

    def __str__(self) -> str:
        if self.moving == self.trials:
            return f"moved in all {self.trials} trials"
        return f"moved in {self.moving} of {self.trials} trials, {1000.0 * self.speed_m_s:.1f} mm/s when it did"


def is_far_below(speed_m_s: float, before: Sequence[float]) -> bool:
    """Return whether a trial is far below what the same gait did before: probably a motor stood still.

    Far below is less than 0.3 of the median of those trials that moved.

    Args:
        speed_m_s: speed of the trial.
        before: speeds of the gait's earlier trials.
    """
    moved = [speed for speed, stood in zip(before, find_standing(before), strict=True) if not stood]
    return bool(moved) and 0.0 <= speed_m_s < _FAR_BELOW * float(np.median(moved))


def find_standing(speeds_m_s: Sequence[float], far_below: float = _FAR_BELOW) -> tuple[bool, ...]:
    """Return for each trial of one gait whether the robot stood still in it.

    Those are the trials below 0.3 of the mean of the ones above the widest gap, as a ratio, between neighbouring
    speeds; at most half of them. A gait that never moved never stood out.

    Args:
        speeds_m_s: speeds of the trials.
        far_below: share to take in place of 0.3.
    """
    speeds = np.asarray(speeds_m_s, dtype=float)
    if len(speeds) < 2 or speeds.max() <= 0.0:
        return (False,) * len(speeds)
    ordered = np.maximum(np.sort(speeds), 1e-3 * speeds.max())
    ratios = ordered[1:] / ordered[:-1]
    upper = ordered[int(ratios.argmax()) + 1 :]
    if ratios.max() < 1.0 / far_below or 2 * len(upper) < len(speeds):
        return (False,) * len(speeds)
    return tuple((speeds < far_below * upper.mean()).tolist())


def describe_standing(speeds_m_s: Sequence[float]) -> Standing:
    """Return how often a gait moves, and how fast when it does."""
    stood = find_standing(speeds_m_s)
    moved = [speed for speed, it in zip(speeds_m_s, stood, strict=True) if not it]
    mean = math.fsum(moved) / len(moved) if moved else math.nan
    probability = (_PRIOR[0] + sum(stood)) / (sum(_PRIOR) + len(stood))
    return Standing(len(stood), len(moved), mean, probability)
