"""The robot as other programs draw it: Foxglove's scene, and points and a transform for those that know no scene.

Everything here follows from what the log holds anyway, and is drawn at a rate that adds a share of the log's size.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose as FoxglovePose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Pose, Structure, Terrain
from vvvaltr.controller.runs.schema.codec import to_quaternion

KINDS: dict[str, type[Message]] = {
    "/ground": SceneUpdate,
    "/robot/scene": SceneUpdate,
    "/robot/points": PointCloud,
    "/tf": FrameTransform,
}
"""Topics of the drawing."""

_SHARE = 0.14  # of the size of a trial's other messages that its transforms may add, and its shapes as much again
_MESSAGE_BYTES = 39  # that MCAP adds to a message, with its place in the index
_POINTS = 24  # along each strut
_FARTHEST_M = 1e6
_HEADING_M = 0.06  # length of the line of points that shows the heading, where no strut ends are seen
_GROUND_LINES = 21  # in each direction, at most
_STRUT, _SPRING = Color(r=0.85, g=0.86, b=0.88, a=1.0), Color(r=0.4, g=0.6, b=0.9, a=1.0)
_GROUND = Color(r=0.45, g=0.5, b=0.56, a=1.0)
_HERE = FoxglovePose(orientation=Quaternion(w=1.0))


def draw_trial(
    poses: Sequence[Pose], structure: Structure | None, origin_ns: int, log_bytes: int
) -> Iterator[tuple[str, int, Message]]:
    """Yield topic, time and message of the drawing of a trial: where the robot is, and less often its shape.

    Args:
        poses: all poses of the trial.
        structure: how the robot is built; None where that is unknown.
        origin_ns: when the drive began, in nanoseconds since 1970.
        log_bytes: what the trial's other messages take, as ``count_bytes`` counts.
    """
    seen = [pose for pose in poses if _is_within_sight(pose)]
    for draw in (_draw_transform, _draw_shape):
        for pose in _thin(seen, structure, draw, _SHARE * log_bytes):
            at_ns = origin_ns + round(pose.t_s * 1e9)
            yield from ((topic, at_ns, message) for topic, message in draw(pose, structure, _timestamp(at_ns)))


def _is_within_sight(pose: Pose) -> bool:
    """Return whether a pose can be drawn: viewers count in single precision."""
    places_m = (pose.position_m, *pose.markers_m)
    return pose.is_finite and max(abs(x_m) for place_m in places_m for x_m in place_m) < _FARTHEST_M


_Draw = Callable[[Pose, Structure | None, Timestamp], list[tuple[str, Message]]]


def _thin(poses: Sequence[Pose], structure: Structure | None, draw: _Draw, most_bytes: float) -> Sequence[Pose]:
    """Return evenly spaced poses, the first one among them: as many as can be drawn in ``most_bytes``."""
    if not poses:
        return ()
    each_bytes = sum(count_bytes(message.ByteSize()) for _, message in draw(poses[0], structure, _timestamp(10**18)))
    return poses[:: max(1, math.ceil(len(poses) * each_bytes / most_bytes))]


def count_bytes(payload_bytes: int) -> int:
    """Return how many bytes a message of so many takes in a log."""
    return payload_bytes + _MESSAGE_BYTES


def _draw_transform(pose: Pose, structure: Structure | None, now: Timestamp) -> list[tuple[str, Message]]:
    x, y, z, w = to_quaternion(pose)
    px, py, pz = pose.position_m
    transform = FrameTransform(
        timestamp=now,
        parent_frame_id="world",
        child_frame_id="robot",
        translation=Vector3(x=px, y=py, z=pz),
        rotation=Quaternion(x=x, y=y, z=z, w=w),
    )
    return [("/tf", transform)]


def _draw_shape(pose: Pose, structure: Structure | None, now: Timestamp) -> list[tuple[str, Message]]:
    """Return the robot's shape in its own frame."""
    struts = () if structure is None else _seen(structure.struts, pose)
    if structure is None or not struts:
        along_m = np.linspace(0.0, _HEADING_M, _POINTS)[:, None] * np.array([1.0, 0.0, 0.0])
        return [("/robot/points", _draw_points(along_m, now))]
    ends_m = (np.array(pose.markers_m) - pose.position_m) @ _rotation(pose)
    shares = np.linspace(0.0, 1.0, _POINTS)[:, None]
    along_m = np.concatenate([ends_m[one] + shares * (ends_m[other] - ends_m[one]) for one, other in struts])
    springs = _seen(structure.springs, pose)
    lines = [_draw_edges(ends_m, struts, _STRUT, 0.006), _draw_edges(ends_m, springs, _SPRING, 0.0015)]
    return [("/robot/points", _draw_points(along_m, now)), ("/robot/scene", _scene("robot", "robot", lines, now))]


def _rotation(pose: Pose) -> Array:
    """Return the matrix that turns the robot's frame to the world's, shape (3, 3)."""
    x, y, z, w = to_quaternion(pose)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def draw_ground(terrain: Terrain, time_ns: int) -> Message:
    """Return the ground as a net of lines."""
    x, y, height = np.array(terrain.x_m), np.array(terrain.y_m), np.array(terrain.height_m)
    rows, columns = _spread(x.size), _spread(y.size)
    lines = [np.column_stack([np.full(columns.size, x[i]), y[columns], height[i, columns]]) for i in rows]
    lines += [np.column_stack([x[rows], np.full(rows.size, y[j]), height[rows, j]]) for j in columns]
    strips = [
        LinePrimitive(
            type=LinePrimitive.LINE_STRIP,
            pose=_HERE,
            thickness=1.0,
            scale_invariant=True,
            points=_point_messages(line),
            color=_GROUND,
        )
        for line in lines
    ]
    return _scene("ground", "world", strips, _timestamp(time_ns))


def _spread(count: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.unique(np.linspace(0, count - 1, min(count, _GROUND_LINES)).astype(np.int64))


def _seen(edges: Sequence[tuple[int, int]], pose: Pose) -> tuple[tuple[int, int], ...]:
    """Return the edges both of whose ends the tracker saw."""
    return tuple(edge for edge in edges if max(edge) < len(pose.markers_m))


def _draw_points(points_m: Array, now: Timestamp) -> PointCloud:
    fields = [
        PackedElementField(name=name, offset=4 * place, type=PackedElementField.FLOAT32)
        for place, name in enumerate("xyz")
    ]
    data = points_m.astype("<f4").tobytes()
    return PointCloud(timestamp=now, frame_id="robot", pose=_HERE, point_stride=12, fields=fields, data=data)


def _draw_edges(ends_m: Array, edges: Sequence[tuple[int, int]], colour: Color, thickness_m: float) -> LinePrimitive:
    return LinePrimitive(
        type=LinePrimitive.LINE_LIST,
        pose=_HERE,
        thickness=thickness_m,
        points=_point_messages(ends_m),
        color=colour,
        indices=[end for edge in edges for end in edge],
    )


def _point_messages(points_m: Array) -> list[Point3]:
    return [Point3(x=float(x), y=float(y), z=float(z)) for x, y, z in points_m]


def _scene(name: str, frame: str, lines: Sequence[LinePrimitive], now: Timestamp) -> SceneUpdate:
    return SceneUpdate(entities=[SceneEntity(timestamp=now, frame_id=frame, frame_locked=True, id=name, lines=lines)])


def _timestamp(time_ns: int) -> Timestamp:
    return Timestamp(seconds=time_ns // 10**9, nanos=time_ns % 10**9)
