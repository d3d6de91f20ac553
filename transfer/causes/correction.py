"""What a run's trials would have measured on a level floor, at today's strength.

A trial's own score stays what it is. Before a model sees the scores, they are freed of what is not the gait's: the
floor's part of the velocity is taken off, the rest is brought to the strength of the last trial, and where sensors tell
what the motors applied, the trial counts at the gait that would apply it. A trial in which the gait stood still counts
like any other: a gait that moves from one start and not from another is as fast as the mean of both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import Told
from vvvaltr.transfer.causes.floor import Drift, DriftLearner
from vvvaltr.transfer.causes.pieces import weigh
from vvvaltr.transfer.causes.standing import find_standing
from vvvaltr.transfer.causes.strength import StrengthLearner

RATIO_TRIALS = 60
"""Number of trials that tell what a motor applies of its command; later ones do not change it."""

LATE = 40
"""The floor is learned anew after each trial of the first 80, and then once there is a fortieth of them more. Until
then the floor's mean drift is taken off the last trials."""

STRENGTH, FLOOR_PROBABILITY = "strength", "floor_probability"
FLOOR_X, FLOOR_Y, FLOOR_SD = "floor_x_m_s", "floor_y_m_s", "floor_sd_m_s"
CAUSES = (STRENGTH, FLOOR_X, FLOOR_Y, FLOOR_SD, FLOOR_PROBABILITY)
"""Names of what was found, among the hyperparameters of a log: the robot's strength after the last trial over that in
the first, the floor's drift at the mean sum of squared frequencies, its standard deviation, and the probability that
there is any."""

_LEAST_HZ = 2.0  # below which the share that a motor applies says nothing
_FARTHEST = 0.3  # share by which a motor may miss: more is a fault, or a sensor that lies


@dataclass(frozen=True, slots=True)
class Corrected:
    """Trials as a model is to see them.

    Args:
        gaits: each one's gait: the commands that make the motors apply what they applied.
        scores: at today's strength, on a level floor, (n,).
        strengths: strength of the robot in each trial over that in the first, (n,).
        drift: of the floor; None where nothing tells it.
    """

    gaits: tuple[Gait, ...]
    scores: Array
    strengths: Array
    drift: Drift | None

    @property
    def names(self) -> dict[str, float]:
        """What was found, by name, for log and screen; empty where nothing was corrected."""
        found = {} if (self.strengths == 1.0).all() else {STRENGTH: float(self.strengths[-1])}
        if self.drift is not None:
            x_m_s, y_m_s = self.drift.velocity_m_s.tolist()
            found |= {FLOOR_X: x_m_s, FLOOR_Y: y_m_s, FLOOR_SD: self.drift.deviation_m_s}
            found |= {FLOOR_PROBABILITY: self.drift.is_inclined}
        return {name: float(number) for name, number in found.items()}


@dataclass(frozen=True, slots=True)
class _Floor:
    """What was learned of the floor: the scores of the trials that it was learned from without it, and its drift."""

    scores: Array
    drift: Drift | None


class Corrector:
    """Corrects the trials of one run, again after each. It keeps what it computed; the results do not depend on it.

    Whoever corrects again may add trials, or leave out the last ones, but must not change the earlier ones.

    Args:
        span_hz: width of the range of frequencies, over which gaits are alike or not.
    """

    def __init__(self, span_hz: float) -> None:
        self._span_hz = span_hz
        self._drifts = DriftLearner()
        self._strengths = StrengthLearner()
        self._gaits = _Applied()
        self._floor: _Floor | None = None  # as last learned

    def correct(self, history: Sequence[Told]) -> Corrected:
        """Return the trials told so far, freed of what is not their gaits'; those without evidence as they are."""
        scores = np.array([told.score for told in history], dtype=float)
        strengths, drift = np.ones(len(history)), None
        known = [i for i, told in enumerate(history) if told.evidence is not None]
        if known:
            of = [history[i] for i in known]
            # From the scores as they are: what is settled of a long run's strength must not change with the drift.
            strengths[known] = self._follow_strength(of, scores[known])
            scores[known], drift = self._take_off_floor(of, scores[known])
            scores[known] *= strengths[known[-1]] / strengths[known]
        return Corrected(self._gaits.find(history), scores, strengths, drift)

    def _take_off_floor(self, trials: Sequence[Told], scores: Array) -> tuple[Array, Drift | None]:
        """Return the scores without what the floor added, and the drift, of which the last trials may not tell yet."""
        count = _count_settled(len(trials))
        if self._floor is None or len(self._floor.scores) != count:
            self._floor = self._learn_floor(trials[:count], scores[:count])
        drift, level = self._floor.drift, scores.copy()
        level[:count] = self._floor.scores
        if drift is not None and count < len(trials):
            stood = _find_standing(trials)
            for i in range(count, len(trials)):
                if _tells_floor(trials[i]) and not stood[i]:
                    level[i] = _without(trials[i], drift.during(weigh(trials[i].gait.frequency_hz), 1.0).tolist())
        return level, drift

    def _learn_floor(self, trials: Sequence[Told], scores: Array) -> _Floor:
        stood = _find_standing(trials)
        cut = [i for i, told in enumerate(trials) if _tells_floor(told) and not stood[i]]
        weights = [weigh(trials[i].gait.frequency_hz) for i in cut]
        pieces = [trials[i].evidence.pieces for i in cut]  # type: ignore[union-attr]
        drift = self._drifts.learn([trials[i].gait for i in cut], pieces, weights)
        level = scores.copy()
        if drift is not None:
            for i, added_m_s in zip(cut, drift.of_trials_m_s.tolist(), strict=True):
                level[i] = _without(trials[i], added_m_s)
        return _Floor(level, drift)

    def _follow_strength(self, trials: Sequence[Told], scores: Array) -> Array:
        places = np.array([told.gait.frequency_hz for told in trials]) / self._span_hz
        return np.asarray(np.exp(self._strengths.follow(places, np.abs(scores))))


