"""Qualisys' client library (qtm-rt), behind a guard: nothing from the network reaches it unchecked.

Left alone, the library spins for ever on a packet of size 0, buffers without end on a huge one, and waits for ever for
an answer when the connection is lost.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable

from qtm_rt.packet import QRTPacket
from qtm_rt.protocol import QRTCommandException, QTMProtocol
from qtm_rt.qrt import QRTConnection

from vvvaltr.drivers.trackers.attitude import Matrix
from vvvaltr.drivers.trackers.qtm.protocol import VERSION, Event, Kind, NamedBody, bodies_in, vertical_in, whole_packets

_PARAMETERS_WITHIN_S = 1.0

logging.getLogger("qtm_rt").addHandler(logging.NullHandler())  # what it says is told by us, once, in one line


class Ears(QTMProtocol):  # type: ignore[misc]
    """What hears QTM: the library's own protocol, fed with whole and checked packets only.

    Args:
        on_event: is told each event.
        on_no_more_data: is told that QTM has no frames to send.
    """

    def __init__(self, on_event: Callable[[Event], None], on_no_more_data: Callable[[], None]) -> None:
        super().__init__(on_event=lambda event: on_event(Event(event.value)))
        self._buffer = bytearray()
        self._on_no_more_data_call = on_no_more_data
        self.heard_s = time.monotonic()
        self.loss = ""
        """Why the connection is over; empty while it is not."""

    def data_received(self, data: bytes) -> None:
        """Hand on the whole packets; a malformed one ends the connection."""
        self.heard_s = time.monotonic()
        self._buffer += data
        try:
            for kind, packet in whole_packets(self._buffer):
                if kind is Kind.NO_MORE_DATA:
                    self._on_no_more_data_call()
                super().data_received(packet)
        except ValueError as error:
            self.end(f"what comes from it is no real-time protocol {VERSION}: {error}")

    def connection_lost(self, exc: Exception | None) -> None:
        """Note it, and let nobody wait for an answer any longer."""
        super().connection_lost(exc)
        self.end("it has closed the connection")

    def end(self, loss: str) -> None:
        """Disconnect, and say why."""
        self.loss = self.loss or loss
        if self.transport is not None:
            self.transport.abort()
        while self.request_queue:
            future = self.request_queue.popleft()
            if not future.done():
                future.set_exception(ConnectionResetError(self.loss))


class Refusal(Exception):
    """QTM answered a command with an error."""


class Conversation:
    """What is said to QTM. Raises Refusal, TimeoutError and OSError.

    Args:
        ears: connected.
        patience_s: how long an answer may take.
    """

    def __init__(self, ears: Ears, patience_s: float) -> None:
        self._ears = ears
        self._connection = QRTConnection(ears, timeout=patience_s)
        self._patience_s = patience_s

    async def agree_on_version(self) -> None:
        """Ask for the protocol's version. Raises Refusal if QTM does not speak it."""
        try:
            await asyncio.wait_for(self._ears.set_version(VERSION), self._patience_s)
        except QRTCommandException as error:
            raise Refusal(_words(error)) from None

    async def bodies(self) -> tuple[NamedBody, ...]:
        """Return the rigid bodies, in the order of the frames. Raises ValueError for what is no XML."""
        try:
            parameters = await self._connection.get_parameters(["6d"])
        except QRTCommandException as error:
            raise Refusal(_words(error)) from None
        return bodies_in(_as_bytes(parameters))

    async def stream(self, rate_hz: float, on_packet: Callable[[QRTPacket], None]) -> None:
        """Let QTM send all frames, or ``rate_hz`` of them a second; returns with the first one, or if there is none."""
        frames = f"frequency:{rate_hz:.0f}" if rate_hz else "allframes"
        try:
            await self._connection.stream_frames(frames, ["6dres"], on_packet)
        except QRTCommandException:
            await self._stream_without_residual(frames, on_packet)

    async def _stream_without_residual(self, frames: str, on_packet: Callable[[QRTPacket], None]) -> None:
        try:
            await self._connection.stream_frames(frames, ["6d"], on_packet)
        except QRTCommandException as error:
            raise Refusal(_words(error)) from None

    async def vertical(self) -> str:
        """Return the axis that points upwards, ``+Z`` for instance; empty if QTM does not tell."""
        # The last question: one that is never answered would take the next one's answer.
        try:
            parameters = await asyncio.wait_for(self._connection.get_parameters(["3d"]), _PARAMETERS_WITHIN_S)
        except (QRTCommandException, TimeoutError):
            return ""
        return vertical_in(_as_bytes(parameters))


def _words(error: QRTCommandException) -> str:
    return _as_bytes(error.value).decode(errors="replace").strip()


def _as_bytes(said: object) -> bytes:
    return said if isinstance(said, bytes) else str(said).encode()


def bodies_of(packet: QRTPacket) -> list[tuple[tuple[float, float, float], Matrix, float | None]]:
    """Return position (m), rotation and residual (m; None where there is none) of each body in a frame."""
    with_residual, without = packet.get_6d_residual(), packet.get_6d()
    if with_residual is not None:
        return [(_metres(p), _rows(m.matrix), 0.001 * r.residual) for p, m, r in with_residual[1]]
    return [] if without is None else [(_metres(p), _rows(m.matrix), None) for p, m in without[1]]


def _metres(position_mm: tuple[float, float, float]) -> tuple[float, float, float]:
    x_mm, y_mm, z_mm = position_mm
    return 0.001 * x_mm, 0.001 * y_mm, 0.001 * z_mm


def _rows(m: tuple[float, ...]) -> Matrix:
    return (m[0], m[3], m[6]), (m[1], m[4], m[7]), (m[2], m[5], m[8])
