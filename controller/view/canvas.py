"""A place in a Rerun recording: what is sent here lies below one root, so that several runs can stand side by side."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import rerun as rr

When = tuple[float, int]  # seconds since the run began, number of the trial


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
        self._recording.log(f"{self.root}/{path}", what, static=True)

    def send(self, path: str, whens: Sequence[When], columns: rr.ComponentColumnList) -> None:
        """Send one row for each time in ``whens``; nothing where there is none."""
        import rerun as rr

        if whens:
            times_s, numbers = zip(*whens, strict=True)
            indexes = [rr.TimeColumn("time", duration=times_s), rr.TimeColumn("trial", sequence=numbers)]
            self._recording.send_columns(f"{self.root}/{path}", indexes, columns)
            time.sleep(0.0)  # lets another thread go on: a live view must not hold up the loop that it shows
