"""From a trial to a number. Every score is a speed in m/s, of the robot's centre along the ground."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from vvvaltr.controller.core.conditions import check_speed
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import Estimate, Trial
from vvvaltr.controller.loop.movement import resting_ends

_RESOLUTION_M = 0.005  # steps of the path; finer ones would count the tracker's noise as movement


def net_speed(trial: Trial) -> float:
    """Return the distance from start to end over the time driven: the score of the published experiments."""
    start, end = _ends(trial)
    return math.dist(start.position_m[:2], end.position_m[:2]) / trial.duration_s


def path_speed(trial: Trial) -> float:
    """Return the length of the path over the time driven; it also credits a robot that goes in circles.

    The path is measured with dividers opened to 5 mm, so that the tracker's noise adds nothing.
    """
    start, end = _ends(trial)
    length_m, corner_m = 0.0, start.position_m[:2]
    for place_m in (pose.position_m[:2] for pose in trial.poses):
        if (step_m := math.dist(corner_m, place_m)) >= _RESOLUTION_M:
            length_m += step_m
            corner_m = place_m
    return (length_m + math.dist(corner_m, end.position_m[:2])) / trial.duration_s


def forward_speed(trial: Trial) -> float:
    """Return the speed in the direction in which the robot was heading at the start; negative is backward."""
    start, end = _ends(trial)
    ahead_m = (end.position_m[0] - start.position_m[0]) * math.cos(start.yaw_rad)
    left_m = (end.position_m[1] - start.position_m[1]) * math.sin(start.yaw_rad)
    return (ahead_m + left_m) / trial.duration_s


@dataclass(frozen=True, slots=True)
class Score:
    """What counts as speed: one line for the user, the function from a valid trial to m/s, and its least value."""

    description: str
    measure: Callable[[Trial], float]
    least_m_s: float = 0.0


SCORES: Mapping[str, Score] = MappingProxyType(
    {
        "net": Score("distance from start to end over the time driven, as in the published experiments", net_speed),
        "path": Score("length of the path over the time driven; it also credits circles", path_speed),
        "forward": Score("speed along the heading at the start; negative is backward", forward_speed, -math.inf),
    }
)


def score(trial: Trial, name: str = "net") -> float:
    """Return the named score of ``trial`` in m/s.

    Raises:
        ValueError: the trial is not valid, or its score cannot be: a failed measurement is not a number.
    """
    if not trial.outcome.is_valid or trial.duration_s <= 0.0:
        raise ValueError(f"trial {trial.number} measured nothing ({trial.outcome}): it has no score")
    speed_m_s = SCORES[name].measure(trial)
    check_speed(speed_m_s, f"trial {trial.number}")
    return speed_m_s


def as_speed(estimate: Estimate, name: str) -> Estimate:
    """Return an estimate of the named score, in m/s, within what the score can be: a net speed is not below 0."""
    least_m_s = SCORES[name].least_m_s
    return Estimate(*(max(least_m_s, it) for it in (estimate.mean, estimate.low, estimate.high)))


def implausibility(trial: Trial) -> str:
    """Return why a trial that seems valid has no score that can be; empty for all others."""
    if not trial.outcome.is_valid:
        return ""
    try:
        for name in SCORES:
            score(trial, name)
    except ValueError as error:
        return str(error)
    return ""


def _ends(trial: Trial) -> tuple[RestingPose, RestingPose]:
    if (ends := resting_ends(trial)) is None:
        raise ValueError(f"trial {trial.number} has no finite poses to score: it measured nothing")
    return ends
