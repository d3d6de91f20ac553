"""Figures of a campaign's findings. Plain-BO is grey, methods with a source are blue, methods without one red."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.experiments.findings import MethodFindings, PairFindings, Runs, plain_level_m_s
from vvvaltr.transfer.experiments.statistics import mean_interval
from vvvaltr.transfer.experiments.surfaces import Surfaces
from vvvaltr.transfer.methods.registry import METHODS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GREY, BLUE, RED = "#6b6b6b", "#0b6fb8", "#c1440e"


def colour(method: str) -> str:
    """Return the colour of a method."""
    if method == "plain":
        return GREY
    return BLUE if METHODS[method].uses_sources else RED


def draw_overview(found: Sequence[PairFindings]) -> Figure:
    """Draw each method's gain in true speed on each experiment, after 10 and 20 trials and at the end."""
    columns = min(4, len(found))
    figure, panels = _make_panels(len(found), columns, height=2.9)
    for axes, pair in zip(panels, found, strict=False):
        names = [name for name in pair.methods if name != "plain"]
        shown = list(zip(pair.checkpoint_names(), range(len(pair.checkpoints)), strict=True))[-3:]
        for row, name in enumerate(names):
            for place, (_, at) in enumerate(shown):
                _draw_gain(axes, pair.methods[name], at, row + 0.26 * (place - 1), 0.4 + 0.3 * place, colour(name))
        axes.axvline(0.0, color=GREY, linewidth=1.0)
        axes.axvline(-5.0, color=GREY, linewidth=0.8, linestyle=":")
        axes.set(ylim=(len(names) - 0.4, -0.6), yticks=range(len(names)))
        axes.set_yticklabels(names)
        axes.set_title(fill(f"{pair.pair.key}: {pair.pair.title}", 32), fontsize=9)
        axes.set_xlabel("faster than Plain-BO (%)", fontsize=9)
    ends = ", ".join("the end" if name == "end" else f"{name} trials" for name, _ in shown)
    figure.suptitle(
        f"Gain in true speed and its 95 % interval,\nin each row from pale to strong after {ends}", fontsize=10
    )
    return figure


def _draw_gain(axes: Axes, method: MethodFindings, at: int, y: float, alpha: float, shade: str) -> None:
    it = method.against_plain[at]
    if (reach := it.interval_percent) is not None:
        axes.plot([reach.low, reach.high], [y, y], color=shade, alpha=alpha, linewidth=2.2, solid_capstyle="butt")
    axes.plot([it.gain_percent], [y], "o", color=shade, alpha=alpha, markersize=4.0)


def draw_true_speed(found: PairFindings) -> Figure:
    """Draw the true mean speed of the recommended gait against the trial, each method beside Plain-BO."""

    def draw(axes: Axes, runs: Runs, shade: str) -> None:
        _draw_band(axes, found.checkpoints, runs.true_m_s.mean(axis=1), shade, marker="o")

    highest_m_s = max(float(it.runs.mean_true_m_s.max()) for it in found.methods.values())
    return _draw_beside_plain(found, draw, "true speed of the\nrecommended gait (mm/s)", highest_m_s)


def draw_best_so_far(found: PairFindings) -> Figure:
    """Draw the best observed speed so far against the trial, as the thesis does, each method beside Plain-BO."""
    level_mm_s = 1000.0 * plain_level_m_s(found.plain.runs)

    def draw(axes: Axes, runs: Runs, shade: str) -> None:
        _draw_band(axes, range(1, found.checkpoints[-1] + 1), runs.best_m_s.mean(axis=1), shade)
        axes.axhline(level_mm_s, color=GREY, linewidth=0.8, linestyle=":")

    highest_m_s = max(float(it.runs.best_m_s.mean(axis=(0, 1)).max()) for it in found.methods.values())
    figure = _draw_beside_plain(found, draw, "best observed\nso far (mm/s)", highest_m_s)
    for axes, (name, method) in zip(figure.axes, _others(found), strict=False):
        if math.isfinite(method.trials_to_plain_level):
            axes.plot([method.trials_to_plain_level], [level_mm_s], "v", color=colour(name), markersize=6.0)
    return figure


