"""What a run keeps of its trials in memory; docs/hardware.md says how many bytes that are."""

from __future__ import annotations

from collections.abc import Iterable

from vvvaltr.controller.core.records import LoggedTrial


class Memory(list[LoggedTrial]):
    """The trials of a run without what only its log is asked for, so that a long run does not fill the memory.

    None has recordings. Once a trial is appended, those before the last valid one are kept in brief: only what an
    optimiser is told at first, all earlier trials at once, needs them in full.
    """

    def __init__(self, trials: Iterable[LoggedTrial] = ()) -> None:
        super().__init__(logged.without_recordings() for logged in trials)
        self._in_brief = 0  # so many of the first

    def append(self, logged: LoggedTrial, /) -> None:
        """Keep one more trial."""
        super().append(logged.without_recordings())
        if logged.score is None:
            return
        for index in range(self._in_brief, len(self) - 1):
            self[index] = self[index].in_brief()
        self._in_brief = len(self) - 1
