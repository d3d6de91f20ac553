"""Goals and plans of steering as Rerun entities: where the robot is to go, and where each gait should take it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vvvaltr.controller.core.records import LoggedTrial, SteeringStep
from vvvaltr.controller.view.canvas import Canvas, When

_GOAL = (120, 230, 150)
_HEADING_M = 0.06  # length of the arrow of the heading at the goal
_ABOVE_M = 0.002  # above the ground, to be visible


def send_goals(canvas: Canvas, begun: Sequence[tuple[When, LoggedTrial]]) -> None:
    """Send goal and predicted displacement of each trial that steers, at its beginning."""
    import rerun as rr

    steered = [(when, logged, logged.steering) for when, logged in begun if logged.steering is not None]
    if not steered:
        return
    canvas.log("world/goal", rr.Points3D.from_fields(colors=_GOAL, radii=0.008, show_labels=True))
    canvas.log("world/plan", rr.Arrows3D.from_fields(colors=_GOAL, radii=0.002))
    whens = [when for when, _, _ in steered]
    goals = [(*step.goal_m, _ABOVE_M) for _, _, step in steered]
    canvas.send("world/goal", whens, rr.Points3D.columns(positions=goals, labels=["goal"] * len(goals)))
    _send_headings(canvas, [(when, step) for when, _, step in steered])
    arrows = [_predict(logged, step) for _, logged, step in steered]
    origins, vectors = (np.array([arrow[side] for arrow in arrows]) for side in (0, 1))
    canvas.send("world/plan", whens, rr.Arrows3D.columns(origins=origins, vectors=vectors))


def _send_headings(canvas: Canvas, steps: Sequence[tuple[When, SteeringStep]]) -> None:
    """Send an arrow for each goal that asks for a heading, and none for the others."""
    import rerun as rr

    wanted = [(step.goal_m, step.goal_yaw_rad) for _, step in steps if step.goal_yaw_rad is not None]
    if not wanted:
        return
    canvas.log("world/goal/heading", rr.Arrows3D.from_fields(colors=_GOAL, radii=0.002))
    columns = rr.Arrows3D.columns(
        origins=[(*goal_m, _ABOVE_M) for goal_m, _ in wanted],
        vectors=[(_HEADING_M * math.cos(yaw_rad), _HEADING_M * math.sin(yaw_rad), 0.0) for _, yaw_rad in wanted],
    )
    rows = [int(step.goal_yaw_rad is not None) for _, step in steps]
    canvas.send("world/goal/heading", [when for when, _ in steps], columns.partition(rows))


def _predict(logged: LoggedTrial, step: SteeringStep) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return where the trial begins, and the displacement that was predicted, in the world's frame."""
    if logged.movement is None:
        return (*step.goal_m, _ABOVE_M), (0.0, 0.0, 0.0)
    start, predicted = logged.movement.start, step.predicted
    cos, sin = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
    forward_m, left_m = predicted.forward_m, predicted.left_m
    vector = (cos * forward_m - sin * left_m, sin * forward_m + cos * left_m, 0.0)
    return (start.position_m[0], start.position_m[1], _ABOVE_M), vector
