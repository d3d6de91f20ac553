"""Nouns to messages and back, without loss: what is read equals what was written.

Each ``decode_...`` raises ValueError where a message holds what no run writes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import chain
from math import cos, sin
from sys import intern

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Pose_pb2 import Pose as FoxglovePose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from vvvaltr.controller.core.conditions import check_finite
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import Run
from vvvaltr.controller.core.values import (
    Command,
    Estimate,
    Forces,
    MotorState,
    Phase,
    Photo,
    Pose,
    Source,
    Structure,
    Suggestion,
    Terrain,
    Vector,
)
from vvvaltr.controller.runs.schema import vvvaltr_pb2 as pb
from vvvaltr.controller.runs.schema.limits import (
    MOST_MARKERS,
    MOST_MOTORS,
    bounded,
    check_message,
    check_numbers,
    check_place,
    check_times,
    counted,
)


def encode_gait(gait: Gait) -> pb.Gait:
    """Return the message of a gait."""
    return pb.Gait(frequency_hz=gait.frequency_hz, phase_rad=gait.phase_rad, amplitude=gait.amplitude)


def decode_gait(message: pb.Gait) -> Gait:
    """Return the gait of a message."""
    return Gait(tuple(message.frequency_hz), tuple(message.phase_rad), tuple(message.amplitude))


def encode_estimate(estimate: Estimate) -> pb.Estimate:
    """Return the message of an estimate."""
    return pb.Estimate(mean_m_s=estimate.mean, low_m_s=estimate.low, high_m_s=estimate.high)


def decode_estimate(message: pb.Estimate) -> Estimate:
    """Return the estimate of a message."""
    return Estimate(message.mean_m_s, message.low_m_s, message.high_m_s)


def _encode_structure(structure: Structure) -> pb.Structure:
    terrain = structure.terrain
    return pb.Structure(
        struts=[pb.Edge(first=first, second=second) for first, second in structure.struts],
        springs=[pb.Edge(first=first, second=second) for first, second in structure.springs],
        motor_struts=structure.motor_struts,
        terrain=None
        if terrain is None
        else pb.Terrain(x_m=terrain.x_m, y_m=terrain.y_m, height_m=chain.from_iterable(terrain.height_m)),
    )


def _decode_structure(message: pb.Structure) -> Structure:
    return Structure(
        tuple((edge.first, edge.second) for edge in message.struts),
        tuple((edge.first, edge.second) for edge in message.springs),
        tuple(message.motor_struts),
        _decode_terrain(message.terrain) if message.HasField("terrain") else None,
    )


def _decode_terrain(message: pb.Terrain) -> Terrain:
    columns = len(message.y_m)
    if len(message.height_m) != len(message.x_m) * columns:
        raise ValueError(f"{len(message.height_m)} heights on a grid of {len(message.x_m)} by {columns}")
    rows = (tuple(message.height_m[row * columns : (row + 1) * columns]) for row in range(len(message.x_m)))
    return Terrain(tuple(message.x_m), tuple(message.y_m), tuple(rows))


def encode_run(version: int, head: Run) -> pb.Run:
    """Return the message that begins a log of the given format version; the trials are no part of it."""
    return pb.Run(
        format=version,
        structure=None if head.structure is None else _encode_structure(head.structure),
        sources=[
            pb.Source(name=source.name, gaits=map(encode_gait, source.gaits), scores_m_s=source.scores)
            for source in head.sources
        ],
        about=head.about,
    )


def decode_run(message: pb.Run) -> Run:
    """Return the run that a message begins, without trials."""
    structure = _decode_structure(message.structure) if message.HasField("structure") else None
    return Run(structure, tuple(map(_decode_source, message.sources)), about=dict(message.about))


def _decode_source(message: pb.Source) -> Source:
    scores_m_s = tuple(finite(score_m_s, "score_m_s") for score_m_s in message.scores_m_s)
    return Source(message.name, tuple(map(decode_gait, message.gaits)), scores_m_s)


def encode_suggestion(suggestion: Suggestion) -> pb.Suggestion:
    """Return the message of a suggestion."""
    return pb.Suggestion(
        gait=encode_gait(suggestion.gait),
        origin=suggestion.origin,
        expected=None if suggestion.expected is None else encode_estimate(suggestion.expected),
        hyperparameters=suggestion.hyperparameters,
        phase=suggestion.phase.value,
    )


def decode_suggestion(message: pb.Suggestion) -> Suggestion:
    """Return the suggestion of a message."""
    expected = decode_estimate(message.expected) if message.HasField("expected") else None
    phase = Phase(message.phase) if message.phase else _infer_phase(message.origin)
    numbers = decode_numbers(message.hyperparameters)
    return Suggestion(decode_gait(message.gait), intern(message.origin), expected, numbers, phase)


def decode_numbers(numbers: Mapping[str, float]) -> dict[str, float]:
    """Return numbers by name. All trials of a long run share the names, which would take more memory than the rest."""
    return {intern(name): number for name, number in numbers.items()}


def _infer_phase(origin: str) -> Phase:
    """Return the phase of a trial whose log has no field for it: only the origin told."""
    return Phase.CONFIRMATION if origin == "confirmation" else Phase.SEARCH


def finite(number: float, name: str) -> float:
    """Return ``number``. Raises ValueError, with its name, if it is not finite."""
    check_finite(**{name: number})
    return number


def encode_tracking(pose: Pose) -> pb.Tracking:
    """Return the message of a pose, with all that is known of it."""
    x_m, y_m, z_m = pose.position_m
    return pb.Tracking(
        t_s=pose.t_s,
        x_m=x_m,
        y_m=y_m,
        z_m=z_m,
        yaw_rad=pose.yaw_rad,
        pitch_rad=pose.pitch_rad,
        roll_rad=pose.roll_rad,
        markers_m=chain.from_iterable(pose.markers_m),
        forces=None if pose.forces is None else _encode_forces(pose.forces),
        uncertainty_m=pose.uncertainty_m,
    )


def decode_poses(payloads: Iterable[bytes]) -> tuple[Pose, ...]:
    """Return the poses of a trial's messages."""
    messages = [pb.Tracking.FromString(payload) for payload in payloads]
    check_times([message.t_s for message in messages])
    return tuple(map(_decode_tracking, messages))


