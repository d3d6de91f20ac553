"""What the tracker's camera saw during the trials, as Rerun entities."""

from __future__ import annotations

from collections.abc import Sequence

from vvvaltr.controller.core.values import Trial
from vvvaltr.controller.view.canvas import Canvas, When


def send_photos(canvas: Canvas, begun: Sequence[tuple[When, Trial]]) -> None:
    """Send the pictures of each trial, which began at its time."""
    import rerun as rr

    photos = [((begin_s + it.t_s, number), it.jpeg) for (begin_s, number), trial in begun for it in trial.photos]
    columns = rr.EncodedImage.columns(blob=[jpeg for _, jpeg in photos], media_type=["image/jpeg"] * len(photos))
    canvas.send("camera", [when for when, _ in photos], columns)
