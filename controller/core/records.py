"""What a run consists of, as values: its trials, each with what led to it and what followed.

A field that is None, or empty, was not known: it is never a made-up number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING

from vvvaltr.controller.core.conditions import Conditions, check_finite, check_speed
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.table import make_table
from vvvaltr.controller.core.values import Recommendation, Source, Structure, Suggestion, Trial

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_SURE = 2.0  # standard errors
_NO_NUMBERS: Mapping[str, float] = MappingProxyType({})  # shared by all that have none, as is the next
_UNKNOWN = Conditions()


@dataclass(frozen=True, slots=True)
class Displacement:
    """How far a drive takes the robot, in the frame that the robot has at its start.

    Args:
        forward_m: along the robot's heading at the start.
        left_m: across it, to the left.
        turn_rad: change of heading, counterclockwise positive, unwrapped: a full turn is 2 pi.

    Raises:
        ValueError: a number is not finite.
    """

    forward_m: float
    left_m: float
    turn_rad: float

    def __post_init__(self) -> None:
        check_finite(forward_m=self.forward_m, left_m=self.left_m, turn_rad=self.turn_rad)


@dataclass(frozen=True, slots=True)
class Movement:
    """Where a drive began, where it ended, and the displacement between the two."""

    start: RestingPose
    end: RestingPose
    displacement: Displacement

    @property
    def error_m(self) -> float | None:
        """Standard error of the distance, from those of start and end; None where they are not known."""
        if self.start.position_sd_m is None or self.end.position_sd_m is None:
            return None
        return math.hypot(self.start.position_sd_m, self.end.position_sd_m)

    @property
    def is_within_error(self) -> bool:
        """Whether the distance is below two standard errors, so that the tracker's noise alone may have made it."""
        distance_m = math.hypot(self.displacement.forward_m, self.displacement.left_m)
        return self.error_m is not None and distance_m < _SURE * self.error_m


@dataclass(frozen=True, slots=True)
class AppliedFrequencies:
    """What the motors applied, as means over the drive.

    Args:
        mean_hz: (motors,) signed.
        measured: whether all of them come from sensors; otherwise they are what the output stages were set to.

    Raises:
        ValueError: a number is not finite.
    """

    mean_hz: tuple[float, ...]
    measured: bool

    def __post_init__(self) -> None:
        check_finite(**{f"motor_{motor}_hz": mean_hz for motor, mean_hz in enumerate(self.mean_hz, start=1)})


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of a drive, about a second long: what it takes to tell the robot's own part from the floor's.

    Args:
        duration_s: of the piece.
        moved_m: displacement along the world's x and y.
        heading: means of the cosine and of the sine of the heading.

    Raises:
        ValueError: a number is not finite.
    """

    duration_s: float
    moved_m: tuple[float, float]
    heading: tuple[float, float]

    def __post_init__(self) -> None:
        check_finite(duration_s=self.duration_s, x_m=self.moved_m[0], y_m=self.moved_m[1])
        check_finite(cos_yaw=self.heading[0], sin_yaw=self.heading[1])


class Verdict(StrEnum):
    """What the operator decides about a trial."""

    KEEP = "keep"
    REPEAT = "repeat"
    DISCARD = "discard"
    SKIP = "skip"  # the gait was not driven


@dataclass(frozen=True, slots=True)
class Review:
    """What the operator and the checks of plausibility say of a trial.

    Args:
        notes: the operator's, free text.
        verdict: the operator's; None where nobody was asked.
        verdict_reason: why, free text.
        is_suspect: whether a check found the trial implausible although it measured something.
        suspicion: what the check found.
    """

    notes: str = ""
    verdict: Verdict | None = None
    verdict_reason: str = ""
    is_suspect: bool = False
    suspicion: str = ""


_PLAIN = Review()


@dataclass(frozen=True, slots=True)
class Fit:
    """The surrogate after a trial, so that a resumed run need not repeat the fits.

    Args:
        hyperparameters: by name.
        is_new: whether this trial led to a new fit; otherwise the values are those of the fit before.

    Raises:
        ValueError: a number is not finite.
    """

    hyperparameters: Mapping[str, float]
    is_new: bool

    def __post_init__(self) -> None:
        for name, value in self.hyperparameters.items():
            check_finite(**{name: value})


@dataclass(frozen=True, slots=True)
class Told:
    """What an optimiser was told of one trial.

    Args:
        gait: the gait that was asked for.
        score: of the trial alone, not corrected for anything.
        fit: the fit that the optimiser made after it; None where that is not known.
        evidence: what else the trial shows; None where the optimiser is to take the score as it is.
    """

    gait: Gait
    score: float
    fit: Fit | None = None
    evidence: Evidence | None = None


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a trial shows beside its score, from which a model tells the causes of scatter.

    Args:
        velocity_m_s: displacement over the time driven, along the world's x and y; None where the score is none of it.
        ahead: cosine and sine of the heading along which the score is measured; None where it is the length of
            ``velocity_m_s``.
        pieces: the drive in pieces; empty where the poses do not tell.
        applied_hz: what sensors say that the motors turned at, as means over the drive; None where nothing measured it.
    """

    velocity_m_s: tuple[float, float] | None = None
    ahead: tuple[float, float] | None = None
    pieces: tuple[Piece, ...] = ()
    applied_hz: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class SteeringStep:
    """Why a gait was driven while steering to a goal.

    Args:
        goal_m: x, y of the goal in the world's frame.
        goal_yaw_rad: heading at the goal; None where any heading will do.
        predicted: what this gait was expected to do.
        position_sd_m, turn_sd_rad: standard deviations of the prediction; None where they are not known.
        plan: the gaits that were planned up to the goal, this one first.

    Raises:
        ValueError: a number is not finite.
    """

    goal_m: tuple[float, float]
    goal_yaw_rad: float | None
    predicted: Displacement
    position_sd_m: float | None = None
    turn_sd_rad: float | None = None
    plan: tuple[Gait, ...] = ()

    def __post_init__(self) -> None:
        check_finite(x_m=self.goal_m[0], y_m=self.goal_m[1], goal_yaw_rad=self.goal_yaw_rad)
        check_finite(position_sd_m=self.position_sd_m, turn_sd_rad=self.turn_sd_rad)