def _decode_tracking(message: pb.Tracking) -> Pose:
    position_m = (message.x_m, message.y_m, message.z_m)
    check_place(*position_m)
    return Pose(
        message.t_s,
        position_m,
        message.yaw_rad,
        message.pitch_rad,
        message.roll_rad,
        _group_vectors(counted("markers_m", message.markers_m, MOST_MARKERS)),
        _decode_forces(message.forces) if message.HasField("forces") else None,
        finite(message.uncertainty_m, "uncertainty_m") if message.HasField("uncertainty_m") else None,
    )


def _encode_forces(forces: Forces) -> pb.Forces:
    return pb.Forces(
        tensions_n=forces.tensions_n,
        motors_n=chain.from_iterable(forces.motors_n),
        contacts_m=chain.from_iterable(forces.contacts_m),
        contacts_n=chain.from_iterable(forces.contacts_n),
    )


def _decode_forces(message: pb.Forces) -> Forces:
    return Forces(
        bounded("tensions_n", message.tensions_n),
        _group_vectors(bounded("motors_n", message.motors_n)),
        _group_vectors(bounded("contacts_m", message.contacts_m)),
        _group_vectors(bounded("contacts_n", message.contacts_n)),
    )


def _group_vectors(numbers: Sequence[float]) -> tuple[Vector, ...]:
    each = iter(numbers)
    return tuple(zip(each, each, each, strict=True))


def encode_pose(pose: Pose, time_ns: int) -> PoseInFrame:
    """Return a pose as Foxglove and Rerun draw it unaided: position and quaternion in the frame ``world``.

    Args:
        pose: the pose.
        time_ns: when, in nanoseconds since 1970.
    """
    x_m, y_m, z_m = pose.position_m
    x, y, z, w = to_quaternion(pose)
    return PoseInFrame(
        timestamp=Timestamp(seconds=time_ns // 10**9, nanos=time_ns % 10**9),
        frame_id="world",
        pose=FoxglovePose(position=Vector3(x=x_m, y=y_m, z=z_m), orientation=Quaternion(x=x, y=y, z=z, w=w)),
    )


def encode_photo(photo: Photo, began_ns: int) -> CompressedImage:
    """Return a picture as viewers show it unaided.

    Args:
        photo: the picture.
        began_ns: what its time counts from, in nanoseconds since 1970.
    """
    time_ns = began_ns + round(photo.t_s * 1e9)
    return CompressedImage(
        timestamp=Timestamp(seconds=time_ns // 10**9, nanos=time_ns % 10**9),
        frame_id="camera",
        data=photo.jpeg,
        format="jpeg",
    )


def decode_photo(message: CompressedImage, began_ns: int) -> Photo:
    """Return the picture of a message, its time counted from ``began_ns``, to the microsecond."""
    time_ns = message.timestamp.seconds * 10**9 + message.timestamp.nanos
    return Photo(round((time_ns - began_ns) / 1e9, 6), message.data)


def to_quaternion(pose: Pose) -> tuple[float, float, float, float]:
    """Return x, y, z, w of the pose's intrinsic z-y'-x'' angles."""
    half_yaw, half_pitch, half_roll = pose.yaw_rad / 2, pose.pitch_rad / 2, pose.roll_rad / 2
    cy, sy, cp, sp, cr, sr = (f(a) for a in (half_yaw, half_pitch, half_roll) for f in (cos, sin))
    return (
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
        cy * cp * cr + sy * sp * sr,
    )


def encode_command(command: Command) -> pb.Command:
    """Return the message of a command."""
    return pb.Command(t_s=command.t_s, gait=encode_gait(command.gait), hold_s=command.hold_s)


def decode_commands(payloads: Iterable[bytes]) -> tuple[Command, ...]:
    """Return the commands of a trial's messages."""
    messages = [pb.Command.FromString(payload) for payload in payloads]
    check_times([message.t_s for message in messages])
    check_numbers("hold_s", [message.hold_s for message in messages])
    return tuple(
        Command(message.t_s, _decode_commanded(message.gait.SerializeToString()), message.hold_s)
        for message in messages
    )


@lru_cache(64)
def _decode_commanded(payload: bytes) -> Gait:
    """Return the gait of a command: one value, for a trial commands the same gait all the time."""
    message = pb.Gait.FromString(payload)
    check_message(message)
    return decode_gait(message)


def encode_state(state: MotorState) -> pb.MotorState:
    """Return the message of the motors' state."""
    return pb.MotorState(
        t_s=state.t_s,
        frequency_hz=state.frequency_hz,
        measured=state.measured,
        current_a=state.current_a,
        temperature_c=state.temperature_c,
    )


def decode_states(payloads: Iterable[bytes]) -> tuple[MotorState, ...]:
    """Return the motors' states of a trial's messages."""
    messages = [pb.MotorState.FromString(payload) for payload in payloads]
    check_times([message.t_s for message in messages])
    return tuple(
        MotorState(
            message.t_s,
            counted("frequency_hz", message.frequency_hz, MOST_MOTORS),
            message.measured,
            counted("current_a", message.current_a, MOST_MOTORS),
            counted("temperature_c", message.temperature_c, MOST_MOTORS),
        )
        for message in messages
    )
