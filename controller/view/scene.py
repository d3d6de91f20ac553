"""A run as Rerun entities: the robot over its ground, its motors, the speeds, and the result of each trial.

Lines and points are sent in whole columns, which converts a run of forty trials in a moment.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Pose, Structure, Trial
from vvvaltr.controller.runs.log import find_trial_span_ns
from vvvaltr.controller.view.canvas import Canvas, When, Whens, join_strips
from vvvaltr.controller.view.chart import Axes, Entry, list_legend, send_axes, send_chart, send_chart_styles
from vvvaltr.controller.view.scatter_causes import ScatterCauses, find_causes, tell_scatter
from vvvaltr.controller.view.scene_causes import send_causes
from vvvaltr.controller.view.scene_goals import send_goals
from vvvaltr.controller.view.scene_photos import send_photos
from vvvaltr.controller.view.scene_robot import find_path_m, list_drawable, send_poses
from vvvaltr.controller.view.scene_styles import send_ground, send_motor_style, send_speed_styles, send_world_styles
from vvvaltr.controller.view.speed_maps import Belief, send_map_frames, send_maps
from vvvaltr.controller.view.watching import Moment
from vvvaltr.controller.view.words import describe, write_result, write_tables

_CAUSES = 6  # times at which a run's causes of scatter are looked for: it takes a quarter of a second
_LABEL_M = 0.07  # above the robot's centre


@dataclass(frozen=True, slots=True)
class _Placed:
    """A trial and its place on the time line, in seconds since the run began."""

    logged: LoggedTrial
    poses: Sequence[Pose]  # those that can be drawn
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
            when = begin_s + max(0.0, moment.pose.t_s - moment.drive_s), moment.trial
            send_poses(self._canvas, self._structure, np.array([when]), [moment.pose])
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
        begin_s, end_s = ((at_ns - self._begin_ns) / 1e9 for at_ns in (begin_ns, self._end_ns))
        placed = _Placed(logged, list_drawable(logged.trial), begin_s, end_s)
        self._trials.append(logged)
        self._ends.append(placed.end)
        return placed

    def _send_trails(self, placed: Sequence[_Placed]) -> None:
        """Send the whole path of each trial at its beginning, and its result above its start."""
        import rerun as rr

        begins = [it.begin for it in placed]
        paths = [find_path_m(it.poses) for it in placed]
        strips = join_strips(np.concatenate(paths), list(map(len, paths)))
        self._canvas.send("world/trail", begins, rr.LineStrips3D.columns(strips=strips))
        places = [np.array([0.0, 0.0, _LABEL_M]) + (path[0] if len(path) else 0.0) for path in paths]
        labels = [f"trial {it.trial.number}: {describe(it.logged)}" for it in placed]
        self._canvas.send("world/label", begins, rr.Points3D.columns(positions=places, labels=labels))

    def _send_robot(self, placed: Sequence[_Placed]) -> None:
        whens = [(it.begin_s + pose.t_s, it.trial.number) for it in placed for pose in it.poses]
        poses = [pose for it in placed for pose in it.poses]
        send_poses(self._canvas, self._structure, np.reshape(whens, (-1, 2)), poses)

    def _send_motors(self, placed: Sequence[_Placed]) -> None:
        motor_count = max(it.trial.gait.motor_count for it in placed)
        self._name_motors(motor_count)
        commanded = [[(each.t_s, *each.gait.frequency_hz) for each in it.trial.commands] for it in placed]
        applied = [[(each.t_s, *each.frequency_hz) for each in it.trial.states] for it in placed]
        for name, series in (("commanded", commanded), ("applied", applied)):
            whens, values_hz = _join_curves(placed, series, motor_count)
            for motor in range(motor_count):
                self._send_scalars(f"motors/{motor + 1}/{name}", whens, values_hz[:, motor])
        self._send_faults(placed)

    def _name_motors(self, count: int) -> None:
        for motor in range(self._named_motors, count):
            send_motor_style(self._canvas, motor)
        self._named_motors = max(self._named_motors, count)

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

    def _send_scalars(self, path: str, whens: Whens, values: Any) -> None:
        import rerun as rr

        self._canvas.send(path, whens, rr.Scalars.columns(scalars=values))


def _join_curves(
    placed: Sequence[_Placed], curves: Sequence[Sequence[tuple[float, ...]]], motors: int
) -> tuple[Array, Array]:
    """Return times and trials (n, 2), and a value for each motor (n, motors), with a gap after each trial.

    Each row of a trial's curve is a time and the values; where it lacks a motor's, there is a gap.
    """
    tables = []
    for it, rows in zip(placed, curves, strict=True):
        table = np.full((len(rows) + 1, 2 + motors), math.nan)
        if rows:
            columns = np.array(list(zip_longest(*rows, fillvalue=math.nan)))[: 1 + motors]
            table[:-1, 1 : 1 + len(columns)] = columns.T
        table[:, 0] = it.trial.number
        table[:-1, 1] += it.begin_s
        table[-1, 1] = it.end_s
        tables.append(table)
    joined = np.concatenate(tables)
    return joined[:, [1, 0]], joined[:, 2:]
