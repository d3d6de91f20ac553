"""A repertoire as a picture: where each movement takes the robot in 5 s, and by how much that scatters."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vvvaltr.transfer.steering.planner import travel
from vvvaltr.transfer.steering.repertoire import LearnedMovement, Repertoire

DURATION_S = 5.0
_STEPS = 40


def draw_repertoire(repertoire: Repertoire, title: str, path: Path) -> None:
    """Draw the paths from the robot's start, which heads upwards, and write a PNG, PDF or SVG by the path's ending.

    An ellipse is one standard deviation of a single drive of 5 s. Paths are coloured by the turn to the left.

    Raises:
        ImportError: matplotlib is missing.
        OSError: the file cannot be written.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Ellipse

    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    axes = figure.subplots()
    turns_deg_s = np.degrees(repertoire.velocities[:, 2])
    most = max(float(np.abs(turns_deg_s).max(initial=0.0)), 1.0)
    scale = axes.scatter([], [], c=[], cmap="coolwarm", vmin=-most, vmax=most)
    figure.colorbar(scale, ax=axes, label="turn to the left (degrees/s)")
    for movement, turn_deg_s in zip(repertoire.movements, turns_deg_s, strict=True):
        colour = scale.to_rgba(np.array([turn_deg_s]))[0]
        path_mm, spread_mm = 1000.0 * _path_m(movement), 1000.0 * _spread_m(movement)
        axes.plot(-path_mm[:, 1], path_mm[:, 0], color=colour, linewidth=0.8 + 0.5 * min(movement.trials, 5))
        axes.add_patch(Ellipse((-path_mm[-1, 1], path_mm[-1, 0]), 2 * spread_mm[1], 2 * spread_mm[0],
                               facecolor=(*colour[:3], 0.06), edgecolor=(*colour[:3], 0.7)))  # fmt: skip
    axes.plot(0.0, 0.0, marker="^", color="black", markersize=9)
    axes.set(xlabel="to the right (mm)", ylabel="forward (mm)", aspect="equal", title=title)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=150)


def _path_m(movement: LearnedMovement) -> np.ndarray:
    times_s = np.linspace(0.0, DURATION_S, _STEPS)
    moved_m, _ = travel(np.broadcast_to(movement.velocity, (_STEPS, 3)), times_s)
    return moved_m


def _spread_m(movement: LearnedMovement) -> np.ndarray:
    """Return the standard deviation of forward and left of one drive's end."""
    single = np.hypot(movement.scatter, movement.deviation)
    draws = movement.velocity + single * np.random.default_rng(0).standard_normal((400, 3))
    ends_m, _ = travel(draws, np.full(len(draws), DURATION_S))
    spread: np.ndarray = ends_m.std(axis=0)
    return spread
