"""A stand-in for Qualisys Track Manager: serves the poses of a robot over the real-time protocol, on TCP."""

from __future__ import annotations

import itertools
import math
import socket
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.attitude import matrix_of
from vvvaltr.drivers.trackers.qtm.protocol import (
    GREETING,
    HEADER,
    VERSION,
    Component,
    Event,
    Kind,
    frame,
    packet,
    text,
    whole_packets,
)

HOST = "127.0.0.1"
_UNSEEN = (math.nan,) * 12
_CLIENT_READS_WITHIN_S = 0.05  # with a client that does not read: then it is hung up on, for the robot goes on
_COMPONENTS = {"6d": Component.BODIES, "6dres": Component.BODIES_WITH_RESIDUAL}


@dataclass(slots=True)
class QtmFaults:
    """How the server misbehaves; may be changed while it runs.

    Args:
        is_mute: it accepts connections and says nothing.
        repeats_frame: it sends frames, all with the same number.
        fragment_bytes: it writes so many bytes at a time; 0 for whole packets.
        versions: the versions of the protocol that it speaks.
        vertical: the axis that points upwards; empty for not telling.
        disabled: bodies that are switched off: they are named, and not in the frames.
        has_residual: whether it can send residuals.
    """

    is_mute: bool = False
    repeats_frame: bool = False
    fragment_bytes: int = 0
    versions: tuple[str, ...] = (VERSION,)
    vertical: str = "+Z"
    disabled: tuple[str, ...] = ()
    has_residual: bool = True


@dataclass(eq=False)
class _Client:
    """One connection, and what it asked for."""

    wire: socket.socket
    component: Component | None = None
    period_s: float = 0.0
    next_s: float = -math.inf
    lock: threading.Lock = field(default_factory=threading.Lock)


