"""A repertoire as a picture: where each movement takes the robot in 5 s, and by how much that scatters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.steering.arcs import travel
from vvvaltr.transfer.steering.repertoire import LearnedMovement, Repertoire

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DURATION_S = 5.0
_STEPS = 40
CAPTION = (
    "Where each movement takes the robot in 5 s from the triangle, which heads upwards, on a level floor. Arrows are "
    "thicker the more often a movement was driven; an ellipse is one standard deviation of a single drive."
)


def draw_repertoire(repertoire: Repertoire, title: str, path: Path) -> None:
    """Write the picture as PNG, PDF or SVG, by the path's ending.

    Raises:
        ImportError: matplotlib is missing.
        OSError: the file cannot be written.
    """
    figure = picture_repertoire(repertoire)
    figure.axes[0].set_title(title, fontsize=9)
    figure.savefig(path, dpi=150)


def picture_repertoire(repertoire: Repertoire) -> Figure:
    """Draw an arrow along each movement's path, coloured by its turn to the left, and the spread of its end."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Ellipse

    figure = Figure(figsize=(6.4, 5.4), layout="constrained")
    axes = figure.subplots()
    turns_deg_s = np.degrees(repertoire.velocities[:, 2])
    most = max(float(np.abs(turns_deg_s).max(initial=0.0)), 1.0)
    scale = axes.scatter([], [], c=[], cmap="coolwarm", vmin=-most, vmax=most)
    bar = figure.colorbar(scale, ax=axes, shrink=0.8)
    bar.set_label("turn to the left (degrees/s)", fontsize=9)
    bar.ax.tick_params(labelsize=9)
    for movement, turn_deg_s in zip(repertoire.movements, turns_deg_s, strict=True):
        colour = scale.to_rgba(np.array([turn_deg_s]))[0]
        dark = (*(0.8 * colour[:3]), 1.0)
        path_mm, spread_mm = 1000.0 * _path_m(movement), 1000.0 * _spread_m(movement)
        end = (-path_mm[-1, 1], path_mm[-1, 0])
        width = 0.8 + 0.5 * min(movement.trials, 5)
        axes.plot(-path_mm[:, 1], path_mm[:, 0], color=dark, linewidth=width, solid_capstyle="butt")
        axes.annotate("", end, (-path_mm[-6, 1], path_mm[-6, 0]),
                      arrowprops={"arrowstyle": "-|>", "color": dark, "shrinkA": 0, "shrinkB": 0})  # fmt: skip
        axes.add_patch(Ellipse(end, 2 * spread_mm[1], 2 * spread_mm[0],
                               facecolor=(*colour[:3], 0.08), edgecolor=(*dark[:3], 0.6), linewidth=0.7))  # fmt: skip
    axes.plot(0.0, 0.0, marker="^", color="#333333", markersize=9)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=9)
    axes.set(xlabel="to the right (mm)", ylabel="forward (mm)", aspect="equal")
    return figure


def _path_m(movement: LearnedMovement) -> Array:
    times_s = np.linspace(0.0, DURATION_S, _STEPS)
    moved_m, _ = travel(np.broadcast_to(movement.velocity, (_STEPS, 3)), times_s)
    return moved_m


def _spread_m(movement: LearnedMovement) -> Array:
    """Return the standard deviation of forward and left of one drive's end."""
    single = np.hypot(movement.scatter, movement.deviation)
    draws = movement.velocity + single * np.random.default_rng(0).standard_normal((400, 3))
    ends_m, _ = travel(draws, np.full(len(draws), DURATION_S))
    spread: Array = ends_m.std(axis=0)
    return spread
