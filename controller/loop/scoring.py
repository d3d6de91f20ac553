"""From a trial to a number. Every score is a speed in m/s, of the robot's centre along the ground."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from vvvaltr.controller.core.values import Pose, Trial

_RESOLUTION_M = 0.005  # steps of the path; finer ones would count the tracker's noise as movement


def net_speed(trial: Trial) -> float:
    """Return the distance from start to end over the time driven: the score of the published experiments."""
    return _distance_m(trial.poses[0], trial.poses[-1]) / trial.duration_s


def path_speed(trial: Trial) -> float:
    """Return the length of the path over the time driven; it also credits a robot that goes in circles.

    The path is measured with dividers opened to 5 mm, so that the tracker's noise adds nothing.
    """
    length_m, corner = 0.0, trial.poses[0]
    for pose in trial.poses:
        if _distance_m(corner, pose) >= _RESOLUTION_M:
            length_m += _distance_m(corner, pose)
            corner = pose
    return (length_m + _distance_m(corner, trial.poses[-1])) / trial.duration_s


def forward_speed(trial: Trial) -> float:
    """Return the speed in the direction in which the robot was heading at the start; negative is backward."""
    start, end = trial.poses[0], trial.poses[-1]
    ahead_m = (end.position_m[0] - start.position_m[0]) * math.cos(start.yaw_rad)
    left_m = (end.position_m[1] - start.position_m[1]) * math.sin(start.yaw_rad)
    return (ahead_m + left_m) / trial.duration_s


@dataclass(frozen=True, slots=True)
class Score:
    """What counts as speed: one line for the user, and the function from a valid trial to m/s."""

    description: str
    measure: Callable[[Trial], float]


SCORES: Mapping[str, Score] = MappingProxyType(
    {
        "net": Score("distance from start to end over the time driven, as in the published experiments", net_speed),
        "path": Score("length of the path over the time driven; it also credits circles", path_speed),
        "forward": Score("speed along the heading at the start; negative is backward", forward_speed),
    }
)


def score(trial: Trial, name: str = "net") -> float:
    """Return the named score of ``trial`` in m/s.

    Raises:
        ValueError: the trial is not valid: a failed measurement is not a number.
    """
    if not trial.outcome.is_valid or trial.duration_s <= 0.0:
        raise ValueError(f"trial {trial.number} measured nothing ({trial.outcome}): it has no score")
    return SCORES[name].measure(trial)


def _distance_m(one: Pose, other: Pose) -> float:
    return math.hypot(one.position_m[0] - other.position_m[0], one.position_m[1] - other.position_m[1])
