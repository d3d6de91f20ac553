"""What the trackers have in common that receive poses in a thread of their own."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager

from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.links.remote_clock import RemoteClock
from vvvaltr.drivers.trackers.newest import NewestPose


class ReceivingTracker:
    """A tracker whose thread keeps the newest pose.

    Args:
        newest: where the thread puts the poses.
    """

    def __init__(self, newest: NewestPose) -> None:
        self._newest = newest

    @property
    def clock(self) -> RemoteClock:
        """The sender's clock."""
        return self._newest.clock

    def pose(self) -> Pose:
        """Return the newest pose. Raises TrackingLost if there is none that is fresh and trustworthy."""
        return self._newest.pose()


class Opening:
    """Whether a server has agreed to send poses: a tracker's constructor waits for it while the thread asks.

    Args:
        newest: where the poses go.
    """

    def __init__(self, newest: NewestPose) -> None:
        self._newest = newest
        self._agreed: Future[None] = Future()

    @property
    def is_over(self) -> bool:
        """Whether the server has agreed, or it was found that it will not."""
        return self._agreed.done()

    def wait(self, patience_s: float | None = None) -> None:
        """Wait for it. Raises what the thread says by ``fail``, and TimeoutError after ``patience_s``."""
        self._agreed.result(patience_s)

    def succeed(self) -> None:
        """Let the constructor return. Idempotent."""
        if not self._agreed.done():
            self._agreed.set_result(None)

    def fail(self, error: Exception) -> bool:
        """Let the constructor raise ``error`` and return True; if it has returned, only have no pose until the next."""
        if self._agreed.done():
            self._newest.lose(str(error))
            return False
        self._agreed.set_exception(error)
        return True

    @contextmanager
    def told_of_defects(self) -> Iterator[None]:
        """Around all that the thread does: a thread that fails must leave neither a pose nor somebody who waits."""
        try:
            yield
        except Exception as defect:  # whatever it is: it is told before it is shown
            self._newest.lose(f"the tracker's thread has ended: {defect!r}; please report this")
            if not self._agreed.done():
                self._agreed.set_exception(defect)
            raise
