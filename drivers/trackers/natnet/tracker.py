"""The robot as a rigid body of OptiTrack's Motive, over NatNet."""

from __future__ import annotations

import math
import threading
import time

from vvvaltr.controller.core.errors import LinkLost, UserError
from vvvaltr.drivers.trackers.attitude import is_unit, matrix_of_quaternion
from vvvaltr.drivers.trackers.natnet.protocol import (
    OLDEST,
    Frame,
    Message,
    ServerInfo,
    bodies_in,
    frame_in,
    message,
    message_in,
    server_info_in,
)
from vvvaltr.drivers.trackers.natnet.table import NatnetTable
from vvvaltr.drivers.trackers.natnet.wires import Wires
from vvvaltr.drivers.trackers.newest import UNSEEN, NewestPose
from vvvaltr.drivers.trackers.receiving import Opening, ReceivingTracker

_ASK_S, _KEEP_ALIVE_S, _SILENCE_S, _LOOK_S = 0.25, 1.0, 2.0, 0.05
_NEWEST_MAJOR, _MOST_MALFORMED = 4, 3
_CURE = "check that Motive runs, that its streaming is on, and tracker.host and tracker.port"


class NatnetTracker(ReceivingTracker):
    """A rigid body that Motive tracks, by its name: satisfies ``PoseTracker``. It connects again by itself.

    Args:
        table: what is wanted of which server.
        patience_s: how long the server's answers may take.

    Raises:
        UserError: the server knows no such body, or does not speak a version of the protocol that we know.
        LinkLost: the server does not answer.
        ValueError: an address is none.
    """

    def __init__(self, table: NatnetTable, patience_s: float = 3.0) -> None:
        self._table = table
        self._address = f"NatNet at {table.host}:{table.port}"
        super().__init__(NewestPose(table.age_limit_s, f"no frame has come from {self._address} yet"))
        self._wires = Wires(table)
        self._server: ServerInfo | None = None
        self._body: int | None = None  # its id
        self._has_exposure: bool | None = None
        self._malformed = 0  # datagrams since the last frame
        self._asked_s = self._heard_s = -math.inf
        self._opening = Opening(self._newest)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"poses from {self._address}", daemon=True)
        self._thread.start()
        try:
            self._opening.wait(patience_s)
        except TimeoutError:
            self.close()
            raise LinkLost(self._silence(patience_s)) from None
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Disconnect. Idempotent."""
        self._closing.set()
        self._thread.join()
        self._wires.close()

    def _run(self) -> None:
        with self._opening.told_of_defects():
            while not self._closing.is_set():
                self._speak(time.monotonic())
                for datagram in self._wires.heard(_LOOK_S):
                    self._hear_or_lose(datagram, time.monotonic())
            self._wires.send(message(Message.DISCONNECT))

    def _hear_or_lose(self, datagram: bytes, received_s: float) -> None:
        try:
            self._hear(datagram, received_s)
        except UserError as error:
            self._opening.fail(error)
        except ValueError as error:
            self._newest.lose(f"a malformed datagram from {self._address}: {error}")
            self._malformed += 1
            if self._malformed == _MOST_MALFORMED:
                self._forget()  # Motive has started anew, in another version

    def _speak(self, now_s: float) -> None:
        """Ask for what is not known yet, or say that we still listen."""
        if self._server is not None and now_s - self._heard_s > _SILENCE_S:
            self._newest.lose(self._silence(now_s - self._heard_s))
            self._forget()
        period_s = _KEEP_ALIVE_S if self._body is not None else _ASK_S
        if now_s - self._asked_s < period_s:
            return
        self._asked_s = now_s
        if self._server is None:
            self._wires.send(message(Message.CONNECT, b"Ping\0"))
        elif self._body is None:
            self._wires.send(message(Message.REQUEST_MODEL))
        else:
            self._wires.send(message(Message.KEEP_ALIVE))

    def _forget(self) -> None:
        """Know nothing of the server any more: another one may be the next to answer."""
        self._server = self._body = self._has_exposure = None
        self._malformed = 0
        self._asked_s = -math.inf

    def _hear(self, datagram: bytes, received_s: float) -> None:
        """Take in a datagram. Raises UserError and ValueError."""
        kind, content = message_in(datagram)
        if kind == Message.SERVER_INFO:
            self._heard_s, self._asked_s = received_s, -math.inf
            self._server = self._checked(server_info_in(content))
        elif self._server is None:
            return  # how it is laid out is not known yet
        elif kind == Message.MODEL:
            self._heard_s, self._asked_s = received_s, -math.inf
            self._find(bodies_in(content, self._server.version))
        elif kind == Message.FRAME:
            self._take(frame_in(content, self._server.version), self._server, received_s)

    def _checked(self, server: ServerInfo) -> ServerInfo:
        said = f"{self._address} ({server.name}) speaks version {server.version[0]}.{server.version[1]}"
        if server.version < OLDEST:
            raise UserError(f"{said} of NatNet, older than 3.0; update Motive to 2.0 or later")
        if server.version[0] > _NEWEST_MAJOR:
            raise UserError(f"{said} of NatNet, newer than 4; choose a bitstream of version 4 in Motive's settings")
        if server.group not in ("", self._table.multicast):
            raise UserError(
                f"{self._address} sends its frames to the group {server.group}; write multicast = {server.group!r} and "
                f"data_port = {server.data_port} under [tracker], or choose unicast in Motive's streaming settings"
            )
        return server

    def _find(self, known: dict[str, int]) -> None:
        wanted = self._table.body
        if wanted not in known:
            names = ", ".join(map(repr, known)) or "no rigid body at all"
            raise UserError(f"tracker.body is {wanted!r}, but {self._address} knows {names}; name one that it knows")
        self._body = known[wanted]
        self._opening.succeed()

    def _take(self, frame: Frame, server: ServerInfo, received_s: float) -> None:
        self._heard_s, self._malformed = received_s, 0
        if frame.models_changed:
            self._wires.send(message(Message.REQUEST_MODEL))
        if self._body is None:
            return
        if self._has_exposure is None:  # some cameras tell when they were open; the two times are of different clocks
            self._has_exposure = bool(server.clock_hz and frame.exposure_ticks)
        t_s = frame.exposure_ticks / server.clock_hz if self._has_exposure else frame.t_s
        body = frame.bodies.get(self._body)
        if body is None:
            self._newest.take(frame.number, t_s, f"{self._table.body!r} is not in the frames of Motive", received_s)
        elif body.is_tracked and is_unit(body.quaternion):
            position_m, quaternion = body.position_m, body.quaternion
            if self._table.up == "y":
                (x, y, z), (qx, qy, qz, qw) = position_m, quaternion
                position_m, quaternion = (x, -z, y), (qx, -qz, qy, qw)
            error_m = body.error_m if math.isfinite(body.error_m) else None
            self._newest.take_body(frame.number, t_s, position_m, matrix_of_quaternion(quaternion), error_m, received_s)
        else:
            self._newest.take(frame.number, t_s, UNSEEN, received_s)

    def _silence(self, silent_s: float) -> str:
        if self._server is None or self._opening.is_over:
            return f"{self._address} has been silent for {silent_s:.1f} s; {_CURE}"
        return f"{self._address} does not name its rigid bodies within {silent_s:g} s; restart its streaming"
