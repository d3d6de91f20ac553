"""The robot as Rerun entities, at each of its poses: its centre, struts, springs and forces, or its heading."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Pose, Structure, Trial, Vector
from vvvaltr.controller.view.canvas import Canvas, join_strips
from vvvaltr.controller.view.scene_forces import list_force_columns

_ARROW_M = 0.06  # length of a heading's arrow


def list_drawable(trial: Trial) -> list[Pose]:
    """Return the poses of a trial that can be drawn."""
    return [pose for pose in trial.poses if pose.is_finite]


def find_path_m(poses: Sequence[Pose]) -> Array:
    """Return where the robot's centre is at each pose, (n, 3)."""
    return np.fromiter(chain.from_iterable(pose.position_m for pose in poses), float, 3 * len(poses)).reshape(-1, 3)


def send_poses(canvas: Canvas, structure: Structure | None, whens: Array, poses: Sequence[Pose]) -> None:
    """Send the robot at some poses.

    Args:
        canvas: where to send to.
        structure: what to draw of it; None where that is unknown.
        whens: a time and a trial's number for each pose, (n, 2).
        poses: the poses, all of finite numbers.
    """
    import rerun as rr

    canvas.send("world/robot/centre", whens, rr.Points3D.columns(positions=find_path_m(poses)))
    _send_headings(canvas, whens, poses)
    if structure is not None:
        _send_edges(canvas, structure, whens, poses)
        for path, rows, columns in list_force_columns(structure, poses):
            canvas.send(path, whens[rows], columns)


def _send_headings(canvas: Canvas, whens: Array, poses: Sequence[Pose]) -> None:
    """Send an arrow for each pose in which the tracker saw only the robot's position and heading."""
    import rerun as rr

    rows = [row for row, pose in enumerate(poses) if not pose.markers_m]
    bare = [poses[row] for row in rows]
    arrows = np.reshape([(math.cos(pose.yaw_rad), math.sin(pose.yaw_rad), 0.0) for pose in bare], (-1, 3))
    columns = rr.Arrows3D.columns(vectors=_ARROW_M * arrows, origins=find_path_m(bare))
    canvas.send("world/robot/heading", whens[rows], columns)


def _send_edges(canvas: Canvas, structure: Structure, whens: Array, poses: Sequence[Pose]) -> None:
    """Send a line for each strut and spring, for each pose in which the tracker saw all their ends."""
    import rerun as rr

    seen: dict[int, tuple[NDArray[np.intp], Array]] = {}  # by the number of ends, which is mostly the same for both
    for name, edges in (("struts", structure.struts), ("springs", structure.springs)):
        ends = 1 + max((end for edge in edges for end in edge), default=0)
        if ends not in seen:
            seen[ends] = _stack_markers_m(poses, ends)
        rows, markers_m = seen[ends]
        if edges and len(rows):
            points = markers_m[:, np.array(edges)].reshape(-1, 3)
            strips = join_strips(points, np.full(len(rows) * len(edges), 2))
            columns = rr.LineStrips3D.columns(strips=strips).partition([len(edges)] * len(rows))
            canvas.send(f"world/robot/{name}", whens[rows], columns)


def _stack_markers_m(poses: Sequence[Pose], ends: int) -> tuple[NDArray[np.intp], Array]:
    """Return which poses show so many strut ends, and where these are, (rows, ends, 3)."""
    rows = [row for row, pose in enumerate(poses) if len(pose.markers_m) >= ends]
    markers_m: chain[Vector] = chain.from_iterable(poses[row].markers_m[:ends] for row in rows)
    numbers = np.fromiter(chain.from_iterable(markers_m), float, 3 * ends * len(rows))
    return np.array(rows, dtype=np.intp), numbers.reshape(-1, ends, 3)
