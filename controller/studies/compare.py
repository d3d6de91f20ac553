"""Two gaits or more, in turns, until one is better."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Outcome, Phase, Suggestion
from vvvaltr.controller.loop.one_trial import make_trial
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.transfer.causes.evidence import difference, find_best
from vvvaltr.transfer.causes.standing import describe_standing

_FAILURES_IN_A_ROW = 3  # after which somebody has to look at the robot


@dataclass(frozen=True, slots=True)
class Contest:
    """What to compare, and how long.

    Args:
        gaits: two or more, all different.
        trials: greatest number of valid trials.
        confidence: that no other than the best gait is named.
        score_name: what counts as speed.
        seed: of the order of the gaits within each round.

    Raises:
        ValueError: there are fewer than two gaits, or two are the same, or the trials do not make two rounds.
    """

    gaits: tuple[Gait, ...]
    trials: int = 60
    confidence: float = 0.95
    score_name: str = "net"
    seed: int = 0

    def __post_init__(self) -> None:
        if len(set(self.gaits)) < max(2, len(self.gaits)):
            raise ValueError("compare needs two gaits or more, all different")
        if self.trials < 2 * len(self.gaits):
            raise ValueError(f"--trials {self.trials} is less than two rounds of {len(self.gaits)} gaits")

    def order(self, number: int) -> tuple[int, ...]:
        """Return the gaits of a round as indices, in an order of its own, so that no gait always follows another."""
        return tuple(stream(self.seed, number, "round").permutation(len(self.gaits)).tolist())


@dataclass
class Comparison:
    """What the trials have shown so far."""

    contest: Contest
    scores: list[list[float]] = field(default_factory=list)

    @property
    def best(self) -> int | None:
        """The gait that is better than all others, as an index; None while that is not clear."""
        return find_best(np.array(self.scores), self.contest.confidence) if self.scores else None

    def describe(self) -> dict[str, Any]:
        """Return the result as plain data."""
        table = np.array(self.scores).reshape(-1, len(self.contest.gaits))
        ranking = np.argsort(-table.mean(axis=0)).tolist() if len(table) else []
        best = self.best
        return {
            "better": None if best is None else list(self.contest.gaits[best].frequency_hz),
            "confidence": self.contest.confidence,
            "rounds": len(table),
            "gaits": [self._describe_gait(index, table) for index in ranking],
            "differences": [self._describe_difference(ranking[0], other, table) for other in ranking[1:]],
        }

    def _describe_gait(self, index: int, table: np.ndarray[Any, Any]) -> dict[str, Any]:
        standing = describe_standing(table[:, index].tolist())
        return {
            "gait_hz": list(self.contest.gaits[index].frequency_hz),
            "mean_m_s": float(table[:, index].mean()),
            "trials": standing.trials,
            "stood_still": standing.trials - standing.moving,
            "mean_when_moving_m_s": standing.speed_m_s if standing.moving else None,
        }

    def _describe_difference(self, first: int, other: int, table: np.ndarray[Any, Any]) -> dict[str, Any]:
        confidence = 1.0 - (1.0 - self.contest.confidence) / (len(self.contest.gaits) - 1)
        found = difference((table[:, first] - table[:, other]).tolist(), confidence)
        is_known = np.isfinite(found.low)
        return {
            "gait_hz": list(self.contest.gaits[other].frequency_hz),
            "slower_by_m_s": found.mean,
            "low_m_s": found.low if is_known else None,
            "high_m_s": found.high if is_known else None,
        }


def compare(
    robot: Robot, settings: TrialSettings, comparison: Comparison, record: Callable[[LoggedTrial], None]
) -> Iterator[LoggedTrial]:
    """Drive the gaits in turns, so that drift and place cancel in the differences; yields each trial once recorded.

    It ends when one gait is better than all others with the confidence asked for, or the trials are used up. A trial
    that failed is made again.

    Args:
        robot: with guarded motors.
        settings: how a trial is run.
        comparison: what to compare; it takes up the scores of each whole round.
        record: keeps a trial for good before the next begins.

    Raises:
        KeyboardInterrupt: the operator interrupted a trial; it has been recorded.
        UserError: several trials in a row have failed: the robot needs a hand.
        TrialCrashed: the program failed during a trial; it has been recorded.
    """
    contest, numbers = comparison.contest, iter(range(1, 1_000_000))
    for number in range(1, contest.trials // len(contest.gaits) + 1):
        scores = [0.0] * len(contest.gaits)
        for index in contest.order(number):
            for logged in _try_until_valid(robot, settings, contest, index, numbers, record):
                yield logged
                scores[index] = logged.score or 0.0
        comparison.scores.append(scores)
        if comparison.best is not None:
            return


def _try_until_valid(
    robot: Robot,
    settings: TrialSettings,
    contest: Contest,
    index: int,
    numbers: Iterator[int],
    record: Callable[[LoggedTrial], None],
) -> Iterator[LoggedTrial]:
    suggestion = Suggestion(contest.gaits[index], "comparison", phase=Phase.ASKED)
    for failures in range(1, _FAILURES_IN_A_ROW + 1):
        logged = make_trial(robot, suggestion, settings, next(numbers), record, contest.score_name)
        yield logged
        trial = logged.trial
        if trial.outcome.is_valid:
            return
        if trial.outcome is Outcome.INTERRUPTED:
            raise KeyboardInterrupt(trial.reason)
        if failures == _FAILURES_IN_A_ROW:
            raise UserError(f"{failures} trials in a row failed; the last one: {trial.ending}")
