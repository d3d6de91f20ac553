"""What the scatter is made of, as Rerun entities: where the floor carries the robot, and when it lost strength."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.view.canvas import Canvas, When
from vvvaltr.controller.view.chart import Axes
from vvvaltr.controller.view.scatter_causes import ScatterCauses

_FLOOR = (255, 165, 60)
_LOSS = (255, 165, 60)
_ABOVE_M, _LABEL_M = 0.002, 0.03  # above the ground, to be visible
_TEXT_UP = 4.0  # of the chart's unit, below its upper edge


def send_causes(
    canvas: Canvas, axes: Axes, trials: Sequence[LoggedTrial], found: Sequence[tuple[When, ScatterCauses]]
) -> None:
    """Send what was known of the causes at some times, for the chart with ``axes`` and the ground.

    Args:
        canvas: where to send to.
        axes: of the chart.
        trials: all trials so far: the arrow of the floor begins where the first one does, and is as long as the way
            by which the floor carries the robot in one of them.
        found: the times, and what was known then.
    """
    _send_floor(canvas, trials, found)
    _send_loss(canvas, axes, found)


def _send_floor(canvas: Canvas, trials: Sequence[LoggedTrial], found: Sequence[tuple[When, ScatterCauses]]) -> None:
    import rerun as rr

    drifts = [(when, it.drift if it.drift is not None and it.drift.is_told else None) for when, it in found]
    begins_m = [logged.trial.poses[0].position_m for logged in trials if logged.trial.poses]
    if not begins_m or all(drift is None for _, drift in drifts):
        return
    duration_s = float(np.median([logged.trial.duration_s for logged in trials if logged.trial.poses]))
    canvas.log("world/floor", rr.Arrows3D.from_fields(colors=_FLOOR, radii=-3.0))
    canvas.log("world/floor/label", rr.Points3D.from_fields(colors=_FLOOR, radii=0.0, show_labels=True))
    known = [drift for _, drift in drifts if drift is not None]
    whens, rows = [when for when, _ in drifts], [int(drift is not None) for _, drift in drifts]
    (x_m, y_m, _), *_ = begins_m
    vectors = [(*(duration_s * drift.velocity_m_s), 0.0) for drift in known]
    arrows = rr.Arrows3D.columns(origins=[(x_m, y_m, _ABOVE_M)] * len(known), vectors=vectors)
    canvas.send("world/floor", whens, arrows.partition(rows))
    labels = [f"floor: {1000.0 * drift.speed_m_s:.1f} mm/s" for drift in known]
    texts = rr.Points3D.columns(positions=[(x_m, y_m, _LABEL_M)] * len(known), labels=labels)
    canvas.send("world/floor/label", whens, texts.partition(rows))


def _send_loss(canvas: Canvas, axes: Axes, found: Sequence[tuple[When, ScatterCauses]]) -> None:
    import rerun as rr

    losses = [(when, it.loss) for when, it in found]
    if all(loss is None for _, loss in losses):
        return
    canvas.log("chart/loss", rr.LineStrips2D.from_fields(colors=_LOSS, radii=-1.0, draw_order=2.5))
    canvas.log("chart/loss_factor", rr.Points2D.from_fields(colors=_LOSS, radii=0.0, show_labels=True, draw_order=5.0))
    known = [loss for _, loss in losses if loss is not None]
    tops = [axes.place(since - 0.5, axes.high) for _, since in known]
    strips = [[top, axes.place(since - 0.5, axes.low)] for top, (_, since) in zip(tops, known, strict=True)]
    whens, rows = [when for when, _ in losses], [int(loss is not None) for _, loss in losses]
    canvas.send("chart/loss", whens, rr.LineStrips2D.columns(strips=strips).partition(rows))
    labels = [f"strength x {loss.factor:.2f}" for loss, _ in known]
    places = [(x, y + _TEXT_UP) for x, y in tops]
    canvas.send("chart/loss_factor", whens, rr.Points2D.columns(positions=places, labels=labels).partition(rows))
