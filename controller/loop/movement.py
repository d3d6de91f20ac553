"""From a trial to how the robot moved, in its own frame, and to what its motors applied."""

from __future__ import annotations

import math
from itertools import pairwise

from vvvaltr.controller.core.records import AppliedFrequencies, Displacement, Fit, LoggedTrial, Movement, Piece
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import Pose, Recommendation, Suggestion, Trial

NO_HEADING = "the tracker tells no heading: give it a body with one (docs/trackers.md), and look at it by vvvaltr track"
"""Why a robot cannot be steered."""

_ENOUGH_POSES, _MOVED_M = 20, 0.003


def complete_record(
    suggestion: Suggestion,
    trial: Trial,
    score_m_s: float | None = None,
    recommendation: Recommendation | None = None,
    fit: Fit | None = None,
) -> LoggedTrial:
    """Return a trial for the log, with what its poses and states tell."""
    movement, applied = measure_movement(trial), measure_applied(trial)
    pieces = measure_pieces(trial)
    return LoggedTrial(suggestion, trial, score_m_s, recommendation, movement, applied, fit=fit, pieces=pieces)


def lacks_heading(trial: Trial) -> bool:
    """Return whether a robot moved with the same heading to the last digit, as where a tracker tells none."""
    poses = trial.poses
    if len(poses) < _ENOUGH_POSES or len({pose.yaw_rad for pose in poses}) > 1:
        return False
    return max(math.dist(pose.position_m, poses[0].position_m) for pose in poses) > _MOVED_M


def measure_movement(trial: Trial) -> Movement | None:
    """Return how the robot moved from where it lay to where it came to rest.

    None where that was not measured, or a pose is not a number. Where the trial has no resting poses, its first and
    last pose stand for them. The turn is the sum of the changes from pose to pose, so it may exceed half a turn;
    between two poses the robot must turn by less than that.
    """
    ends = resting_ends(trial)
    if ends is None or not all(pose.is_finite for pose in trial.poses):
        return None
    start, end = ends
    yaws_rad = [start.yaw_rad, *(pose.yaw_rad for pose in trial.poses), end.yaw_rad]
    turn_rad = sum(math.remainder(after - before, math.tau) for before, after in pairwise(yaws_rad))
    return Movement(start, end, _displacement(start, end, turn_rad))


def resting_ends(trial: Trial) -> tuple[RestingPose, RestingPose] | None:
    """Return where the robot lay before and after the drive; None where the poses do not tell."""
    poses = trial.poses
    start, end = trial.start, trial.end
    if start is None and len(poses) > 1 and poses[0].is_finite:
        start = _rest(poses[0])
    if end is None and len(poses) > 1 and poses[-1].is_finite:
        end = _rest(poses[-1])
    return None if start is None or end is None else (start, end)


def measure_pieces(trial: Trial) -> tuple[Piece, ...]:
    """Return the drive in pieces of about a second; none where the trial failed, or its poses do not make two."""
    from vvvaltr.transfer.causes.pieces import cut  # here, so that the command line's help need not wait for numpy

    return cut(trial.poses) if trial.outcome.is_valid else ()


def measure_applied(trial: Trial) -> AppliedFrequencies | None:
    """Return the mean of what the motors applied over the drive, ramp included; None where they did not tell."""
    told = [state.frequency_hz for state in trial.states]
    if not told or len(set(map(len, told))) > 1 or not all(math.isfinite(hz) for each in told for hz in each):
        return None
    mean_hz = tuple(math.fsum(motor) / len(told) for motor in zip(*told, strict=True))
    return AppliedFrequencies(mean_hz, all(state.measured for state in trial.states))


def _rest(pose: Pose) -> RestingPose:
    return RestingPose(pose.position_m, pose.yaw_rad, pose.pitch_rad, pose.roll_rad)


def _displacement(start: RestingPose, end: RestingPose, turn_rad: float) -> Displacement:
    x_m, y_m = (end.position_m[axis] - start.position_m[axis] for axis in (0, 1))
    cos_yaw, sin_yaw = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
    return Displacement(cos_yaw * x_m + sin_yaw * y_m, cos_yaw * y_m - sin_yaw * x_m, turn_rad)
