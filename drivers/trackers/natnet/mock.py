"""A stand-in for OptiTrack's Motive: serves the poses of a robot over NatNet, by unicast or multicast."""

from __future__ import annotations

import itertools
import select
import socket
import struct
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.attitude import quaternion_of
from vvvaltr.drivers.trackers.natnet.protocol import (
    BODY,
    COUNT,
    END,
    FLAGS,
    GROUP,
    NAMED_MARKERS,
    PRECISE_STAMPS,
    SERVER,
    SERVER_MORE,
    SIZED,
    STAMPS,
    Description,
    Message,
    Version,
    message,
    message_in,
)

HOST = "127.0.0.1"
CLOCK_HZ = 10_000_000
_FORGET_S, _LOOK_S = 5.0, 0.05
_MARKER = struct.Struct("<I3ffHf")
_TURNED = (4, 2)


@dataclass(slots=True)
class NatnetFaults:
    """How the server misbehaves; may be changed while it runs.

    Args:
        is_mute: it hears everything and says nothing.
        repeats_frame: it sends frames, all with the same number.
        has_exposure: whether its cameras tell when they were open.
    """

    is_mute: bool = False
    repeats_frame: bool = False
    has_exposure: bool = True


class NatnetServer:
    """Serves frames: satisfies ``PoseFeed``. The robot is the last of its ``bodies``; the others are never tracked.

    Args:
        host, port: where to listen; port 0 for any that is free.
        bodies: names of the rigid bodies; their ids are 101, 102 and so on.
        version: of the protocol.
        up: the axis that points upwards.
        data_port: of the multicast group; 0 for unicast.
        faults: how it misbehaves.
    """

    def __init__(
        self,
        host: str = HOST,
        port: int = 0,
        bodies: Sequence[str] = ("wand", "robot"),
        version: Version = (4, 1),
        up: str = "y",
        data_port: int = 0,
        faults: NatnetFaults | None = None,
    ) -> None:
        self.bodies = tuple(bodies)
        self.version = version
        self.faults = faults or NatnetFaults()
        self.models_changed = False
        self._up, self._data_port = up, data_port
        self._numbers = itertools.count(1)
        self._number = 0
        self._clients: dict[tuple[str, int], float] = {}  # when they were heard last
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(host))
        self._socket.bind((host, port))
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="mock Motive", daemon=True)
        self._thread.start()

    def send(self, pose: Pose) -> None:
        """Send a frame that shows the robot."""
        x, y, z = pose.position_m
        qx, qy, qz, qw = quaternion_of((pose.yaw_rad, pose.pitch_rad, pose.roll_rad))
        if self._up == "y":
            y, z, qy, qz = z, -y, qz, -qy
        self._send_frame(pose.t_s, (x, y, z, qx, qy, qz, qw, 0.0003, 1))

    def send_lost(self, t_s: float) -> None:
        """Send a frame in which the robot is not tracked: with the pose that Motive saw last, as it does."""
        self._send_frame(t_s, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0))

    def send_bytes(self, datagram: bytes) -> None:
        """Send anything to all who listen to frames."""
        self._clients = {
            client: heard_s for client, heard_s in self._clients.items() if time.monotonic() - heard_s < _FORGET_S
        }
        for address in [(GROUP, self._data_port)] if self._data_port else tuple(self._clients):
            self._say(datagram, address)

    @property
    def listeners(self) -> int:
        """How many clients have been heard of late."""
        return len(self._clients)

    def close(self) -> None:
        """Listen no more. Idempotent."""
        self._closing.set()
        self._thread.join()
        self._socket.close()

    def _send_frame(self, t_s: float, body: tuple[float, ...]) -> None:
        if self.faults.is_mute:
            return
        if not (self.faults.repeats_frame and self._number):
            self._number = next(self._numbers)
        unseen = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0)
        shown = {101 + i: body if name == self.bodies[-1] else unseen for i, name in enumerate(self.bodies)}
        exposed_s = t_s if self.faults.has_exposure else 0.0
        content = frame(self._number, shown, t_s, exposed_s, self.version, self.models_changed)
        self.send_bytes(message(Message.FRAME, content))

    def _listen(self) -> None:
        while not self._closing.is_set():
            if not select.select((self._socket,), (), (), _LOOK_S)[0]:
                continue
            with suppress(OSError, ValueError):
                datagram, client = self._socket.recvfrom(65536)
                if not self.faults.is_mute:
                    self._answer(message_in(datagram)[0], client)

    def _answer(self, kind: int, client: tuple[str, int]) -> None:
        if kind == Message.DISCONNECT:
            self._clients.pop(client, None)
            return
        self._clients = {
            **self._clients,
            client: time.monotonic(),
        }  # a new one: the other thread may go through the old
        if kind == Message.CONNECT:
            version = (*self.version, 0, 0)
            content = SERVER.pack(b"Motive", 3, 0, 0, 0, *version)
            group = map(int, GROUP.split(".")) if self._data_port else (0, 0, 0, 0)
            content += SERVER_MORE.pack(CLOCK_HZ, self._data_port or 1511, bool(self._data_port), *group)
            self._say(message(Message.SERVER_INFO, content), client)
        elif kind == Message.REQUEST_MODEL:
            self.models_changed = False
            self._say(message(Message.MODEL, model(self.bodies, self.version)), client)

    def _say(self, datagram: bytes, address: tuple[str, int]) -> None:
        with suppress(OSError):  # nobody listens, or the network is full
            self._socket.sendto(datagram, address)


