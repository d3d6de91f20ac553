"""How a run is laid out in the Rerun viewer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.view.chart import CHART_X, CHART_Y
from vvvaltr.controller.view.scene_robot import find_path_m, list_drawable
from vvvaltr.controller.view.speed_maps import MAP_X, MAP_Y, Pair, list_pairs, map_path

if TYPE_CHECKING:
    import rerun.blueprint as rrb

_MOST_MAPS = 6  # side by side; the maps of further pairs are in the recording


def lay_out(run: Run, shown: Sequence[LoggedTrial], space: GaitSpace | None, following: bool = False) -> rrb.Blueprint:
    """Return the layout of one run.

    Args:
        run: the run.
        shown: those of its trials that are shown.
        space: gaits that are searched, for the maps; None for no maps.
        following: whether the viewer keeps at the newest data.
    """
    import rerun.blueprint as rrb

    left = rrb.Vertical(_scene(run, shown), _motor_view(""), row_shares=[3, 2])
    texts = rrb.Horizontal(_result_view(""), _trials_view(""), column_shares=[2, 3])
    maps = _map_grid(space, "")
    right = rrb.Vertical(texts, _speed_view(""), *maps, row_shares=[3.0] * (2 + len(maps)))
    return _frame(rrb.Horizontal(left, right), following)


def lay_out_side_by_side(titled: Sequence[tuple[str, Run, GaitSpace | None]], roots: Sequence[str]) -> rrb.Blueprint:
    """Return the layout of several runs, each a column of its own below its root."""
    import rerun.blueprint as rrb

    columns = []
    for (title, run, space), root in zip(titled, roots, strict=True):
        views: list[rrb.View | rrb.Container] = [_result_view(root), _robot_view(run, run.trials, root)]
        views += [_speed_view(root), *_map_grid(space, root)]
        columns.append(rrb.Vertical(*views, row_shares=[2, 4, 3, 3][: len(views)], name=title))
    return _frame(rrb.Horizontal(*columns), following=False)


def _frame(content: rrb.Container, following: bool) -> rrb.Blueprint:
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline="time", state="collapsed", play_state="following" if following else None),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def _scene(run: Run, shown: Sequence[LoggedTrial]) -> rrb.View | rrb.Container:
    """Return a view of the robot, beside it what the tracker's camera saw, if it kept pictures."""
    import rerun.blueprint as rrb

    robot = _robot_view(run, shown, "")
    if not any(logged.trial.photos for logged in shown):
        return robot
    camera = rrb.Spatial2DView(origin="/camera", name="Camera, once a second")
    return rrb.Horizontal(robot, camera, column_shares=[1, 1])


def _robot_view(run: Run, shown: Sequence[LoggedTrial], root: str) -> rrb.Spatial3DView:
    """Return a view of everywhere the robot went, from the front and a little above."""
    import rerun.blueprint as rrb

    path_m = find_path_m([pose for logged in shown for pose in list_drawable(logged.trial)])
    lowest, highest = (bound(path_m if len(path_m) else [(0.0, 0.0, 0.05)], axis=0) for bound in (np.min, np.max))
    centre, extent_m = (lowest + highest) / 2, max(0.2, float(np.max(highest - lowest)))
    eye = rrb.EyeControls3D(
        position=centre + (0.15 + 0.6 * extent_m) * np.array([0.2, -1.0, 0.3]),
        look_target=centre,
        eye_up=(0.0, 0.0, 1.0),
    )
    has_ground = run.structure is not None and run.structure.terrain is not None
    return rrb.Spatial3DView(
        origin=f"{root}/world", name=_name("Robot", root), eye_controls=eye, line_grid=not has_ground
    )


def _motor_view(root: str) -> rrb.TimeSeriesView:
    """Return a view of the ten seconds around the cursor: a whole run would show as nothing but stripes."""
    import rerun.blueprint as rrb

    begin, end = (rrb.TimeRangeBoundary.cursor_relative(seconds=seconds) for seconds in (-5, 5))
    return rrb.TimeSeriesView(
        origin=f"{root}/motors",
        name="Motor frequencies (Hz): dark as asked, bright as applied",
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(begin, end)),
        plot_legend=rrb.Corner2D.LeftBottom,
    )


def _speed_view(root: str) -> rrb.Spatial2DView:
    import rerun.blueprint as rrb

    bounds = rrb.VisualBounds2D(x_range=CHART_X, y_range=CHART_Y)
    return rrb.Spatial2DView(origin=f"{root}/chart", name=_name("Speed of each trial", root), visual_bounds=bounds)


def _result_view(root: str) -> rrb.TextDocumentView:
    import rerun.blueprint as rrb

    return rrb.TextDocumentView(origin=f"{root}/result", name=_name("Result", root))


def _trials_view(root: str) -> rrb.TextDocumentView:
    import rerun.blueprint as rrb

    return rrb.TextDocumentView(origin=f"{root}/trials", name="Trials so far, newest first")


def _map_grid(space: GaitSpace | None, root: str) -> list[rrb.Container]:
    import rerun.blueprint as rrb

    pairs = list_pairs(space)[:_MOST_MAPS] if space else ()
    return [rrb.Grid(*(_map_view(pair, root) for pair in pairs), grid_columns=3)] if pairs else []


def _map_view(pair: Pair, root: str) -> rrb.Spatial2DView:
    import rerun.blueprint as rrb

    return rrb.Spatial2DView(
        origin=f"{root}/{map_path(pair)}",
        name=f"Learned: motors {pair[0].motor + 1}, {pair[1].motor + 1}",
        visual_bounds=rrb.VisualBounds2D(x_range=MAP_X, y_range=MAP_Y),
    )


def _name(what: str, root: str) -> str:
    """Return the name of a view; of one of several runs, with the run's."""
    title = root.strip("/").replace("\\", "")  # without the backslashes of a path
    return f"{what}: {title}" if title else what