@dataclass(frozen=True, slots=True)
class LoggedTrial:
    """A trial with what led to it and what followed.

    Args:
        suggestion: why this gait.
        trial: what happened.
        score: in m/s; None where the trial measured nothing.
        recommendation: the best gait known after it; None while there is no model.
        movement: how the robot moved; None where its poses do not tell.
        applied: what the motors applied; None where they did not tell.
        review: what the operator and the checks of plausibility say.
        fit: the surrogate after the trial; None where the optimiser does not tell.
        steering: goal and prediction, for a drive of steering.
        pieces: the drive in pieces of about a second; empty where the poses do not tell.

    Raises:
        ValueError: the score is a speed that no robot has.
    """

    suggestion: Suggestion
    trial: Trial
    score: float | None
    recommendation: Recommendation | None
    movement: Movement | None = None
    applied: AppliedFrequencies | None = None
    review: Review = field(default_factory=Review)
    fit: Fit | None = None
    steering: SteeringStep | None = None
    pieces: tuple[Piece, ...] = ()

    def __post_init__(self) -> None:
        if self.score is not None:
            check_speed(self.score, f"score_m_s of trial {self.trial.number}")

    def without_recordings(self) -> LoggedTrial:
        """Return the trial without what was recorded during the drive, which is all but a few hundred bytes of it."""
        if not any((self.trial.poses, self.trial.commands, self.trial.states, self.trial.photos)):
            return self
        return replace(self, trial=replace(self.trial, poses=(), commands=(), states=(), photos=()))

    def in_brief(self) -> LoggedTrial:
        """Return gait, outcome, score and review alone: what later trials of a run need to know of an earlier one."""
        asked, made = self.suggestion, self.trial
        suggestion = Suggestion(asked.gait, asked.origin, None, _NO_NUMBERS, asked.phase)
        ended = (made.number, made.gait, made.outcome, made.reason, made.started_unix_s, made.duration_s)
        trial = Trial(*ended, conditions=_UNKNOWN)
        return LoggedTrial(suggestion, trial, self.score, None, review=_PLAIN if self.review == _PLAIN else self.review)


class EventKind(StrEnum):
    """What can happen to a run beside its trials."""

    BEGIN = "begin"  # the run begins, or goes on
    WAITING = "waiting"  # for the operator: the text says what for
    WARNING = "warning"  # something needs attention, and the run goes on
    END = "end"  # the run is complete, or was ended: the text says by what


@dataclass(frozen=True, slots=True)
class Event:
    """What happened to a run beside its trials, in one line of text."""

    kind: EventKind
    text: str


@dataclass(frozen=True, slots=True)
class Run:
    """What a log holds: how the robot is built, what the run learns from, and its complete trials in order.

    ``about`` says what made the log: ``version`` of vvvaltr, ``robot``, ``seed`` and ``date``, as far as it is known.
    """

    structure: Structure | None = None
    sources: tuple[Source, ...] = ()
    trials: tuple[LoggedTrial, ...] = ()
    about: Mapping[str, str] = field(default_factory=dict)

    def table(self) -> NDArray[np.void]:
        """Return the trials as a numpy structured array, one row a trial; docs/log.md lists the columns.

        What is not known is NaN, or an empty text. ``pandas.DataFrame(run.table())`` takes it as it is.
        """
        return make_table(self.trials)
