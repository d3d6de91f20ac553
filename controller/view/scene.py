"""A run as Rerun entities: the robot over its ground, its motors, the speeds, and the result of each trial.

Lines and points are sent in whole columns, which converts a run of forty trials in a moment.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Gait, Pose, Structure, Trial
from vvvaltr.controller.runs.log import find_trial_span_ns
from vvvaltr.controller.view.scene_forces import list_force_columns
from vvvaltr.controller.view.scene_styles import send_ground, send_motor_style, send_speed_styles, send_world_styles

if TYPE_CHECKING:
    import rerun as rr

_When = tuple[float, int]  # seconds since the run began, number of the trial

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
    def begin(self) -> _When:
        return self.begin_s, self.trial.number

    @property
    def end(self) -> _When:
        return self.end_s, self.trial.number


class Scene:
    """Sends a run to a Rerun recording, trial by trial or all at once, on the time lines ``time`` and ``trial``.

    Args:
        recording: recording to send to.
        structure: what to draw of the robot; None where that is unknown.
    """

    def __init__(self, recording: rr.RecordingStream, structure: Structure | None) -> None:
        self._recording = recording
        self._structure = structure
        self._trials: list[LoggedTrial] = []
        self._begin_ns: int | None = None
        self._end_ns = 0
        send_world_styles(recording, structure)
        send_speed_styles(recording)
        if structure is not None and structure.terrain is not None:
            send_ground(recording, structure.terrain)

    @property
    def trials(self) -> Sequence[LoggedTrial]:
        """All trials that were sent."""
        return self._trials

    def add(self, trials: Iterable[LoggedTrial]) -> None:
        """Send trials that follow those sent before."""
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
        """Send the whole path of each trial at its beginning, and its result above its start."""
        import rerun as rr

        begins = [it.begin for it in placed]
        paths = [np.reshape([pose.position_m for pose in it.trial.poses if pose.is_finite], (-1, 3)) for it in placed]
        self._send("world/trail", begins, rr.LineStrips3D.columns(strips=paths))
        places = [np.array([0.0, 0.0, _LABEL_M]) + (path[0] if len(path) else 0.0) for path in paths]
        labels = [f"trial {it.trial.number}: {_describe(it.logged)}" for it in placed]
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
            for path, whens, columns in list_force_columns(self._structure, poses):
                self._send(path, whens, columns)

    def _send_headings(self, poses: Sequence[tuple[_When, Pose]]) -> None:
        """Send an arrow for each pose in which the tracker saw only the robot's position and heading."""
        import rerun as rr

        arrows = np.reshape([(math.cos(pose.yaw_rad), math.sin(pose.yaw_rad), 0.0) for _, pose in poses], (-1, 3))
        origins = np.reshape([pose.position_m for _, pose in poses], (-1, 3))
        columns = rr.Arrows3D.columns(vectors=_ARROW_M * arrows, origins=origins)
        self._send("world/robot/heading", [when for when, _ in poses], columns)

    def _send_edges(self, path: str, edges: Sequence[tuple[int, int]], poses: Sequence[tuple[_When, Pose]]) -> None:
        """Send a line for each pair of strut ends, for each pose in which the tracker saw all ends."""
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
            send_motor_style(self._recording, motor)
            commanded = [_points(((it.t_s, it.gait.frequency_hz) for it in trial.commands), motor) for trial in trials]
            applied = [_points(((it.t_s, it.frequency_hz) for it in trial.states), motor) for trial in trials]
            self._send_curve(f"motors/{motor + 1}/commanded", placed, commanded)
            self._send_curve(f"motors/{motor + 1}/applied", placed, applied)

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

    def _send_texts(self, placed: Sequence[_Placed]) -> None:
        import rerun as rr

        lines = [
            f"{it.trial.number}: {_describe(it.logged)}, {_write_gait(it.trial.gait)} ({it.logged.suggestion.origin})"
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


def _write_gait(gait: Gait) -> str:
    """Return the frequencies of a gait as text."""
    return " / ".join(f"{frequency:.1f}" for frequency in gait.frequency_hz) + " Hz"


def write_result(trials: Sequence[LoggedTrial]) -> str:
    """Return the result of a run as Markdown."""
    outcomes = Counter(logged.trial.outcome.value.replace("_", " ") for logged in trials)
    counts = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common())
    recommended = [logged.recommendation for logged in trials if logged.recommendation is not None]
    measured = [logged for logged in trials if logged.score is not None]
    if not recommended or not measured:
        return f"### No gait yet\n\nTrials: {counts}."
    best, luckiest = recommended[-1], max(measured, key=lambda logged: logged.score or 0.0)
    estimate = best.estimate
    return (
        f"### Best gait: {_write_gait(best.gait)}\n\n"
        f"**{1000 * estimate.mean:.1f} mm/s** (posterior mean), "
        f"95 % interval {1000 * estimate.low:.1f} to {1000 * estimate.high:.1f} mm/s\n\n"
        f"{len(trials)} trials: {counts}\n\n"
        f"The fastest single trial was {luckiest.trial.number} with {_describe(luckiest)}; one trial alone may be luck."
    )


def _describe(logged: LoggedTrial) -> str:
    if logged.score is None:
        return f"{logged.trial.outcome.value.replace('_', ' ')}: {logged.trial.reason}"
    return f"{1000 * logged.score:.1f} mm/s"