class QtmServer:
    """Serves frames to any number of clients: satisfies ``PoseFeed``.

    The robot is the last of its ``bodies``; the others are never seen.

    Args:
        host, port: where to listen; port 0 for any that is free.
        bodies: names of the rigid bodies.
        faults: how it misbehaves.
    """

    def __init__(
        self,
        host: str = HOST,
        port: int = 0,
        bodies: Sequence[str] = ("wand", "robot"),
        faults: QtmFaults | None = None,
    ) -> None:
        self.bodies = tuple(bodies)
        self.faults = faults or QtmFaults()
        self.residual_m = 0.0002
        self._numbers = itertools.count(1)
        self._number = 0
        self._clients: list[_Client] = []
        self._socket = socket.create_server((host, port))
        self.port: int = self._socket.getsockname()[1]
        self._thread = threading.Thread(target=self._accept, name="mock QTM", daemon=True)
        self._thread.start()

    def send(self, pose: Pose) -> None:
        """Send a frame that shows the robot to all who listen."""
        m = matrix_of((pose.yaw_rad, pose.pitch_rad, pose.roll_rad))
        columns = (m[row][column] for column in range(3) for row in range(3))
        self._send_frame(pose.t_s, (*(1000.0 * x for x in pose.position_m), *columns))

    def send_lost(self, t_s: float) -> None:
        """Send a frame in which the robot is not seen."""
        self._send_frame(t_s, _UNSEEN)

    def tell(self, event: Event) -> None:
        """Send an event to all."""
        self.send_bytes(packet(Kind.EVENT, bytes([event])))

    def tell_no_more_data(self) -> None:
        """Say that there are no frames."""
        self.send_bytes(packet(Kind.NO_MORE_DATA, b""))

    def send_bytes(self, data: bytes) -> None:
        """Send anything to all who listen to frames."""
        for client in tuple(self._clients):
            if client.component is not None:
                self._write(client, data)

    def hang_up(self) -> None:
        """Close all connections."""
        for client in tuple(self._clients):
            _shut(client.wire)

    @property
    def listeners(self) -> int:
        """How many clients listen to frames."""
        return sum(client.component is not None for client in tuple(self._clients))

    def close(self) -> None:
        """Close all connections, and listen no more."""
        _shut(self._socket)
        self._socket.close()
        self._thread.join()
        self.hang_up()

    def _send_frame(self, t_s: float, body: tuple[float, ...]) -> None:
        if self.faults.is_mute:
            return
        if not (self.faults.repeats_frame and self._number):
            self._number = next(self._numbers)
        enabled = [name for name in self.bodies if name not in self.faults.disabled]
        bodies = [body if name == self.bodies[-1] else _UNSEEN for name in enabled]
        for client in tuple(self._clients):
            if client.component is not None and t_s >= client.next_s:
                client.next_s = max(client.next_s + client.period_s, t_s)
                residual = (1000.0 * self.residual_m,) if client.component is Component.BODIES_WITH_RESIDUAL else ()
                shown = [(*numbers, *residual) for numbers in bodies]
                self._write(client, frame(round(1e6 * t_s), self._number, shown, client.component))

    def _accept(self) -> None:
        while True:
            try:
                wire, _ = self._socket.accept()
            except OSError:
                return  # closed
            wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            wire.settimeout(_CLIENT_READS_WITHIN_S)
            client = _Client(wire)
            self._clients.append(client)
            threading.Thread(target=self._serve, args=(client,), name="mock QTM's client", daemon=True).start()

    def _serve(self, client: _Client) -> None:
        buffer = bytearray()
        with client.wire:
            if not self.faults.is_mute:
                self._write(client, text(Kind.COMMAND, GREETING))
            with suppress(OSError, ValueError):
                while data := self._heard(client):
                    buffer += data
                    for kind, said in whole_packets(buffer):
                        if kind is Kind.COMMAND and not self.faults.is_mute:
                            self._obey(client, said[HEADER.size : -1].decode(errors="replace").lower())
            self._clients.remove(client)

    def _heard(self, client: _Client) -> bytes:
        while True:
            with suppress(TimeoutError):
                return client.wire.recv(4096)

    def _obey(self, client: _Client, command: str) -> None:
        match command.split():
            case ["version", version] if version in self.faults.versions:
                self._write(client, text(Kind.COMMAND, f"Version set to {version}"))
            case ["version", *_]:
                self._write(client, text(Kind.ERROR, "Version NOT supported"))
            case ["getparameters", *what]:
                self._write(client, text(Kind.XML, self._parameters(what)))
            case ["streamframes", "stop"]:
                client.component = None
            case ["streamframes", rate, kind] if kind in _COMPONENTS and (self.faults.has_residual or kind == "6d"):
                client.period_s = 1.0 / float(rate.removeprefix("frequency:")) if rate != "allframes" else 0.0
                client.component = _COMPONENTS[kind]  # the first frame is the answer
                if not self._number:
                    self._write(client, packet(Kind.NO_MORE_DATA, b""))
            case _:
                self._write(client, text(Kind.ERROR, "Parse error"))

    def _parameters(self, what: Sequence[str]) -> str:
        told = ""
        if "3d" in what and self.faults.vertical:
            told += f"<The_3D><AxisUpwards>{self.faults.vertical}</AxisUpwards></The_3D>"
        if "6d" in what:
            told += f"<The_6D>{''.join(map(self._described, self.bodies))}</The_6D>"
        return f"<QTM_Parameters_Ver_{VERSION}>{told}</QTM_Parameters_Ver_{VERSION}>"

    def _described(self, body: str) -> str:
        is_enabled = "false" if body in self.faults.disabled else "true"
        return f"<Body><Name>{escape(body)}</Name><Enabled>{is_enabled}</Enabled></Body>"

    def _write(self, client: _Client, data: bytes) -> None:
        step = self.faults.fragment_bytes or len(data)
        with client.lock:
            try:
                for start in range(0, len(data), step):
                    client.wire.sendall(data[start : start + step])
            except OSError:
                _shut(client.wire)


def _shut(wire: socket.socket) -> None:
    with suppress(OSError):  # it is shut already
        wire.shutdown(socket.SHUT_RDWR)
