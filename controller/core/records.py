"""What a run consists of, as values: its trials, each with what led to it and what followed."""

from __future__ import annotations

from dataclasses import dataclass

from vvvaltr.controller.core.values import Recommendation, Source, Structure, Suggestion, Trial


@dataclass(frozen=True, slots=True)
class LoggedTrial:
    """A trial with what led to it and what followed.

    Args:
        suggestion: why this gait.
        trial: what happened.
        score: in m/s; None where the trial measured nothing.
        recommendation: the best gait known after it; None while there is no model.
    """

    suggestion: Suggestion
    trial: Trial
    score: float | None
    recommendation: Recommendation | None


@dataclass(frozen=True, slots=True)
class Run:
    """What a log holds: how the robot is built, what the run learns from, and its complete trials in order."""

    structure: Structure | None = None
    sources: tuple[Source, ...] = ()
    trials: tuple[LoggedTrial, ...] = ()