def _count_settled(trials: int) -> int:
    """Return the number of the first trials that the floor is learned from."""
    return trials - trials % max(1, trials // LATE)


def _tells_floor(told: Told) -> bool:
    return told.evidence is not None and len(told.evidence.pieces) > 1


def _without(told: Told, added_m_s: Sequence[float]) -> float:
    """Return the score without what the floor added to the velocity."""
    evidence = told.evidence
    if evidence is None or evidence.velocity_m_s is None:
        return told.score
    x_m_s, y_m_s = (one - other for one, other in zip(evidence.velocity_m_s, added_m_s, strict=True))
    if evidence.ahead is None:
        return math.hypot(x_m_s, y_m_s)
    return evidence.ahead[0] * x_m_s + evidence.ahead[1] * y_m_s


def _find_standing(trials: Sequence[Told]) -> Array:
    """Return in which trials, (n,), the robot stood still although its gait moves it."""
    by_gait: dict[Gait, list[int]] = {}
    for i, told in enumerate(trials):
        by_gait.setdefault(told.gait, []).append(i)
    stood = np.zeros(len(trials), dtype=bool)
    for index in by_gait.values():
        if len(index) > 1:
            stood[index] = find_standing([abs(trials[i].score) for i in index])
    return stood


class _Applied:
    """Finds the gait that each trial counts for.

    A motor that applies the share r of what is commanded, in the median of all trials, applied f when f / r was, in
    effect, its command.
    """

    def __init__(self) -> None:
        self._ratios: list[float] = []
        self._gaits: list[Gait] = []

    def find(self, history: Sequence[Told]) -> tuple[Gait, ...]:
        """Return the gaits of the trials so far."""
        ratios = _ratios(history[:RATIO_TRIALS])
        if ratios != self._ratios:
            self._ratios, self._gaits = ratios, []
        self._gaits += [_in_effect(told, ratios) for told in history[len(self._gaits) :]]
        return tuple(self._gaits[: len(history)])


def _ratios(history: Sequence[Told]) -> list[float]:
    """Return what each motor applies of its command; NaN where nothing tells it."""
    if not history:
        return []
    of_motors: list[list[float]] = [[] for _ in history[0].gait.frequency_hz]
    for told in history:
        if told.evidence is None or told.evidence.applied_hz is None:
            continue
        for ratios, hz, applied_hz in zip(of_motors, told.gait.frequency_hz, told.evidence.applied_hz, strict=True):
            if abs(hz) >= _LEAST_HZ:
                ratios.append(applied_hz / hz)
    return [float(np.median(ratios)) if ratios else math.nan for ratios in of_motors]


def _in_effect(told: Told, ratios: Sequence[float]) -> Gait:
    applied_hz = told.evidence.applied_hz if told.evidence else None
    if applied_hz is None:
        return told.gait
    hz = told.gait.frequency_hz
    return Gait(
        tuple(_motor_in_effect(*each) for each in zip(hz, applied_hz, ratios, strict=True)),
        told.gait.phase_rad,
        told.gait.amplitude,
    )


def _motor_in_effect(hz: float, applied_hz: float, ratio: float) -> float:
    if abs(hz) < _LEAST_HZ or not ratio > 0.0:
        return hz
    found_hz = applied_hz / ratio
    return found_hz if abs(found_hz - hz) < _FARTHEST * abs(hz) else hz
