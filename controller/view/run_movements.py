"""The part of a run's report that tells what is known of movements, and how the robot got where it was told."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.runs.config import STEERING
from vvvaltr.controller.runs.errand import Errand, load_errand
from vvvaltr.controller.runs.repertoire_file import known_in_run
from vvvaltr.controller.view.page import to_svg, write_figure, write_table
from vvvaltr.controller.view.repertoire_picture import CAPTION, picture_repertoire
from vvvaltr.controller.view.run_findings import RunFindings
from vvvaltr.transfer.steering.repertoire import LearnedMovement


def write_movements(found: RunFindings, path: Path) -> Iterator[str]:
    """Yield the parts of the page; none for a run that was not made to steer.

    Args:
        found: what the run's trials say.
        path: the run's directory or log.
    """
    if found.config is None or found.config.method not in STEERING:
        return
    known = known_in_run(path if path.is_dir() else path.parent, [logged.trial for logged in found.run.trials])
    if not known.movements:
        return
    yield "<h2>The movements</h2>"
    yield write_figure(to_svg(picture_repertoire(known)), CAPTION)
    rows = [_row(movement) for movement in sorted(known.movements, key=_speed_m_s, reverse=True)]
    columns = ("gait (Hz)", "forward (mm/s)", "left (mm/s)", "turn to the left (degrees/s)", "trials")
    yield write_table("Each movement, fastest first, and what a single drive differs by", columns, rows)
    yield from _write_goals(found.run.trials)


def read_errand(path: Path) -> Errand | None:
    """Return what a run, a directory or a log, was to do; None where no file tells it."""
    try:
        return load_errand(path if path.is_dir() else path.parent)
    except UserError:
        return None


def _row(movement: LearnedMovement) -> tuple[str, ...]:
    mean = movement.velocity
    single = (movement.scatter**2 + movement.deviation**2) ** 0.5
    cells = [f"{1000.0 * mean[axis]:+.1f} ± {1000.0 * single[axis]:.1f}" for axis in (0, 1)]
    turn = f"{math.degrees(mean[2]):+.1f} ± {math.degrees(single[2]):.1f}"
    gait = " / ".join(f"{frequency:.2f}" for frequency in movement.gait.frequency_hz)
    return gait, *cells, turn, str(movement.trials)


def _speed_m_s(movement: LearnedMovement) -> float:
    return math.hypot(movement.velocity[0], movement.velocity[1])


def _write_goals(trials: tuple[LoggedTrial, ...]) -> Iterator[str]:
    """Yield a table of the goals of a run of ``go``, in their order."""
    on_the_way = [logged for logged in trials if logged.steering is not None and logged.trial.poses]
    rows = []
    for goal_m, group in groupby(on_the_way, lambda logged: logged.steering.goal_m if logged.steering else None):
        driven = list(group)
        if goal_m is None:
            continue
        x_m, y_m, _ = driven[-1].trial.poses[-1].position_m
        rows.append(
            (
                f"{goal_m[0]:.3f}, {goal_m[1]:.3f}",
                str(len(driven)),
                f"{sum(logged.trial.duration_s for logged in driven):.1f}",
                f"{1000.0 * math.hypot(x_m - goal_m[0], y_m - goal_m[1]):.0f}",
            )
        )
    if rows:
        columns = ("goal x, y (m)", "primitives", "driven (s)", "off by at the end (mm)")
        yield write_table("The goals, in their order", columns, rows)
