"""Figures of a run's report. Shapes and brightness tell what colours tell, so that they can be read in grey."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.view.run_findings import LeftOut, RunFindings
from vvvaltr.controller.view.speed_maps import list_pairs, speeds_mm_s

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BLUE, _ORANGE, _GREY, _DARK = "#0b6fb8", "#c1640e", "#8a8a8a", "#333333"
_SIZE = (4.7, 3.1)  # inches: letters of 9 points can be read where the page is 400 pixels wide
_POINTS = 31
_MOST_SURFACES = 6
_MARKERS = "os^Dv<>ph*"


def _make(width: float = _SIZE[0], height: float = _SIZE[1]) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots()
    _calm(axes)
    return figure, axes


def _calm(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=9)


def draw_convergence(found: RunFindings) -> Figure:
    """Draw the speed of each trial, and what was believed of the recommended gait after it, with its interval."""
    figure, axes = _make()
    valid = found.valid
    known = [(it.trial.number, it.recommendation.estimate) for it in found.run.trials if it.recommendation is not None]
    if known:
        numbers = [number for number, _ in known]
        low, mean, high = (
            [1000.0 * getattr(estimate, side) for _, estimate in known] for side in ("low", "mean", "high")
        )
        axes.fill_between(numbers, low, high, color=_BLUE, alpha=0.22, linewidth=0, label="its 95 % interval")
        axes.plot(numbers, mean, color=_BLUE, linewidth=1.8, label="best gait: mean")
    for is_suspect, marker, label in ((False, "o", "measured"), (True, "D", "suspect")):
        shown = [it for it in valid if it.review.is_suspect == is_suspect]
        if shown:
            speeds = [1000.0 * (it.score or 0.0) for it in shown]
            face = _ORANGE if is_suspect else _DARK
            axes.plot([it.trial.number for it in shown], speeds, marker, color=face, markersize=3.2, label=label)
    lost = [it.trial.number for it in found.run.trials if it.score is None]
    # All but the intervals of before the last one, the first of which may be as wide as all that is possible.
    seen = [*(1000.0 * (it.score or 0.0) for it in valid), *(1000.0 * it.mean for _, it in known)]
    bottom, top = min(0.0, *seen), max(*seen, *(1.02 * 1000.0 * it.high for _, it in known[-1:]), 1e-3)
    if lost:
        axes.plot(lost, [bottom] * len(lost), "x", color="#b00020", clip_on=False, label="nothing measured")
    axes.set(xlabel="trial", ylabel="speed (mm/s)", ylim=(bottom - 0.03 * (top - bottom), 1.1 * top))
    axes.legend(fontsize=8, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return figure


def draw_left_out(left_out: LeftOut) -> Figure:
    """Draw what was observed against what all other trials let expect."""
    figure, axes = _make(height=3.6)
    median, observed = 1000.0 * left_out.median_m_s, 1000.0 * left_out.observed_m_s
    within = (left_out.low_m_s <= left_out.observed_m_s) & (left_out.observed_m_s <= left_out.high_m_s)
    reach = [median - 1000.0 * left_out.low_m_s, 1000.0 * left_out.high_m_s - median]
    axes.errorbar(median, observed, xerr=reach, fmt="none", ecolor=_GREY, elinewidth=0.6, alpha=0.6)
    axes.plot(median[within], observed[within], "o", color=_BLUE, markersize=3.5, label="within its interval")
    axes.plot(median[~within], observed[~within], "D", color=_ORANGE, markersize=4.5, label="outside")
    bottom, top = min(0.0, float(observed.min())), float(observed.max())
    margin = 0.08 * (top - bottom)  # where all were slower than 0, too
    low, high = bottom - margin if bottom < 0.0 else 0.0, top + margin
    axes.plot([low, high], [low, high], color=_DARK, linewidth=0.8, linestyle="--")
    axes.set(xlim=(low, high), ylim=(low, high), xlabel="expected from all others (mm/s)", ylabel="observed (mm/s)")
    axes.legend(fontsize=8, frameon=False, loc="upper left")
    return figure


def draw_outcomes(found: RunFindings) -> Figure:
    """Draw how many trials ended in which way."""
    counts = Counter(it.trial.outcome.words for it in found.run.trials).most_common()
    figure, axes = _make(height=0.7 + 0.3 * len(counts))
    bars = axes.barh([name for name, _ in counts], [count for _, count in counts], color=_BLUE, height=0.6)
    axes.bar_label(bars, fontsize=9, padding=3)
    axes.invert_yaxis()
    axes.set(xlabel="trials")
    return figure


def draw_motors(found: RunFindings) -> Figure | None:
    """Draw what each motor applied against what was asked of it, a point per trial; None where none told."""
    told = [(it.trial.gait.frequency_hz, it.applied.mean_hz) for it in found.run.trials if it.applied is not None]
    if not told:
        return None
    motors = len(told[0][0])
    columns = 1 if motors <= len(_MARKERS) else 6
    figure, axes = _make(height=3.4 + (0.17 * motors / columns if columns > 1 else 0.0))
    for motor in range(motors):
        marker = _MARKERS[(motor + motor // len(_MARKERS)) % len(_MARKERS)]  # colours begin again after ten, too
        pairs = [(asked[motor], mean[motor]) for asked, mean in told if motor < len(mean)]
        axes.plot(*zip(*pairs, strict=True), marker, markersize=3.8, alpha=0.75, label=f"motor {motor + 1}")
    reach = [min(min(a) for a, _ in told), max(max(a) for a, _ in told)]
    axes.plot(reach, reach, color=_DARK, linewidth=0.8, linestyle="--")
    axes.set(xlabel="asked (Hz)", ylabel="applied, mean of the drive (Hz)")
    if columns == 1:
        axes.legend(fontsize=8, frameon=False)
    else:
        axes.legend(fontsize=6, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns)
    return figure


def draw_drift(left_out: LeftOut) -> Figure:
    """Draw how far each trial lies from what all others let expect, in the order of the trials."""
    figure, axes = _make()
    numbers = np.array([it.trial.number for it in left_out.trials])
    axes.axhspan(-1.96, 1.96, color=_GREY, alpha=0.15, linewidth=0)
    axes.axhline(0.0, color=_DARK, linewidth=0.8)
    axes.plot(numbers, left_out.surprise, "o", color=_BLUE, markersize=3.5)
    if (drift := left_out.drift) is not None:
        ends = left_out.surprise.mean() + drift.mean * np.array([-0.5, 0.5])
        axes.plot(numbers[[0, -1]], ends, color=_ORANGE, linewidth=1.6)
    axes.set(xlabel="trial", ylabel="observed minus expected (sd)")
    return figure


def draw_starts(found: RunFindings) -> Figure | None:
    """Draw where the trials began, with the heading there, and where they ended; None where no pose tells."""
    moved = [it.movement for it in found.run.trials if it.movement is not None]
    if not moved:
        return None
    figure, axes = _make(height=3.6)
    starts, ends = (1000.0 * np.array([getattr(it, side).position_m[:2] for it in moved]) for side in ("start", "end"))
    yaws = np.array([it.start.yaw_rad for it in moved])
    axes.plot(*ends.T, "o", color=_GREY, markersize=3.0, markerfacecolor="none", label="end")
    axes.quiver(*starts.T, np.cos(yaws), np.sin(yaws), color=_BLUE, width=0.004, scale=16, label="start, with heading")
    axes.set(xlabel="x (mm)", ylabel="y (mm)")
    axes.set_aspect("equal", "datalim")
    axes.margins(0.15)
    axes.legend(fontsize=8, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return figure


def draw_surfaces(found: RunFindings) -> list[tuple[str, Figure]]:
    """Draw the expected speed over each pair of motors, all else as in the best gait; nothing where there is no model.

    Returns the name of each pair, and its figure.
    """
    pairs = list_pairs(found.space)[:_MOST_SURFACES] if found.space else ()
    if found.optimizer is None or not found.ranked:
        return []
    best = found.ranked[0][0]
    layers = [speeds_mm_s(found.optimizer.predict, pair, best, _POINTS) for pair in pairs]
    low, high = min(map(np.min, layers), default=0.0), max(map(np.max, layers), default=1.0)
    surfaces = []
    for pair, layer in zip(pairs, layers, strict=True):
        figure, axes = _make(height=3.5)
        ticks = [np.linspace(p.low, p.high, _POINTS) for p in pair]
        mesh = axes.pcolormesh(*ticks, layer, vmin=low, vmax=high, shading="gouraud", cmap="viridis", rasterized=True)
        axes.plot(*_at(found.valid, pair[0].motor, pair[1].motor), "o", color="white", markersize=3.5,
                  markeredgecolor="black", markeredgewidth=0.7)  # fmt: skip
        axes.plot(best.frequency_hz[pair[0].motor], best.frequency_hz[pair[1].motor], "*", color="white",
                  markersize=14, markeredgecolor="black", clip_on=False)  # fmt: skip
        axes.set(xlabel=f"motor {pair[0].motor + 1} (Hz)", ylabel=f"motor {pair[1].motor + 1} (Hz)")
        figure.colorbar(mesh, ax=axes, label="expected speed (mm/s)")
        surfaces.append((f"motors {pair[0].motor + 1} and {pair[1].motor + 1}", figure))
    return surfaces


def _at(trials: tuple[LoggedTrial, ...], first: int, second: int) -> tuple[list[float], list[float]]:
    gaits = [it.trial.gait.frequency_hz for it in trials]
    return [hz[first] for hz in gaits], [hz[second] for hz in gaits]


def draw_trust(found: RunFindings) -> Figure | None:
    """Draw how far each source was trusted after each trial, from 0 to 1; None for methods that do not tell."""
    curves: dict[str, list[tuple[int, float]]] = {}
    for it in found.run.trials:
        for name, value in it.suggestion.hyperparameters.items():
            if name.endswith("_trust"):
                curves.setdefault(name, []).append((it.trial.number, value))
    if not curves:
        return None
    figure, axes = _make(height=2.4)
    for (name, points), style in zip(curves.items(), ("-", "--", ":", "-.") * len(curves), strict=False):
        label = name.removesuffix("_trust").replace("_", " ")
        axes.plot(*zip(*points, strict=True), style, linewidth=1.8, label=label)
    axes.set(xlabel="trial", ylabel="trust", ylim=(-0.03, 1.03))
    axes.legend(fontsize=8, frameon=False)
    return figure
