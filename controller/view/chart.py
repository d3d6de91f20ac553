"""The speed of each trial against its number, as a drawing of its own.

Rerun's own plots have the time line as their axis, which says nothing of trials. This one shows what was measured, what
the model believes of the gait that it recommends, and its interval as a band; it grows as one goes through the run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.view.canvas import Canvas, When, join_strips
from vvvaltr.controller.view.scatter_causes import is_reference

_Point = tuple[float, float]
_Colour = tuple[int, int, int]
Entry = tuple[str, _Colour]
"""A kind of mark in the chart, and its colour."""

# In the drawing's own unit: its axes span 200 x 60, with room for labels around them. Down is positive.
_WIDE, _HIGH = 200.0, 60.0
CHART_X = (-16.0, _WIDE + 6.0)
CHART_Y = (-10.0, _HIGH + 13.0)
_BAND_STEP = 0.8
_ROWS = 300  # of the drawing in a run; a longer one is redrawn after every second trial, or every third, and so on

_TEXT: _Colour = (190, 194, 200)
_GRID: _Colour = (44, 48, 54)
_MEASURED: _Colour = (240, 240, 240)
_SUSPECT: _Colour = (255, 165, 60)
_REFERENCE: _Colour = (110, 230, 160)
_FAILED: _Colour = (255, 80, 70)
_MEAN: _Colour = (90, 190, 255)
_BAND: _Colour = (28, 66, 94)


@dataclass(frozen=True, slots=True)
class Axes:
    """The range of the chart: trials from 0 to ``trials``, speeds from ``low`` to ``high`` in mm/s."""

    trials: int
    low: float
    high: float

    @classmethod
    def around(cls, trials: Sequence[LoggedTrial], planned: int = 0) -> Axes:
        """Return axes that hold all that was measured, and what is believed last; earlier intervals may lie beyond."""
        last_high = [1000.0 * it.recommendation.estimate.high for it in trials[-1:] if it.recommendation]
        scores = [1000.0 * logged.score for logged in trials if logged.score is not None] or [1.0]
        step = nice_step(max(*scores, 1e-3) - min(*scores, 0.0), 4)
        low = step * math.floor(min(*scores, 0.0) / step)
        last = max((logged.trial.number for logged in trials), default=1)
        high = max(1.05 * max(scores), *(min(it, 2.0 * max(scores)) for it in last_high), 1e-3)
        return cls(max(last, planned, 2), low, step * math.ceil(high / step))

    def place(self, trial: float, speed_mm_s: float) -> _Point:
        """Return the place of a trial and a speed, which is kept within the axes."""
        share = (speed_mm_s - self.low) / (self.high - self.low)
        return _WIDE * trial / self.trials, _HIGH * (1.0 - min(1.0, max(0.0, share)))

    def places(self, trials: Array, speeds_mm_s: Array) -> Array:
        """Return the places (n, 2) of trials (n,) and speeds (n,), as ``place`` does of one."""
        shares = (speeds_mm_s - self.low) / (self.high - self.low)
        return np.stack([_WIDE * trials / self.trials, _HIGH * (1.0 - np.clip(shares, 0.0, 1.0))], axis=1)


def nice_step(span: float, count: int) -> float:
    """Return 1, 2 or 5 times a power of ten, so that about ``count`` of them make up ``span``."""
    power = 10.0 ** math.floor(math.log10(span / count))
    return power * min((1.0, 2.0, 5.0, 10.0), key=lambda factor: abs(factor - span / count / power))


def ticks(low: float, high: float, count: int) -> list[float]:
    """Return about ``count`` round numbers from ``low`` to ``high``."""
    step = nice_step(high - low, count)
    return [step * place for place in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def send_axes(canvas: Canvas, axes: Axes, legend: Sequence[Entry], when: When) -> None:
    """Send grid, ticks, units and the legend, from ``when`` on."""
    import rerun as rr

    speeds, numbers = ticks(axes.low, axes.high, 4), ticks(0, axes.trials, 8)
    grid = [[axes.place(0, y), axes.place(axes.trials, y)] for y in speeds]
    canvas.send("chart/grid", [when], rr.LineStrips2D.columns(strips=grid).partition([len(grid)]))
    # Rerun writes a label a little below its place.
    texts = [((-4.5, axes.place(0, y)[1] - 3.0), f"{y:g}", _TEXT) for y in speeds]
    texts += [((axes.place(x, 0)[0], _HIGH + 0.5), f"{x:g}", _TEXT) for x in numbers if x == round(x)]
    texts += [((_WIDE / 2, _HIGH + 6.0), "trial", _TEXT), ((-6.0, -10.0), "mm/s", _TEXT)]
    step = 190.0 / len(legend)
    texts += [((12.0 + step * (place + 0.5), -10.0), text, colour) for place, (text, colour) in enumerate(legend)]
    places, labels, colours = zip(*texts, strict=True)
    columns = rr.Points2D.columns(positions=places, labels=labels, colors=colours, radii=[0.0] * len(texts))
    canvas.send("chart/axes", [when], columns.partition([len(texts)]))


def list_legend(trials: Sequence[LoggedTrial]) -> tuple[Entry, ...]:
    """Return what the chart of ``trials`` shows, with its colours."""
    has_belief = any(logged.recommendation is not None for logged in trials)
    entries = (
        ("measured", _MEASURED, True),
        ("reference", _REFERENCE, any(map(is_reference, trials))),
        ("suspect", _SUSPECT, any(logged.review.is_suspect for logged in trials)),
        ("nothing measured", _FAILED, any(logged.score is None for logged in trials)),
        ("best gait: mean", _MEAN, has_belief),
        ("its 95 % interval", (70, 130, 175), has_belief),
    )
    return tuple((text, colour) for text, colour, occurs in entries if occurs)


def send_chart_styles(canvas: Canvas) -> None:
    """Send what stays the same: sizes, and what lies above what."""
    import rerun as rr

    def ui(points: float) -> float:
        return -points  # Rerun takes a negative radius as a size on the screen

    for path, style in (
        ("grid", rr.LineStrips2D.from_fields(colors=_GRID, radii=ui(0.5), draw_order=1.0)),
        ("band", rr.LineStrips2D.from_fields(colors=_BAND, radii=0.55 * _BAND_STEP, draw_order=2.0)),
        ("mean", rr.LineStrips2D.from_fields(colors=_MEAN, radii=ui(1.2), draw_order=3.0)),
        ("measured", rr.Points2D.from_fields(radii=ui(2.6), draw_order=4.0)),
        ("axes", rr.Points2D.from_fields(show_labels=True, draw_order=5.0)),
    ):
        canvas.log(f"chart/{path}", style)


def send_chart(canvas: Canvas, axes: Axes, trials: Sequence[LoggedTrial], ends: Sequence[When], new: int) -> None:
    """Send the chart after each of the last ``new`` trials; ``ends`` holds when each trial ended."""
    import rerun as rr

    rows = list(_rows(len(trials), new, every=1 + len(trials) // _ROWS))
    whens = [ends[row - 1] for row in rows]
    marks = [_mark(axes, logged) for logged in trials]
    places = axes.places(*np.array([place for place, _ in marks]).T)
    colours = np.array([colour for _, colour in marks], dtype=np.uint8)
    measured = rr.Points2D.columns(
        positions=np.concatenate([places[:row] for row in rows]),
        colors=np.concatenate([colours[:row] for row in rows]),
    )
    canvas.send("chart/measured", whens, measured.partition(rows))
    known = [logged for logged in trials if logged.recommendation is not None]
    if not known:
        return
    curves = _curves(axes, known)
    counts = [sum(logged.trial.number <= trials[row - 1].trial.number for logged in known) for row in rows]
    believed = [(when, count) for when, count in zip(whens, counts, strict=True) if count]
    _send_belief(canvas, axes, curves, believed)


def _send_belief(canvas: Canvas, axes: Axes, curves: Array, believed: Sequence[tuple[When, int]]) -> None:
    """Send mean and band of the first so many columns of ``curves``, for each time and number in ``believed``."""
    import rerun as rr

    whens, counts = [when for when, _ in believed], [count for _, count in believed]
    means = axes.places(*curves[:2])
    strips = join_strips(np.concatenate([means[:count] for count in counts]), counts)
    canvas.send("chart/mean", whens, rr.LineStrips2D.columns(strips=strips))
    bands = [_band(axes, curves[:, :count]) for count in counts]
    lines = np.concatenate(bands)
    columns = rr.LineStrips2D.columns(strips=join_strips(lines.reshape(-1, 2), np.full(len(lines), 2)))
    canvas.send("chart/band", whens, columns.partition(list(map(len, bands))))


def _rows(count: int, new: int, every: int) -> Iterator[int]:
    """Yield after how many trials the chart is drawn; after the last one in any case."""
    for row in range(count - new + 1, count + 1):
        if row == count or row % every == 0:
            yield row


def _mark(axes: Axes, logged: LoggedTrial) -> tuple[tuple[float, float], _Colour]:
    """Return number, speed in mm/s and colour of a trial; one that measured nothing is at the bottom."""
    if logged.score is None:
        return (logged.trial.number, axes.low), _FAILED
    colour = _SUSPECT if logged.review.is_suspect else _REFERENCE if is_reference(logged) else _MEASURED
    return (logged.trial.number, 1000.0 * logged.score), colour


def _curves(axes: Axes, known: Sequence[LoggedTrial]) -> Array:
    """Return trial, mean, low and high in mm/s of each recommendation, shape (4, recommendations)."""
    estimates = [(logged.trial.number, logged.recommendation.estimate) for logged in known if logged.recommendation]
    rows = [(number, 1000.0 * it.mean, 1000.0 * it.low, 1000.0 * it.high) for number, it in estimates]
    curves: Array = np.clip(np.array(rows).T, [[0.0]] + [[axes.low]] * 3, [[axes.trials]] + [[axes.high]] * 3)
    return curves


def _band(axes: Axes, curves: Array) -> Array:
    """Return upright lines (n, 2, 2), side by side, that fill the interval."""
    step = _BAND_STEP * axes.trials / _WIDE
    numbers, _, low, high = curves
    x = np.arange(numbers[0], numbers[-1] + step / 2, step)
    return np.stack([axes.places(x, np.interp(x, numbers, side)) for side in (low, high)], axis=1)
