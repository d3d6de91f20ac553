"""A run as Rerun entities: the robot over its ground, its motors, the speeds, and the result of each trial.

Lines and points are sent in whole columns, which converts a run of forty trials in a moment.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Pose, Structure, Trial
from vvvaltr.controller.runs.log import find_trial_span_ns
from vvvaltr.controller.view.canvas import Canvas, When, join_strips
from vvvaltr.controller.view.chart import Axes, Entry, list_legend, send_axes, send_chart, send_chart_styles
from vvvaltr.controller.view.scatter_causes import ScatterCauses, find_causes, tell_scatter
from vvvaltr.controller.view.scene_causes import send_causes
from vvvaltr.controller.view.scene_forces import list_force_columns
from vvvaltr.controller.view.scene_goals import send_goals
from vvvaltr.controller.view.scene_photos import send_photos
from vvvaltr.controller.view.scene_styles import send_ground, send_motor_style, send_speed_styles, send_world_styles
from vvvaltr.controller.view.speed_maps import Belief, send_map_frames, send_maps
from vvvaltr.controller.view.watching import Moment
from vvvaltr.controller.view.words import describe, write_result, write_tables

_CAUSES = 6  # times at which a run's causes of scatter are looked for: it takes a quarter of a second
_LABEL_M = 0.07  # above the robot's centre
_ARROW_M = 0.06  # length of a heading's arrow


@dataclass(frozen=True, slots=True)
class _Placed:
    """A trial and its place on the time line, in seconds since the run began."""

    logged: LoggedTrial
    begin_s: float
    end_s: float

    @property
    def trial(self) -> Trial:
        return self.logged.trial

    @property
    def begin(self) -> When:
        return self.begin_s, self.trial.number

    @property
    def end(self) -> When:
        return self.end_s, self.trial.number


class Scene:
    """Sends a run to a Rerun recording, trial by trial or all at once, on the time lines ``time`` and ``trial``.

    Args:
        canvas: where to send to.
        structure: what to draw of the robot; None where that is unknown.
        planned: number of trials that the run is to make, for the axis; 0 where that is unknown.
        about: what the run was made with, in words.
    """

    def __init__(self, canvas: Canvas, structure: Structure | None, planned: int = 0, about: str = "") -> None:
        self._canvas = canvas
        self._structure = structure
        self._planned = planned
        self._about = about
        self._trials: list[LoggedTrial] = []
        self._ends: list[When] = []
        self._chart: tuple[Axes, tuple[Entry, ...]] | None = None
        self._causes: tuple[str, ...] = ()
        self._map_range_mm_s: tuple[float, float] | None = None
        self._named_motors = 0
        self._begin_ns: int | None = None
        self._end_ns = 0
        send_world_styles(canvas, structure)
        send_speed_styles(canvas)
        send_chart_styles(canvas)
        if structure is not None and structure.terrain is not None:
            send_ground(canvas, structure.terrain)

    @property
    def trials(self) -> Sequence[LoggedTrial]:
        """All trials that were sent."""
        return self._trials

    def remember(self, trials: Iterable[LoggedTrial]) -> None:
        """Take notice of trials that come before those that are sent: charts and tables count them."""
        for logged in trials:
            self._place(logged)
        self._begin_ns = None  # time begins with what is shown

    def add(self, trials: Iterable[LoggedTrial]) -> None:
        """Send trials that follow those sent before."""
        placed = [self._place(logged) for logged in trials]
        if placed:
            self._send_trails(placed)
            self._send_robot(placed)
            self._send_motors(placed)
            self._send_speeds(placed)
            axes = self._send_chart(placed)
            found = self._find_causes(len(placed))
            send_causes(self._canvas, axes, self._trials, [(self._ends[count - 1], it) for count, it in found])
            self._send_texts(placed, found)
            send_photos(self._canvas, [(it.begin, it.trial) for it in placed])
            send_goals(self._canvas, [(it.begin, it.logged) for it in placed])

    def show_moment(self, moment: Moment) -> None:
        """Send the last reading of a trial that still runs; the trial itself follows by ``add``."""
        begin_ns = max(round(moment.started_unix_s * 1e9), self._end_ns)
        begin_s = 0.0 if self._begin_ns is None else (begin_ns - self._begin_ns) / 1e9
        if moment.drive_s is None:
            return
        if moment.pose is not None:
            self._send_poses([((begin_s + max(0.0, moment.pose.t_s - moment.drive_s), moment.trial), moment.pose)])
        if moment.asked is None or moment.state is None:
            return
        when = begin_s + max(0.0, moment.state.t_s - moment.drive_s), moment.trial
        self._name_motors(moment.asked.motor_count)
        for name, series in (("commanded", moment.asked.frequency_hz), ("applied", moment.state.frequency_hz)):
            for motor, frequency_hz in enumerate(series, start=1):
                self._send_scalars(f"motors/{motor}/{name}", [when], [frequency_hz])

    def add_belief(self, belief: Belief) -> None:
        """Send the maps of what was believed after a trial that was sent before."""
        count = next(place for place, it in enumerate(self._trials, 1) if it.trial.number == belief.trial)
        range_mm_s = self._find_map_range_mm_s()
        if send_maps(self._canvas, belief, self._trials[:count], self._ends[count - 1], range_mm_s):
            if range_mm_s != self._map_range_mm_s:
                send_map_frames(self._canvas, belief.space, range_mm_s)
            self._map_range_mm_s = range_mm_s

    def _find_map_range_mm_s(self) -> tuple[float, float]:
        """Return the speeds at the ends of the maps' colours: those that were measured, so that dots and maps agree."""
        scores = [1000.0 * logged.score for logged in self._trials if logged.score is not None] or [0.0]
        return min(scores), max(*scores, min(scores) + 1e-3)

    def _place(self, logged: LoggedTrial) -> _Placed:
        begin_ns, self._end_ns = find_trial_span_ns(logged.trial, after_ns=self._end_ns)
        self._begin_ns = begin_ns if self._begin_ns is None else self._begin_ns
        placed = _Placed(logged, (begin_ns - self._begin_ns) / 1e9, (self._end_ns - self._begin_ns) / 1e9)
        self._trials.append(logged)
        self._ends.append(placed.end)
        return placed

    def _send_trails(self, placed: Sequence[_Placed]) -> None:
        """Send the whole path of each trial at its beginning, and its result above its start."""
        import rerun as rr

        begins = [it.begin for it in placed]
        paths = [np.reshape([pose.position_m for pose in it.trial.poses if pose.is_finite], (-1, 3)) for it in placed]
        strips = join_strips(np.concatenate(paths), list(map(len, paths)))
        self._canvas.send("world/trail", begins, rr.LineStrips3D.columns(strips=strips))
        places = [np.array([0.0, 0.0, _LABEL_M]) + (path[0] if len(path) else 0.0) for path in paths]
        labels = [f"trial {it.trial.number}: {describe(it.logged)}" for it in placed]
        self._canvas.send("world/label", begins, rr.Points3D.columns(positions=places, labels=labels))

    def _send_robot(self, placed: Sequence[_Placed]) -> None:
        self._send_poses(
            [
                ((it.begin_s + pose.t_s, it.trial.number), pose)
                for it in placed
                for pose in it.trial.poses
                if pose.is_finite
            ]
        )

    def _send_poses(self, poses: Sequence[tuple[When, Pose]]) -> None:
        import rerun as rr

        centres_m = np.reshape([pose.position_m for _, pose in poses], (-1, 3))
        self._canvas.send("world/robot/centre", [when for when, _ in poses], rr.Points3D.columns(positions=centres_m))
        self._send_headings([(when, pose) for when, pose in poses if not pose.markers_m])
        if self._structure is not None:
            self._send_edges("world/robot/struts", self._structure.struts, poses)
            self._send_edges("world/robot/springs", self._structure.springs, poses)
            for path, whens, columns in list_force_columns(self._structure, poses):
                self._canvas.send(path, whens, columns)

    def _send_headings(self, poses: Sequence[tuple[When, Pose]]) -> None:
        """Send an arrow for each pose in which the tracker saw only the robot's position and heading."""
        import rerun as rr

        arrows = np.reshape([(math.cos(pose.yaw_rad), math.sin(pose.yaw_rad), 0.0) for _, pose in poses], (-1, 3))
        origins = np.reshape([pose.position_m for _, pose in poses], (-1, 3))
        columns = rr.Arrows3D.columns(vectors=_ARROW_M * arrows, origins=origins)
        self._canvas.send("world/robot/heading", [when for when, _ in poses], columns)

    def _send_edges(self, path: str, edges: Sequence[tuple[int, int]], poses: Sequence[tuple[When, Pose]]) -> None:
        """Send a line for each pair of strut ends, for each pose in which the tracker saw all ends."""
        import rerun as rr

        ends = 1 + max((end for edge in edges for end in edge), default=0)
        seen = [(when, pose.markers_m[:ends]) for when, pose in poses if len(pose.markers_m) >= ends]
        if edges and seen:
            points = np.array([markers_m for _, markers_m in seen])[:, np.array(edges)].reshape(-1, 3)
            strips = join_strips(points, np.full(len(seen) * len(edges), 2))
            columns = rr.LineStrips3D.columns(strips=strips).partition([len(edges)] * len(seen))
            self._canvas.send(path, [when for when, _ in seen], columns)

    def _send_motors(self, placed: Sequence[_Placed]) -> None:
        trials = [it.trial for it in placed]
        motor_count = max(trial.gait.motor_count for trial in trials)
        self._name_motors(motor_count)
        for motor in range(motor_count):
            commanded = [_points(((it.t_s, it.gait.frequency_hz) for it in trial.commands), motor) for trial in trials]
            applied = [_points(((it.t_s, it.frequency_hz) for it in trial.states), motor) for trial in trials]
            self._send_curve(f"motors/{motor + 1}/commanded", placed, commanded)
            self._send_curve(f"motors/{motor + 1}/applied", placed, applied)
        self._send_faults(placed)

    def _name_motors(self, count: int) -> None:
        for motor in range(self._named_motors, count):
            send_motor_style(self._canvas, motor)
        self._named_motors = max(self._named_motors, count)

    def _send_curve(
        self, path: str, placed: Sequence[_Placed], curves: Sequence[Sequence[tuple[float, float]]]
    ) -> None:
        """Send a curve of (time, value) for each trial, with a gap after it."""
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

    def _find_causes(self, new: int) -> list[tuple[int, ScatterCauses]]:
        """Return, after some numbers of trials, what these said of the causes of scatter."""
        total = len(self._trials)
        every = max(5, math.ceil(new / _CAUSES))
        counts = [count for count in range(total - new + 1, total + 1) if count % every == 0]
        if new > 1 and counts[-1:] != [total]:
            counts.append(total)
        return [(count, find_causes(self._trials[:count])) for count in counts]

    def _send_texts(self, placed: Sequence[_Placed], found: Sequence[tuple[int, ScatterCauses]]) -> None:
        import rerun as rr

        first, ends = len(self._trials) - len(placed), [it.end for it in placed]
        sofar = [self._trials[: first + place] for place in range(1, len(placed) + 1)]
        about = f"\n\n{self._about}" if self._about else ""
        causes = dict(found)
        results = []
        for trials in sofar:
            if len(trials) in causes:
                told = tell_scatter(causes[len(trials)])
                self._causes = tuple(f"\n\n{word.capitalize()}: {sentence}" for word, sentence in told)
            results.append(write_result(trials) + "".join(self._causes) + about)
        for path, texts in (
            ("result", results),
            ("trials", write_tables(self._trials, list(map(len, sofar)))),
        ):
            media = ["text/markdown"] * len(texts)
            self._canvas.send(path, ends, rr.TextDocument.columns(text=texts, media_type=media))

    def _send_chart(self, placed: Sequence[_Placed]) -> Axes:
        """Send the chart of speeds and return its axes; where those of before no longer hold all trials, new ones."""
        axes, legend = Axes.around(self._trials, self._planned), list_legend(self._trials)
        if (axes, legend) != self._chart:
            self._chart = axes, legend
            send_axes(self._canvas, axes, legend, placed[0].begin if len(placed) > 1 else placed[0].end)
        send_chart(self._canvas, axes, self._trials, self._ends, len(placed))
        return axes

    def _send_faults(self, placed: Sequence[_Placed]) -> None:
        """Mark where a trial ended without a measurement, above the curves of the motors."""
        import rerun as rr

        failed = [it for it in placed if not it.trial.outcome.is_valid]
        heights = [max(map(abs, it.trial.gait.frequency_hz), default=0.0) for it in failed]
        self._canvas.send("motors/fault", [it.end for it in failed], rr.Scalars.columns(scalars=heights))

    def _send_scalars(self, path: str, whens: Sequence[When], values: Any) -> None:
        import rerun as rr

        self._canvas.send(path, whens, rr.Scalars.columns(scalars=values))


def _points(series: Iterable[tuple[float, Sequence[float]]], motor: int) -> list[tuple[float, float]]:
    return [(t_s, values[motor]) for t_s, values in series if motor < len(values)]
