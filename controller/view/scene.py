"""A run as Rerun entities: the robot over its ground, its motors, the speeds, and what each trial came to.

Lines and points go out in whole columns, so that a run of forty trials converts in a moment.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Gait, Pose, Structure, Terrain, Trial
from vvvaltr.controller.runs.log import find_trial_span_ns
from vvvaltr.controller.view.scene_forces import force_columns, send_force_styles

if TYPE_CHECKING:
    import rerun as rr

_Colour = tuple[int, int, int]
_When = tuple[float, int]  # seconds since the run began, number of the trial

_GROUND: _Colour = (62, 70, 84)
_LINES: _Colour = (104, 114, 130)
_STRUT: _Colour = (205, 208, 214)
_TRAIL: _Colour = (250, 200, 70)
_MEASURED: _Colour = (240, 240, 240)
_MEAN: _Colour = (90, 190, 255)
_INTERVAL: _Colour = (55, 110, 150)
_GRID_M = 0.05
_LABEL_M = 0.07  # above the robot's centre
_ARROW_M = 0.06
_MOTORS: tuple[_Colour, ...] = (
    (240, 90, 90),
    (110, 205, 105),
    (95, 155, 255),
    (250, 170, 60),
    (200, 120, 230),
    (60, 205, 205),
)


@dataclass(frozen=True, slots=True)
class _Placed:
    """A trial and where it lies on the time line, in seconds since the run began."""

    logged: LoggedTrial
    begin_s: float
    end_s: float

    @property
    def trial(self) -> Trial:
        return self.logged.trial

    @property
    def begin(self) -> _When:
        return self.begin_s, self.trial.number

    @property
    def end(self) -> _When:
        return self.end_s, self.trial.number


class Scene:
    """Sends a run to a Rerun recording, trial by trial or in one go, on the time lines ``time`` and ``trial``."""

    def __init__(self, recording: rr.RecordingStream, structure: Structure | None) -> None:
        self._recording = recording
        self._structure = structure
        self._trials: list[LoggedTrial] = []
        self._begin_ns: int | None = None
        self._end_ns = 0
        _send_world_styles(recording, structure)
        _send_speed_styles(recording)
        if structure is not None and structure.terrain is not None:
            _send_ground(recording, structure.terrain)

    @property
    def trials(self) -> Sequence[LoggedTrial]:
        """All trials that were added."""
        return self._trials

    def add(self, trials: Iterable[LoggedTrial]) -> None:
        """Send trials that follow those sent so far."""
        placed = [self._place(logged) for logged in trials]
        if placed:
            self._send_trails(placed)
            self._send_robot(placed)
            self._send_motors(placed)
            self._send_speeds(placed)
            self._send_texts(placed)

    def _place(self, logged: LoggedTrial) -> _Placed:
        begin_ns, self._end_ns = find_trial_span_ns(logged.trial, after_ns=self._end_ns)
        self._begin_ns = begin_ns if self._begin_ns is None else self._begin_ns
        self._trials.append(logged)
        return _Placed(logged, (begin_ns - self._begin_ns) / 1e9, (self._end_ns - self._begin_ns) / 1e9)

    def _send_trails(self, placed: Sequence[_Placed]) -> None:
        """Send the whole path of each trial when it begins, and above its start what it came to."""
        import rerun as rr

        begins = [it.begin for it in placed]
        paths = [np.reshape([pose.position_m for pose in it.trial.poses if pose.is_finite], (-1, 3)) for it in placed]
        self._send("world/trail", begins, rr.LineStrips3D.columns(strips=paths))
        places = [np.array([0.0, 0.0, _LABEL_M]) + (path[0] if len(path) else 0.0) for path in paths]
        labels = [f"trial {it.trial.number}: {_result(it.logged)}" for it in placed]
        self._send("world/label", begins, rr.Points3D.columns(positions=places, labels=labels))

    def _send_robot(self, placed: Sequence[_Placed]) -> None:
        import rerun as rr

        poses = [
            ((it.begin_s + pose.t_s, it.trial.number), pose)
            for it in placed
            for pose in it.trial.poses
            if pose.is_finite
        ]
        centres_m = np.reshape([pose.position_m for _, pose in poses], (-1, 3))
        self._send("world/robot/centre", [when for when, _ in poses], rr.Points3D.columns(positions=centres_m))
        self._send_headings([(when, pose) for when, pose in poses if not pose.markers_m])
        if self._structure is not None:
            self._send_edges("world/robot/struts", self._structure.struts, poses)
            self._send_edges("world/robot/springs", self._structure.springs, poses)
            for path, whens, columns in force_columns(self._structure, poses):
                self._send(path, whens, columns)

    def _send_headings(self, poses: Sequence[tuple[_When, Pose]]) -> None:
        """Send an arrow where a tracker sees no more of the robot than where it is and where it points."""
        import rerun as rr

        arrows = np.reshape([(math.cos(pose.yaw_rad), math.sin(pose.yaw_rad), 0.0) for _, pose in poses], (-1, 3))
        origins = np.reshape([pose.position_m for _, pose in poses], (-1, 3))
        columns = rr.Arrows3D.columns(vectors=_ARROW_M * arrows, origins=origins)
        self._send("world/robot/heading", [when for when, _ in poses], columns)

    def _send_edges(self, path: str, edges: Sequence[tuple[int, int]], poses: Sequence[tuple[_When, Pose]]) -> None:
        """Send a line for each pair of strut ends, at each pose in which the tracker saw all of them."""
        import rerun as rr

        ends = 1 + max((end for edge in edges for end in edge), default=0)
        seen = [(when, pose.markers_m[:ends]) for when, pose in poses if len(pose.markers_m) >= ends]
        if edges and seen:
            strips = np.array([markers_m for _, markers_m in seen])[:, np.array(edges)].reshape(-1, 2, 3)
            columns = rr.LineStrips3D.columns(strips=strips).partition([len(edges)] * len(seen))
            self._send(path, [when for when, _ in seen], columns)

    def _send_motors(self, placed: Sequence[_Placed]) -> None:
        trials = [it.trial for it in placed]
        for motor in range(max(trial.gait.motor_count for trial in trials)):
            _send_motor_style(self._recording, motor)
            commanded = [_points(((it.t_s, it.gait.frequency_hz) for it in trial.commands), motor) for trial in trials]
            applied = [_points(((it.t_s, it.frequency_hz) for it in trial.states), motor) for trial in trials]
            self._send_curve(f"motors/{motor + 1}/commanded", placed, commanded)
            self._send_curve(f"motors/{motor + 1}/applied", placed, applied)

    def _send_curve(
        self, path: str, placed: Sequence[_Placed], curves: Sequence[Sequence[tuple[float, float]]]
    ) -> None:
        """Send a curve of (time, value) for each trial, with a gap behind it."""
        whens, values = [], []
        for it, curve in zip(placed, curves, strict=True):
            whens += [(it.begin_s + t_s, it.trial.number) for t_s, _ in curve] + [it.end]
            values += [value for _, value in curve] + [math.nan]
        self._send_scalars(path, whens, values)

    def _send_speeds(self, placed: Sequence[_Placed]) -> None:
        scored = [(it.end, it.logged.score) for it in placed if it.logged.score is not None]
        ends = [end for end, _ in scored]
        earlier = [logged.score for logged in self._trials[: -len(placed)] if logged.score is not None]
        measured = np.array([score for _, score in scored])
        best = np.maximum.accumulate(np.array([max(earlier, default=-math.inf), *measured]))[1:]
        self._send_scalars("speed/measured", ends, 1000 * measured)
        self._send_scalars("speed/best_measured", ends, 1000 * best)
        known = [(it.end, it.logged.recommendation.estimate) for it in placed if it.logged.recommendation is not None]
        for bound in ("mean", "low", "high"):
            values = [1000 * getattr(estimate, bound) for _, estimate in known]
            self._send_scalars(f"speed/best_gait/{bound}", [end for end, _ in known], values)

    def _send_texts(self, placed: Sequence[_Placed]) -> None:
        import rerun as rr

        lines = [
            f"{it.trial.number}: {_result(it.logged)}, {_gait_text(it.trial.gait)} ({it.logged.suggestion.origin})"
            for it in placed
        ]
        levels = ["INFO" if it.logged.score is not None else "WARN" for it in placed]
        self._send("trials", [it.end for it in placed], rr.TextLog.columns(text=lines, level=levels))

    def _send_scalars(self, path: str, whens: Sequence[_When], values: Any) -> None:
        import rerun as rr

        self._send(path, whens, rr.Scalars.columns(scalars=values))

    def _send(self, path: str, whens: Sequence[_When], columns: rr.ComponentColumnList) -> None:
        import rerun as rr

        if whens:
            times_s, numbers = zip(*whens, strict=True)
            indexes = [rr.TimeColumn("time", duration=times_s), rr.TimeColumn("trial", sequence=numbers)]
            self._recording.send_columns(path, indexes, columns)


def _points(series: Iterable[tuple[float, Sequence[float]]], motor: int) -> list[tuple[float, float]]:
    return [(t_s, values[motor]) for t_s, values in series if motor < len(values)]


def _gait_text(gait: Gait) -> str:
    """Return the frequencies of a gait for people to read."""
    return " / ".join(f"{frequency:.1f}" for frequency in gait.frequency_hz) + " Hz"


def result_text(trials: Sequence[LoggedTrial]) -> str:
    """Return what a run came to, as Markdown."""
    outcomes = Counter(logged.trial.outcome.value.replace("_", " ") for logged in trials)
    counts = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common())
    recommended = [logged.recommendation for logged in trials if logged.recommendation is not None]
    measured = [logged for logged in trials if logged.score is not None]
    if not recommended or not measured:
        return f"### No gait yet\n\nTrials: {counts}."
    best, luckiest = recommended[-1], max(measured, key=lambda logged: logged.score or 0.0)
    estimate = best.estimate
    return (
        f"### Best gait: {_gait_text(best.gait)}\n\n"
        f"**{1000 * estimate.mean:.1f} mm/s** (posterior mean), "
        f"95 % interval {1000 * estimate.low:.1f} to {1000 * estimate.high:.1f} mm/s\n\n"
        f"{len(trials)} trials: {counts}\n\n"
        f"The fastest single trial was {luckiest.trial.number} with {_result(luckiest)}; one trial alone may be luck."
    )


def _result(logged: LoggedTrial) -> str:
    if logged.score is None:
        return f"{logged.trial.outcome.value.replace('_', ' ')}: {logged.trial.reason}"
    return f"{1000 * logged.score:.1f} mm/s"


def _send_world_styles(recording: rr.RecordingStream, structure: Structure | None) -> None:
    import rerun as rr

    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("world/robot/centre", rr.Points3D.from_fields(colors=_TRAIL, radii=0.003), static=True)
    recording.log("world/label", rr.Points3D.from_fields(colors=_TRAIL, radii=0.0, show_labels=True), static=True)
    recording.log("world/trail", rr.LineStrips3D.from_fields(colors=_TRAIL, radii=0.001), static=True)
    if structure is not None:
        driven = {strut: _motor_colour(motor) for motor, strut in enumerate(structure.motor_struts)}
        colours = [driven.get(strut, _STRUT) for strut in range(len(structure.struts))]
        recording.log("world/robot/struts", rr.LineStrips3D.from_fields(colors=colours, radii=0.003), static=True)
        recording.log("world/robot/springs", rr.LineStrips3D.from_fields(radii=0.0007), static=True)
        send_force_styles(recording)


def _send_speed_styles(recording: rr.RecordingStream) -> None:
    import rerun as rr

    for path, name, colour, width in (
        ("best_measured", "best measured so far", _TRAIL, 1.0),
        ("best_gait/mean", "best gait: posterior mean", _MEAN, 3.0),
        ("best_gait/low", "95 % low", _INTERVAL, 1.5),
        ("best_gait/high", "95 % high", _INTERVAL, 1.5),
    ):
        recording.log(f"speed/{path}", rr.SeriesLines(colors=colour, names=name, widths=width), static=True)
    points = rr.SeriesPoints(colors=_MEASURED, names="measured", markers="circle", marker_sizes=3.0)
    recording.log("speed/measured", points, static=True)


def _motor_colour(motor: int) -> _Colour:
    """Return the colour of a motor, counted from 0: of its strut and of its curves."""
    return _MOTORS[motor % len(_MOTORS)]


def _send_motor_style(recording: rr.RecordingStream, motor: int) -> None:
    import rerun as rr

    colour = _motor_colour(motor)
    faint = tuple(part // 2 for part in colour)
    for name, shade, width in (("commanded", faint, 3.0), ("applied", colour, 1.5)):
        style = rr.SeriesLines(colors=shade, names=f"motor {motor + 1} {name}", widths=width)
        recording.log(f"motors/{motor + 1}/{name}", style, static=True)


def _send_ground(recording: rr.RecordingStream, terrain: Terrain) -> None:
    """Send the ground as a mesh, with lines every 50 mm and a scale along its x axis."""
    import rerun as rr

    x, y, height = np.array(terrain.x_m), np.array(terrain.y_m), np.array(terrain.height_m)
    vertices = np.stack([*np.meshgrid(x, y, indexing="ij"), height], axis=-1).reshape(-1, 3)
    corner = np.arange(x.size * y.size).reshape(x.size, y.size)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    triangles = np.concatenate([np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, b, c), (a, c, d))])
    mesh = rr.Mesh3D(vertex_positions=vertices, triangle_indices=triangles, albedo_factor=_GROUND)
    recording.log("world/ground", mesh, static=True)
    across = [_line(at, x, y, height) for at in _ticks(x)]
    along = [_line(at, y, x, height.T)[:, [1, 0, 2]] for at in _ticks(y)]
    recording.log("world/ground/lines", rr.LineStrips3D([*across, *along], colors=_LINES, radii=0.0003), static=True)
    front_m = max(y[0], -2 * _GRID_M)
    marks = np.array([(line[0, 0], front_m, np.interp(front_m, y, line[:, 2])) for line in across[::2]]).reshape(-1, 3)
    labels = [f"{1000 * at:.0f} mm" for at in marks[:, 0]]
    scale = rr.Points3D(marks, labels=labels, colors=_LINES, radii=0.001, show_labels=True)
    recording.log("world/ground/scale", scale, static=True)


def _ticks(values: Array) -> list[float]:
    return [_GRID_M * step for step in range(math.ceil(values[0] / _GRID_M), math.floor(values[-1] / _GRID_M) + 1)]


def _line(at: float, axis: Array, other: Array, height: Array) -> Array:
    """Return a line over the ground at one value of ``axis``, a hair above it so as to be seen, shape (others, 3)."""
    return np.array([(at, end, np.interp(at, axis, height[:, i]) + 0.0005) for i, end in enumerate(other)])
