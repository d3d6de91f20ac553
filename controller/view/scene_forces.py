"""The forces on a robot as Rerun entities: springs by tension, contacts, and the forces of ground and motors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from vvvaltr.controller.core.values import Forces, Pose, Structure, Vector
from vvvaltr.controller.view.canvas import Canvas

if TYPE_CHECKING:
    import rerun as rr

_UNKNOWN = (150, 158, 170)
_TENSION_SHARES = (0.7, 1.0, 1.3)  # shares of the median tension, with these colours; between them they are mixed
_TENSION_COLOURS = ((70, 130, 250), (190, 190, 195), (245, 70, 50))
_CONTACT = (120, 230, 150)
_PUSH = (235, 130, 225)
_ARROW_M_N = 0.05  # length of an arrow per newton


def send_force_styles(canvas: Canvas) -> None:
    """Send the sizes and colours of all forces, which stay the same."""
    import rerun as rr

    for path, style in (
        ("contacts", rr.Points3D.from_fields(colors=_CONTACT, radii=0.003)),
        ("ground_forces", rr.Arrows3D.from_fields(colors=_CONTACT, radii=0.001)),
        ("motor_forces", rr.Arrows3D.from_fields(colors=_PUSH, radii=0.001)),
    ):
        canvas.log(f"world/robot/{path}", style)


def list_force_columns(
    structure: Structure, poses: Sequence[Pose]
) -> Iterator[tuple[str, list[int], rr.ComponentColumnList]]:
    """Yield of each entity of the forces its path, the positions of the poses that have it, and its columns."""
    import rerun as rr

    if poses:
        yield "world/robot/springs", list(range(len(poses))), _spring_colours([pose.forces for pose in poses])
    known = [(row, pose, pose.forces) for row, pose in enumerate(poses) if pose.forces is not None]
    if not known:
        return
    rows = [row for row, _, _ in known]
    points_m = [forces.contacts_m for _, _, forces in known]
    contacts = rr.Points3D.columns(positions=_rows(points_m)).partition(list(map(len, points_m)))
    yield "world/robot/contacts", rows, contacts
    yield "world/robot/ground_forces", rows, _arrows(points_m, [forces.contacts_n for _, _, forces in known])
    pushes = [_pushes(structure, pose, forces) for _, pose, forces in known]
    middles_m, motors_n = ([[push[side] for push in each] for each in pushes] for side in (0, 1))
    yield "world/robot/motor_forces", rows, _arrows(middles_m, motors_n)


def _spring_colours(each: Sequence[Forces | None]) -> rr.ComponentColumnList:
    """Return for each pose a colour per spring where its tensions are known, else one colour for all springs."""
    import rerun as rr

    tensions_n = np.array([tension_n for forces in each if forces for tension_n in forces.tensions_n])
    usual_n = float(np.median(tensions_n)) if len(tensions_n) else 0.0
    scale = np.array(_TENSION_SHARES) * max(usual_n, 1e-9)
    colours = [
        np.stack([np.interp(forces.tensions_n, scale, part) for part in zip(*_TENSION_COLOURS, strict=True)], axis=1)
        if forces and forces.tensions_n
        else np.array([_UNKNOWN], float)
        for forces in each
    ]
    return rr.LineStrips3D.columns(colors=np.concatenate(colours).astype(np.uint8)).partition(list(map(len, colours)))


def _arrows(origins_m: Sequence[Sequence[Vector]], forces_n: Sequence[Sequence[Vector]]) -> rr.ComponentColumnList:
    import rerun as rr

    vectors = _ARROW_M_N * _rows(forces_n)
    return rr.Arrows3D.columns(vectors=vectors, origins=_rows(origins_m)).partition(list(map(len, forces_n)))


def _pushes(structure: Structure, pose: Pose, forces: Forces) -> list[tuple[Vector, Vector]]:
    """Return place (m) and force (N) of each motor whose strut is seen; a motor is at the middle of its strut."""
    pushes = []
    for strut, force_n in zip(structure.motor_struts, forces.motors_n, strict=False):
        ends = structure.struts[strut] if strut < len(structure.struts) else ()
        if ends and max(ends) < len(pose.markers_m):
            pushes.append((_middle_m(*(pose.markers_m[end] for end in ends)), force_n))
    return pushes


def _middle_m(one: Vector, other: Vector) -> Vector:
    return (one[0] + other[0]) / 2.0, (one[1] + other[1]) / 2.0, (one[2] + other[2]) / 2.0


def _rows(groups: Sequence[Sequence[Vector]]) -> Any:
    return np.reshape(list(chain.from_iterable(groups)), (-1, 3))
