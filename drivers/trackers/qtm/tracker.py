"""The robot as a rigid body of Qualisys Track Manager (QTM)."""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import Future
from contextlib import suppress

from vvvaltr.controller.core.errors import LinkLost, TrackingLost, UserError
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.links.remote_clock import RemoteClock
from vvvaltr.drivers.trackers.newest import NewestPose
from vvvaltr.drivers.trackers.qtm.protocol import PORT
from vvvaltr.drivers.trackers.qtm.session import Session, Wish

_PAUSE_S = 0.5


class QtmTracker:
    """A rigid body that QTM tracks, by its name: satisfies ``PoseTracker``. It connects again by itself after a loss.

    Args:
        host, port: of the computer with QTM; the port is the little-endian one.
        body: name of the rigid body in QTM.
        age_limit_s: the greatest age of a pose that is still the robot's.
        rate_hz: how many frames a second to ask for; 0 for all.
        patience_s: how long an answer of QTM may take.

    Raises:
        UserError: QTM knows no such body, does not speak this version, or has another axis upwards than z.
        LinkLost: QTM does not answer, or has no frames to send.
    """

    def __init__(
        self,
        host: str,
        port: int = PORT,
        *,
        body: str,
        age_limit_s: float = 0.2,
        rate_hz: float = 0.0,
        patience_s: float = 3.0,
    ) -> None:
        self._wish = Wish(host, port, body, rate_hz, patience_s)
        self._newest = NewestPose(age_limit_s, f"no frame has come from {self._wish.address} yet")
        self._opened: Future[None] = Future()
        self._loop = asyncio.new_event_loop()
        self._task = self._loop.create_task(self._serve())
        self._thread = threading.Thread(target=self._run, name=f"poses from {self._wish.address}", daemon=True)
        self._thread.start()
        try:
            self._opened.result()
        except BaseException:
            self.close()
            raise

    @property
    def clock(self) -> RemoteClock:
        """The camera system's clock."""
        return self._newest.clock

    def pose(self) -> Pose:
        """Return the newest pose. Raises TrackingLost if there is none that is fresh and trustworthy."""
        return self._newest.pose()

    def close(self) -> None:
        """Disconnect. Idempotent."""
        with suppress(RuntimeError):  # the loop has ended already
            self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)  # where the library looks for it
        with suppress(asyncio.CancelledError):
            self._loop.run_until_complete(self._task)
        self._loop.close()

    async def _serve(self) -> None:
        while True:
            try:
                await Session(self._wish, self._newest).run(self._on_begun)
            except (TrackingLost, UserError) as lost:
                if not self._opened.done():
                    self._opened.set_exception(lost if isinstance(lost, UserError) else LinkLost(str(lost)))
                    return
                self._newest.lose(str(lost))
            except Exception as defect:
                self._newest.lose(f"the tracker's thread has ended: {defect!r}; please report this")
                if not self._opened.done():
                    self._opened.set_exception(defect)
                raise
            await asyncio.sleep(_PAUSE_S)

    def _on_begun(self) -> None:
        if not self._opened.done():
            self._opened.set_result(None)