def draw_learned(found: Surfaces, pair: PairFindings) -> Figure:
    """Draw the learned surfaces of source and target side by side. A star marks the target's best gait on both."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.6, 8.4), layout="constrained")
    grid = figure.subplots(3, 2, sharex=True, sharey=True)
    both = (
        ("source", pair.pair.source.title, [it.source_m_s for it in found.slices]),
        ("target", pair.pair.target.title, [it.target_m_s for it in found.slices]),
    )
    for column, (role, title, layers) in enumerate(both):
        low, high = 1000.0 * min(map(np.min, layers)), 1000.0 * max(map(np.max, layers))
        for axes, cut, layer in zip(grid[:, column], found.slices, layers, strict=True):
            both_hz = found.frequency_hz, found.frequency_hz
            mesh = axes.pcolormesh(*both_hz, 1000.0 * layer, vmin=low, vmax=high, shading="gouraud")
            first, second = cut.motors
            axes.plot([found.best_hz[first]], [found.best_hz[second]], "*", color="white", markersize=13.0,
                      markeredgecolor="black", clip_on=False)  # fmt: skip
            (third,) = {0, 1, 2} - set(cut.motors)
            how = f"at {cut.held_hz:.1f} Hz" if cut.held_hz else "off"
            axes.set_title(f"motor {third + 1} {how}", fontsize=9)
            axes.set(xlabel=f"motor {first + 1} (Hz)", ylabel=f"motor {second + 1} (Hz)")
            axes.tick_params(labelbottom=True)
        figure.colorbar(mesh, ax=list(grid[:, column]), label="expected speed (mm/s)", location="bottom", shrink=0.8)
        grid[0, column].set_title(
            f"{role}: {title}{_how_changed(role, pair)}\n\n" + grid[0, column].get_title(), fontsize=9
        )
    return figure


def _how_changed(role: str, pair: PairFindings) -> str:
    if role != "source" or not (pair.pair.inverted or pair.pair.shuffled):
        return ""
    return f" (before its scores are {'turned upside down' if pair.pair.inverted else 'dealt out by strength'})"


def _others(found: PairFindings) -> list[tuple[str, MethodFindings]]:
    return [(name, method) for name, method in found.methods.items() if name != "plain"]


def _draw_beside_plain(
    found: PairFindings, draw: Callable[[Axes, Runs, str], None], label: str, highest_m_s: float
) -> Figure:
    """Draw a panel for each method. The axis of speeds leaves room for bands above the highest mean."""
    others = _others(found)
    columns = min(4, len(others))
    figure, panels = _make_panels(len(others), columns, height=2.3, share=True)
    for place, (axes, (name, method)) in enumerate(zip(panels, others, strict=False)):
        draw(axes, found.plain.runs, GREY)
        draw(axes, method.runs, colour(name))
        axes.set_title(name + ("" if METHODS[name].uses_sources else " (no source)"), color=colour(name), fontsize=10)
        axes.set(xlim=(0, found.checkpoints[-1]), ylim=(0, 1400.0 * highest_m_s))
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("trial", fontsize=9)
        if place % columns == 0:
            axes.set_ylabel(label, fontsize=9)
    return figure


def _make_panels(count: int, columns: int, height: float, share: bool = False) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    rows = math.ceil(count / columns)
    figure = Figure(figsize=(2.75 * max(columns, 2), height * rows + 0.3), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=share, sharey=share, squeeze=False).ravel().tolist()
    for axes in grid[count:]:
        axes.set_axis_off()
    for axes in grid:
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    return figure, grid


def _draw_band(axes: Axes, trials: Sequence[int], speeds_m_s: Array, shade: str, marker: str = "") -> None:
    """Draw the mean over repeats of speeds (repeats, trials), with its 95 % interval."""
    axes.plot(trials, 1000.0 * speeds_m_s.mean(axis=0), color=shade, linewidth=1.6, marker=marker, markersize=3.5)
    low, high = mean_interval(speeds_m_s)
    axes.fill_between(trials, 1000.0 * low, 1000.0 * high, color=shade, alpha=0.2, linewidth=0.0)
