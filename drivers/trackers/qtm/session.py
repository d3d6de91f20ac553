"""One connection to Qualisys Track Manager (QTM): from its greeting until it is lost."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass

from qtm_rt.packet import QRTPacket

from vvvaltr.controller.core.errors import TrackingLost, UserError
from vvvaltr.drivers.trackers.newest import NewestPose
from vvvaltr.drivers.trackers.qtm.connection import Conversation, Ears, Refusal, bodies_of
from vvvaltr.drivers.trackers.qtm.protocol import ENDINGS, VERSION, Event, NamedBody

_SILENCE_S, _LOOK_S = 2.0, 0.1
_CURE = "check that QTM runs, that its real-time output is on, and tracker.host and tracker.port"
_NO_FRAMES = "QTM has no frames to send; start a measurement (File, New)"


@dataclass(frozen=True, slots=True)
class Wish:
    """What is wanted of which QTM; see ``QtmTracker``."""

    host: str
    port: int
    body: str
    rate_hz: float
    patience_s: float

    @property
    def address(self) -> str:
        """Where QTM is, for people."""
        return f"QTM at {self.host}:{self.port}"


class Session:
    """Connects, and takes in frames while they come.

    Args:
        wish: what is wanted.
        newest: where the poses go.
    """

    def __init__(self, wish: Wish, newest: NewestPose) -> None:
        self._wish, self._newest = wish, newest
        self._ears = Ears(self._on_event, self._on_no_more_data)
        self._bodies: tuple[NamedBody, ...] = ()
        self._has_begun = False  # no pose counts before the axes are known
        self._why = ""  # QTM's own reason for sending no frames

    async def run(self, on_begun: Callable[[], None]) -> None:
        """Return never; ``on_begun`` is called when QTM has agreed to send frames.

        Raises:
            UserError: QTM cannot give what is wanted.
            TrackingLost: QTM does not answer, or the connection is lost.
        """
        wish = self._wish
        try:
            async with asyncio.timeout(wish.patience_s):
                await asyncio.get_running_loop().create_connection(lambda: self._ears, wish.host, wish.port)
            await self._begin()
            on_begun()
            await self._watch()
        except TimeoutError:
            raise TrackingLost(f"{wish.address} does not answer within {wish.patience_s:g} s; {_CURE}") from None
        except (OSError, Refusal, ValueError) as error:
            said = self._ears.loss or _words(error)
            raise TrackingLost(f"no poses from {wish.address}: {said}; {_CURE}") from None
        finally:
            self._ears.end("it is no longer wanted")
            await asyncio.sleep(0)  # the loop lets go of the socket in its next turn

    async def _begin(self) -> None:
        """Agree on the version, find the body and let frames come."""
        talk, address = Conversation(self._ears, self._wish.patience_s), self._wish.address
        try:
            await talk.agree_on_version()
        except Refusal as refusal:
            raise UserError(
                f"{address} does not speak version {VERSION} of the real-time protocol ({refusal}); update QTM"
            ) from None
        self._bodies = await talk.bodies()
        chosen = self._chosen()
        try:
            await talk.stream(self._wish.rate_hz, lambda packet: self._on_packet(packet, chosen))
        except TimeoutError:
            raise TrackingLost(_NO_FRAMES) from None
        if (vertical := await talk.vertical()) not in ("", "+Z"):
            raise UserError(f"{address} has {vertical} upwards, but z must point up; calibrate it with +Z upwards")
        self._has_begun = True

    def _chosen(self) -> NamedBody:
        """Return the body that is wanted. Raises UserError with those that there are."""
        wanted, address = self._wish.body, self._wish.address
        named = [body for body in self._bodies if body.name == wanted]
        if not named:
            known = ", ".join(repr(body.name) for body in self._bodies) or "no rigid body at all"
            raise UserError(f"tracker.body is {wanted!r}, but {address} knows {known}; name one that it knows")
        if len(named) > 1:
            raise UserError(f"{address} has {len(named)} bodies named {wanted!r}; rename all but the robot")
        if not named[0].is_enabled:
            raise UserError(f"the body {wanted!r} is switched off in {address}; enable it in the 6DOF settings")
        return named[0]

    async def _watch(self) -> None:
        """Return never: raise TrackingLost when the connection ends or falls silent."""
        address = self._wish.address
        while not self._ears.loss:
            silent_s = time.monotonic() - self._ears.heard_s
            if silent_s > _SILENCE_S:
                raise TrackingLost(self._why or f"{address} has been silent for {silent_s:.1f} s; {_CURE}")
            await asyncio.sleep(_LOOK_S)
        raise TrackingLost(self._why or f"the connection to {address} is lost: {self._ears.loss}; {_CURE}")

    def _on_event(self, event: Event) -> None:
        if event in ENDINGS:
            self._why = ENDINGS[event]
            self._newest.lose(self._why)
        if event is Event.SETTINGS_CHANGED and self._has_begun:
            self._ears.end("its settings have changed")  # so it is asked for its bodies afresh

    def _on_no_more_data(self) -> None:
        self._why = self._why or _NO_FRAMES
        self._newest.lose(self._why)

    def _on_packet(self, packet: QRTPacket, chosen: NamedBody) -> None:
        received_s = time.monotonic()
        seen = bodies_of(packet)
        # Where a body is switched off, QTM may leave it out.
        listed = [body for body in self._bodies if len(seen) == len(self._bodies) or body.is_enabled]
        if len(seen) != len(listed):
            self._ears.end(f"its frames are of {len(seen)} bodies, but it has named {len(self._bodies)}")
        elif self._has_begun:
            self._why = ""
            body = seen[listed.index(chosen)]
            self._newest.take_body(packet.framenumber, 1e-6 * packet.timestamp, *body, received_s)


def _words(error: Exception) -> str:
    if isinstance(error, ConnectionRefusedError):
        return "nothing listens there"
    return (error.strerror if isinstance(error, OSError) else "") or str(error)
