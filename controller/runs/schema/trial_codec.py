"""The message that ends a trial, and back, without loss.

``decode_trial`` raises ValueError where a message holds what no run writes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from vvvaltr.controller.core.conditions import Conditions
from vvvaltr.controller.core.records import (
    AppliedFrequencies,
    Displacement,
    Fit,
    LoggedTrial,
    Movement,
    Piece,
    Review,
    SteeringStep,
    Verdict,
)
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import Command, MotorState, Outcome, Pose, Recommendation, Suggestion, Trial
from vvvaltr.controller.runs.schema import vvvaltr_pb2 as pb
from vvvaltr.controller.runs.schema.codec import (
    decode_estimate,
    decode_gait,
    decode_numbers,
    encode_estimate,
    encode_gait,
)

_Value = TypeVar("_Value")
_Message = TypeVar("_Message")


def encode_trial(logged: LoggedTrial) -> pb.Trial:
    """Return the message that ends a trial: its outcome, and all that was made of it."""
    trial = logged.trial
    return pb.Trial(
        number=trial.number,
        gait=encode_gait(trial.gait),
        outcome=trial.outcome.value,
        reason=trial.reason,
        started_unix_s=trial.started_unix_s,
        duration_s=trial.duration_s,
        score_m_s=logged.score,
        recommendation=_where_known(logged.recommendation, _encode_recommendation),
        movement=_where_known(logged.movement, _encode_movement),
        applied=_where_known(logged.applied, _encode_applied),
        conditions=_encode_conditions(trial.conditions) if trial.conditions != Conditions() else None,
        review=_encode_review(logged.review) if logged.review != Review() else None,
        fit=_where_known(logged.fit, _encode_fit),
        steering=_where_known(logged.steering, _encode_steering),
        start=_where_known(trial.start, _encode_rest),
        end=_where_known(trial.end, _encode_rest),
        pieces=map(_encode_piece, logged.pieces),
    )


def decode_trial(
    message: pb.Trial,
    suggestion: Suggestion,
    poses: Iterable[Pose],
    commands: Iterable[Command],
    states: Iterable[MotorState],
) -> LoggedTrial:
    """Return the trial that a message ends, with what was recorded before it."""
    trial = Trial(
        message.number,
        decode_gait(message.gait),
        Outcome(message.outcome),
        message.reason,
        message.started_unix_s,
        message.duration_s,
        tuple(poses),
        tuple(commands),
        tuple(states),
        _decode_conditions(message.conditions),
        _decode_rest(message.start) if message.HasField("start") else None,
        _decode_rest(message.end) if message.HasField("end") else None,
    )
    return LoggedTrial(
        suggestion,
        trial,
        message.score_m_s if message.HasField("score_m_s") else None,
        _decode_recommendation(message.recommendation) if message.HasField("recommendation") else None,
        _decode_movement(message.movement) if message.HasField("movement") else None,
        _decode_applied(message.applied) if message.HasField("applied") else None,
        _decode_review(message.review),
        _decode_fit(message.fit) if message.HasField("fit") else None,
        _decode_steering(message.steering) if message.HasField("steering") else None,
        tuple(map(_decode_piece, message.pieces)),
    )


def _where_known(value: _Value | None, encode: Callable[[_Value], _Message]) -> _Message | None:
    return None if value is None else encode(value)


def _encode_recommendation(best: Recommendation) -> pb.Recommendation:
    return pb.Recommendation(gait=encode_gait(best.gait), estimate=encode_estimate(best.estimate))


def _decode_recommendation(message: pb.Recommendation) -> Recommendation:
    return Recommendation(decode_gait(message.gait), decode_estimate(message.estimate))


def _encode_piece(piece: Piece) -> pb.Piece:
    (x_m, y_m), (cos_yaw, sin_yaw) = piece.moved_m, piece.heading
    return pb.Piece(duration_s=piece.duration_s, x_m=x_m, y_m=y_m, cos_yaw=cos_yaw, sin_yaw=sin_yaw)


def _decode_piece(message: pb.Piece) -> Piece:
    return Piece(message.duration_s, (message.x_m, message.y_m), (message.cos_yaw, message.sin_yaw))


def _encode_applied(applied: AppliedFrequencies) -> pb.AppliedFrequencies:
    return pb.AppliedFrequencies(mean_hz=applied.mean_hz, measured=applied.measured)


def _decode_applied(message: pb.AppliedFrequencies) -> AppliedFrequencies:
    return AppliedFrequencies(tuple(message.mean_hz), message.measured)


def _encode_fit(fit: Fit) -> pb.Fit:
    return pb.Fit(hyperparameters=fit.hyperparameters, is_new=fit.is_new)


def _decode_fit(message: pb.Fit) -> Fit:
    return Fit(decode_numbers(message.hyperparameters), message.is_new)


def _encode_movement(movement: Movement) -> pb.Movement:
    return pb.Movement(
        start=_encode_rest(movement.start),
        end=_encode_rest(movement.end),
        displacement=_encode_displacement(movement.displacement),
    )


def _decode_movement(message: pb.Movement) -> Movement:
    return Movement(_decode_rest(message.start), _decode_rest(message.end), _decode_displacement(message.displacement))


def _encode_rest(rest: RestingPose) -> pb.RestingPose:
    x_m, y_m, z_m = rest.position_m
    return pb.RestingPose(
        x_m=x_m,
        y_m=y_m,
        z_m=z_m,
        yaw_rad=rest.yaw_rad,
        pitch_rad=rest.pitch_rad,
        roll_rad=rest.roll_rad,
        position_sd_m=rest.position_sd_m,
        yaw_sd_rad=rest.yaw_sd_rad,
        face=rest.face,
    )


def _decode_rest(message: pb.RestingPose) -> RestingPose:
    return RestingPose(
        (message.x_m, message.y_m, message.z_m),
        message.yaw_rad,
        message.pitch_rad,
        message.roll_rad,
        message.position_sd_m if message.HasField("position_sd_m") else None,
        message.yaw_sd_rad if message.HasField("yaw_sd_rad") else None,
        message.face,
    )


def _encode_displacement(displacement: Displacement) -> pb.Displacement:
    return pb.Displacement(forward_m=displacement.forward_m, left_m=displacement.left_m, turn_rad=displacement.turn_rad)


def _decode_displacement(message: pb.Displacement) -> Displacement:
    return Displacement(message.forward_m, message.left_m, message.turn_rad)


def _encode_conditions(conditions: Conditions) -> pb.Conditions:
    return pb.Conditions(
        session_s=conditions.session_s,
        battery_v=conditions.battery_v,
        battery_changed=conditions.battery_changed,
        dropped_poses=conditions.dropped_poses,
        tracker_offset_s=conditions.tracker_offset_s,
        tracker_jitter_s=conditions.tracker_jitter_s,
    )


def _decode_conditions(message: pb.Conditions) -> Conditions:
    return Conditions(
        message.session_s if message.HasField("session_s") else None,
        message.battery_v if message.HasField("battery_v") else None,
        message.battery_changed,
        message.dropped_poses,
        message.tracker_offset_s if message.HasField("tracker_offset_s") else None,
        message.tracker_jitter_s if message.HasField("tracker_jitter_s") else None,
    )


def _encode_review(review: Review) -> pb.Review:
    return pb.Review(
        notes=review.notes,
        verdict=review.verdict.value if review.verdict else "",
        verdict_reason=review.verdict_reason,
        is_suspect=review.is_suspect,
        suspicion=review.suspicion,
    )


def _decode_review(message: pb.Review) -> Review:
    return Review(
        message.notes,
        Verdict(message.verdict) if message.verdict else None,
        message.verdict_reason,
        message.is_suspect,
        message.suspicion,
    )


def _encode_steering(step: SteeringStep) -> pb.SteeringStep:
    return pb.SteeringStep(
        goal_x_m=step.goal_m[0],
        goal_y_m=step.goal_m[1],
        goal_yaw_rad=step.goal_yaw_rad,
        predicted=_encode_displacement(step.predicted),
        position_sd_m=step.position_sd_m,
        turn_sd_rad=step.turn_sd_rad,
        plan=map(encode_gait, step.plan),
    )


def _decode_steering(message: pb.SteeringStep) -> SteeringStep:
    return SteeringStep(
        (message.goal_x_m, message.goal_y_m),
        message.goal_yaw_rad if message.HasField("goal_yaw_rad") else None,
        _decode_displacement(message.predicted),
        message.position_sd_m if message.HasField("position_sd_m") else None,
        message.turn_sd_rad if message.HasField("turn_sd_rad") else None,
        tuple(map(decode_gait, message.plan)),
    )