def frame(
    number: int,
    bodies: dict[int, tuple[float, ...]],
    t_s: float,
    exposed_s: float,
    version: Version,
    models_changed: bool = False,
) -> bytes:
    """Return a frame with all sections, as Motive sends them; ``bodies`` as ``protocol.BODY`` has them, by id."""

    def section(*things: bytes) -> bytes:
        size = COUNT.pack(sum(map(len, things))) if version >= SIZED else b""
        return COUNT.pack(len(things)) + size + b"".join(things)

    point = struct.pack("<3f", 1.0, 2.0, 3.0)
    records = [BODY.pack(body, *numbers) for body, numbers in bodies.items()]
    channels = COUNT.pack(2) + 2 * (COUNT.pack(3) + struct.pack("<3f", 0.1, 0.2, 0.3))
    sections = [
        section(b"robot\0" + COUNT.pack(2) + 2 * point, b"all\0" + COUNT.pack(0)),
        section(point, point, point),
        section(*records),
        section(COUNT.pack(7) + COUNT.pack(len(records)) + b"".join(records)),
        *([section(b"an asset of any size")] if version >= SIZED else []),
        section(*(_MARKER.pack(i, 1.0, 2.0, 3.0, 0.01, 10, 0.0002) for i in range(3))),
        section(COUNT.pack(1) + channels),
        section(COUNT.pack(2) + channels),
    ]
    ticks = round(exposed_s * CLOCK_HZ)
    stamps = STAMPS.pack(0, 0, t_s, ticks, ticks and ticks + 1000, ticks and ticks + 2000)
    precise = PRECISE_STAMPS.pack(int(t_s), 0) if version >= SIZED else b""
    return COUNT.pack(number) + b"".join(sections) + stamps + precise + FLAGS.pack(2 * models_changed) + END


def model(bodies: Sequence[str], version: Version) -> bytes:
    """Return the model definition, with one part of each kind before and behind the rigid bodies."""
    described = [_described(name, 101 + i, version) for i, name in enumerate(bodies)]
    plate = COUNT.pack(1) + b"serial\0" + bytes(4 * 161) + struct.pack("<II", 0, 2) + COUNT.pack(1) + b"Fx\0"
    device = COUNT.pack(1) + b"device\0serial\0" + bytes(8) + COUNT.pack(2) + b"a\0b\0"
    parts = [
        (Description.MARKER_SET, b"all\0" + COUNT.pack(2) + b"a\0b\0"),
        (Description.FORCE_PLATE, plate),
        (Description.DEVICE, device),
        (Description.SKELETON, b"cat\0" + COUNT.pack(1) + COUNT.pack(1) + _described("hip", 1, version)),
        *((Description.RIGID_BODY, body) for body in described),
        (Description.CAMERA, b"camera\0" + bytes(28)),
    ]
    told = [COUNT.pack(kind) + (COUNT.pack(len(part)) if version >= SIZED else b"") + part for kind, part in parts]
    return COUNT.pack(len(told)) + b"".join(told)


def _described(name: str, number: int, version: Version) -> bytes:
    head = name.encode() + b"\0" + COUNT.pack(number) + COUNT.pack(0xFFFFFFFF) + bytes(12)
    turned = struct.pack("<4f", 0.0, 0.0, 0.0, 1.0) if version >= _TURNED else b""
    names = b"m1\0m2\0m3\0" if version >= NAMED_MARKERS else b""
    return head + turned + COUNT.pack(3) + bytes(3 * 12) + bytes(3 * 4) + names
