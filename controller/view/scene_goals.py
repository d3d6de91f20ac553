"""Goals and plans of steering as Rerun entities: where the robot is to go, and where each gait should take it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vvvaltr.controller.core.records import LoggedTrial, SteeringStep
from vvvaltr.controller.view.canvas import Canvas, When

_GOAL = (120, 230, 150)
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
    arrows = [_predict(logged, step) for _, logged, step in steered]
    origins, vectors = (np.array([arrow[side] for arrow in arrows]) for side in (0, 1))
    canvas.send("world/plan", whens, rr.Arrows3D.columns(origins=origins, vectors=vectors))


def _predict(logged: LoggedTrial, step: SteeringStep) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return where the trial begins, and the displacement that was predicted, in the world's frame."""
    if logged.movement is None:
        return (*step.goal_m, _ABOVE_M), (0.0, 0.0, 0.0)
    start, predicted = logged.movement.start, step.predicted
    cos, sin = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
    forward_m, left_m = predicted.forward_m, predicted.left_m
    vector = (cos * forward_m - sin * left_m, sin * forward_m + cos * left_m, 0.0)
    return (start.position_m[0], start.position_m[1], _ABOVE_M), vector
