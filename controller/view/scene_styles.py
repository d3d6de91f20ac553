"""What stays the same in a run's Rerun recording: colours and sizes of all entities, and the ground."""

from __future__ import annotations

import math

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Structure, Terrain
from vvvaltr.controller.view.canvas import Canvas
from vvvaltr.controller.view.scene_forces import send_force_styles

_Colour = tuple[int, int, int]

_GROUND: _Colour = (62, 70, 84)
_LINES: _Colour = (104, 114, 130)
_STRUT: _Colour = (205, 208, 214)
_TRAIL: _Colour = (250, 200, 70)
_MEASURED: _Colour = (240, 240, 240)
_FAULT: _Colour = (255, 80, 70)
_MEAN: _Colour = (90, 190, 255)
_INTERVAL: _Colour = (55, 110, 150)
_MOTORS: tuple[_Colour, ...] = (
    (240, 90, 90),
    (110, 205, 105),
    (95, 155, 255),
    (250, 170, 60),
    (200, 120, 230),
    (60, 205, 205),
)
_GRID_M = 0.05  # distance of the lines on the ground


def send_world_styles(canvas: Canvas, structure: Structure | None) -> None:
    """Send sizes and colours of everything in the world: robot, trail and label."""
    import rerun as rr

    canvas.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    canvas.log("world/robot/centre", rr.Points3D.from_fields(colors=_TRAIL, radii=0.003))
    canvas.log("world/label", rr.Points3D.from_fields(colors=_TRAIL, radii=0.0, show_labels=True))
    canvas.log("world/trail", rr.LineStrips3D.from_fields(colors=_TRAIL, radii=0.001))
    if structure is not None:
        driven = {strut: _motor_colour(motor) for motor, strut in enumerate(structure.motor_struts)}
        colours = [driven.get(strut, _STRUT) for strut in range(len(structure.struts))]
        canvas.log("world/robot/struts", rr.LineStrips3D.from_fields(colors=colours, radii=0.003))
        canvas.log("world/robot/springs", rr.LineStrips3D.from_fields(radii=0.0007))
        send_force_styles(canvas)


def send_speed_styles(canvas: Canvas) -> None:
    """Send names, colours and widths of the curves of speed, and of the marks of faults."""
    import rerun as rr

    for path, name, colour, width in (
        ("best_measured", "best measured so far", _TRAIL, 1.0),
        ("best_gait/mean", "best gait: posterior mean", _MEAN, 3.0),
        ("best_gait/low", "95 % low", _INTERVAL, 1.5),
        ("best_gait/high", "95 % high", _INTERVAL, 1.5),
    ):
        canvas.log(f"speed/{path}", rr.SeriesLines(colors=colour, names=name, widths=width))
    points = rr.SeriesPoints(colors=_MEASURED, names="measured", markers="circle", marker_sizes=3.0)
    canvas.log("speed/measured", points)
    fault = rr.SeriesPoints(colors=_FAULT, names="trial without a measurement", markers="cross", marker_sizes=7.0)
    canvas.log("motors/fault", fault)


def _motor_colour(motor: int) -> _Colour:
    """Return the colour of a motor (index), for its strut and its curves."""
    return _MOTORS[motor % len(_MOTORS)]


def send_motor_style(canvas: Canvas, motor: int) -> None:
    """Send names, colours and widths of a motor's curves; ``motor`` is an index."""
    import rerun as rr

    colour = _motor_colour(motor)
    faint = tuple(part // 2 for part in colour)
    for name, label, shade, width in (("commanded", "asked", faint, 3.0), ("applied", "applied", colour, 1.5)):
        style = rr.SeriesLines(colors=shade, names=f"motor {motor + 1} {label}", widths=width)
        canvas.log(f"motors/{motor + 1}/{name}", style)


def send_ground(canvas: Canvas, terrain: Terrain) -> None:
    """Send the ground as a mesh, with lines every 50 mm and a scale along the x axis."""
    import rerun as rr

    x, y, height = np.array(terrain.x_m), np.array(terrain.y_m), np.array(terrain.height_m)
    vertices = np.stack([*np.meshgrid(x, y, indexing="ij"), height], axis=-1).reshape(-1, 3)
    corner = np.arange(x.size * y.size).reshape(x.size, y.size)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    triangles = np.concatenate([np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, b, c), (a, c, d))])
    mesh = rr.Mesh3D(vertex_positions=vertices, triangle_indices=triangles, albedo_factor=_GROUND)
    canvas.log("world/ground", mesh)
    across = [_line(at, x, y, height) for at in _ticks(x)]
    along = [_line(at, y, x, height.T)[:, [1, 0, 2]] for at in _ticks(y)]
    canvas.log("world/ground/lines", rr.LineStrips3D([*across, *along], colors=_LINES, radii=0.0003))
    front_m = max(y[0], -2 * _GRID_M)
    marks = np.array([(line[0, 0], front_m, np.interp(front_m, y, line[:, 2])) for line in across[::2]]).reshape(-1, 3)
    labels = [f"{1000 * at:.0f} mm" for at in marks[:, 0]]
    scale = rr.Points3D(marks, labels=labels, colors=_LINES, radii=0.001, show_labels=True)
    canvas.log("world/ground/scale", scale)


def _ticks(values: Array) -> list[float]:
    return [_GRID_M * step for step in range(math.ceil(values[0] / _GRID_M), math.floor(values[-1] / _GRID_M) + 1)]


def _line(at: float, axis: Array, other: Array, height: Array) -> Array:
    """Return a line over the ground at one value of ``axis``, 0.5 mm above it to be visible, shape (others, 3)."""
    return np.array([(at, end, np.interp(at, axis, height[:, i]) + 0.0005) for i, end in enumerate(other)])
