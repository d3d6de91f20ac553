"""The robot as a rigid body of Qualisys Track Manager (QTM)."""

from __future__ import annotations

import asyncio
import threading
from contextlib import suppress

from vvvaltr.controller.core.errors import LinkLost, TrackingLost, UserError
from vvvaltr.drivers.trackers.newest import NewestPose
from vvvaltr.drivers.trackers.qtm.protocol import PORT
from vvvaltr.drivers.trackers.qtm.session import Session, Wish
from vvvaltr.drivers.trackers.receiving import Opening, ReceivingTracker

_PAUSE_S = 0.5


class QtmTracker(ReceivingTracker):
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
        super().__init__(NewestPose(age_limit_s, f"no frame has come from {self._wish.address} yet"))
        self._opening = Opening(self._newest)
        self._loop = asyncio.new_event_loop()
        self._task = self._loop.create_task(self._serve())
        self._thread = threading.Thread(target=self._run, name=f"poses from {self._wish.address}", daemon=True)
        self._thread.start()
        try:
            self._opening.wait()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Disconnect. Idempotent."""
        with suppress(RuntimeError):  # the loop has ended already
            self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)  # where the library looks for it
        with self._opening.told_of_defects(), suppress(asyncio.CancelledError):
            self._loop.run_until_complete(self._task)
        self._loop.close()

    async def _serve(self) -> None:
        while True:
            try:
                await Session(self._wish, self._newest).run(self._opening.succeed)
            except (TrackingLost, UserError) as lost:
                if self._opening.fail(lost if isinstance(lost, UserError) else LinkLost(str(lost))):
                    return
            await asyncio.sleep(_PAUSE_S)
