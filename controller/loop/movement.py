"""From a trial to how the robot moved, in its own frame, and to what its motors applied."""

from __future__ import annotations

import math
from itertools import pairwise

from vvvaltr.controller.core.records import AppliedFrequencies, Displacement, LoggedTrial, Movement, RestingPose
from vvvaltr.controller.core.values import Pose, Recommendation, Suggestion, Trial


def complete_record(
    suggestion: Suggestion, trial: Trial, score_m_s: float | None = None, recommendation: Recommendation | None = None
) -> LoggedTrial:
    """Return a trial for the log, with what its poses and states tell."""
    return LoggedTrial(suggestion, trial, score_m_s, recommendation, measure_movement(trial), measure_applied(trial))


def measure_movement(trial: Trial) -> Movement | None:
    """Return how the robot moved from its first to its last pose; None for fewer than two, or one that is not a number.

    The turn is the sum of the changes from pose to pose, so it may exceed half a turn; between two poses the robot must
    turn by less than that.
    """
    poses = trial.poses
    if len(poses) < 2 or not all(pose.is_finite for pose in poses):
        return None
    turn_rad = sum(math.remainder(after.yaw_rad - before.yaw_rad, math.tau) for before, after in pairwise(poses))
    return Movement(_rest(poses[0]), _rest(poses[-1]), _displacement(poses[0], poses[-1], turn_rad))


def measure_applied(trial: Trial) -> AppliedFrequencies | None:
    """Return the mean of what the motors applied over the drive, ramp included; None where they did not tell."""
    told = [state.frequency_hz for state in trial.states]
    if not told or len(set(map(len, told))) > 1 or not all(math.isfinite(hz) for each in told for hz in each):
        return None
    mean_hz = tuple(math.fsum(motor) / len(told) for motor in zip(*told, strict=True))
    return AppliedFrequencies(mean_hz, all(state.measured for state in trial.states))


def _rest(pose: Pose) -> RestingPose:
    return RestingPose(pose.position_m, pose.yaw_rad, pose.pitch_rad, pose.roll_rad)


def _displacement(start: Pose, end: Pose, turn_rad: float) -> Displacement:
    x_m, y_m = (end.position_m[axis] - start.position_m[axis] for axis in (0, 1))
    cos_yaw, sin_yaw = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
    return Displacement(cos_yaw * x_m + sin_yaw * y_m, cos_yaw * y_m - sin_yaw * x_m, turn_rad)
