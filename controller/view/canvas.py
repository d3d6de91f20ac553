"""A place in a Rerun recording: what is sent here lies below one root, so that several runs can stand side by side.

Every text goes through ``drawable`` on its way: a letter that Rerun's font lacks would end the viewer.
"""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa
    import rerun as rr
    from numpy.typing import NDArray

    from vvvaltr.controller.core.arrays import Array

_LACKING = re.compile(r"[^\n\t\x20-\x7e\xa1-\xac\xae-\u024f]")  # all Latin letters are there

When = tuple[float, int]  # seconds since the run began, number of the trial
Whens: TypeAlias = "Sequence[When] | Array"  # many of them, or as rows (n, 2)


def drawable(text: str) -> str:
    """Return a text with a question mark for each character that Rerun's font lacks."""
    return _LACKING.sub("?", text)


class Canvas:
    """Sends entities to a recording, on the time lines ``time`` and ``trial``.

    Args:
        recording: recording to send to.
        root: path above all entities, for example ``/source``; empty for none.
    """

    def __init__(self, recording: rr.RecordingStream, root: str = "") -> None:
        self._recording = recording
        self.root = root

    def log(self, path: str, what: rr.AsComponents) -> None:
        """Send what stays the same over the whole run."""
        import rerun as rr

        batches = [
            rr.DescribedComponentBatch(_readable(batch), batch.component_descriptor())
            for batch in what.as_component_batches()
        ]
        self._recording.log(f"{self.root}/{path}", batches, static=True)

    def send(self, path: str, whens: Whens, columns: rr.ComponentColumnList) -> None:
        """Send one row for each time in ``whens``; nothing where there is none."""
        import numpy as np
        import rerun as rr

        if len(whens):
            times_s, trials = np.array(whens, dtype=float).T  # which holds numbers of trials exactly
            for column in columns:
                column.component_batch = _readable(column.component_batch)
            nanoseconds = np.round(1e9 * times_s).astype("timedelta64[ns]")  # Rerun would cut floats off
            indexes = [
                rr.TimeColumn("time", duration=nanoseconds),
                rr.TimeColumn("trial", sequence=trials.astype(np.int64)),
            ]
            self._recording.send_columns(f"{self.root}/{path}", indexes, columns)
            time.sleep(0.0)  # lets another thread go on: a live view must not hold up the loop that it shows


def join_strips(points: Array, counts: Sequence[int] | NDArray[np.intp]) -> pa.Array:
    """Return lines for ``LineStrips2D`` or ``LineStrips3D``, all at once: their lists are taken point by point.

    Args:
        points: the points (n, 2) or (n, 3) of all lines, one line after another.
        counts: number of points of each line.
    """
    import numpy as np
    import pyarrow as pa
    import rerun as rr

    batch, kind = (
        (rr.encodings.Vec2DBatch, rr.components.LineStrip2DBatch)
        if points.shape[1] == 2
        else (rr.encodings.Vec3DBatch, rr.components.LineStrip3DBatch)
    )
    ends = np.cumsum(np.concatenate([[0], counts]), dtype=np.int32)
    inner = batch(np.ascontiguousarray(points, dtype=np.float32)).as_arrow_array()
    return pa.ListArray.from_arrays(ends, inner, type=kind([]).as_arrow_array().type)


def _readable(batch: rr.ComponentBatchLike) -> rr.ComponentBatchLike:
    """Return what is sent with every text in it drawable."""
    import rerun as rr

    array = batch.as_arrow_array()
    if str(array.type) != "string":
        return batch
    return rr.components.TextBatch([drawable(text) for text in array.to_pylist()])
