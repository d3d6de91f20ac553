"""OptiTrack's NatNet protocol, versions 3.0 to 4.x, as far as a tracker needs it. Little-endian datagrams.

A datagram is a message id (uint16), the number of bytes that follow (uint16), and these. A frame is a row of sections,
each with its count and, from version 4.1 on, its size in bytes; before, every section must be understood to find the
next one. Rigid bodies come by id; their names are in the model definition alone.

Every count is bounded by what is left of the datagram, and a frame must end where its datagram ends.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from vvvaltr.controller.core.values import Vector
from vvvaltr.drivers.trackers.attitude import Quaternion

COMMAND_PORT, DATA_PORT, GROUP = 1510, 1511, "239.255.42.99"
Version = tuple[int, int]
OLDEST, NAMED_MARKERS, SIZED, NEWEST_KNOWN = (3, 0), (4, 0), (4, 1), (4, 2)

HEAD, COUNT = struct.Struct("<HH"), struct.Struct("<I")
BODY = struct.Struct("<I3f4ffH")
STAMPS, PRECISE_STAMPS, FLAGS, END = struct.Struct("<IId3Q"), struct.Struct("<II"), struct.Struct("<H"), bytes(4)
SERVER = struct.Struct("<256s4B4B")
SERVER_MORE = struct.Struct("<QH?4B")
_LABELLED, _POINT, _WORD, _CAMERA = 26, 12, 4, 28  # bytes
_PLATE = 4 * (2 + 3 + 144 + 12 + 2)  # width, length, origin, calibration, corners, type, channel's type
_TRACKED, _MODELS_CHANGED = 1, 2


class Message(IntEnum):
    """What a datagram is."""

    CONNECT = 0
    SERVER_INFO = 1
    REQUEST_MODEL = 4
    MODEL = 5
    FRAME = 7
    DISCONNECT = 9
    KEEP_ALIVE = 10


class Description(IntEnum):
    """What the parts of a model definition describe."""

    MARKER_SET = 0
    RIGID_BODY = 1
    SKELETON = 2
    FORCE_PLATE = 3
    DEVICE = 4
    CAMERA = 5


@dataclass(frozen=True, slots=True)
class ServerInfo:
    """What a server says of itself.

    Args:
        name: of the program.
        version: of the protocol.
        clock_hz: ticks per second of the time stamps in frames; 0 where it does not tell.
        group: the multicast address that it sends frames to; empty if it sends them to each client.
        data_port: the port for them.
    """

    name: str
    version: Version
    clock_hz: int = 0
    group: str = ""
    data_port: int = DATA_PORT


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body in a frame: position in m, rotation, mean error of its markers in m, and whether it was seen."""

    position_m: Vector
    quaternion: Quaternion
    error_m: float
    is_tracked: bool


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame.

    Args:
        number: counts up.
        bodies: by id.
        t_s: the server's time.
        exposure_ticks: when the shutters were open, on the server's clock; 0 where the cameras do not tell.
        models_changed: whether the model definition is no longer the one that was sent.
    """

    number: int
    bodies: dict[int, Body]
    t_s: float
    exposure_ticks: int
    models_changed: bool


class _Reader:
    """Reads a datagram from its start. Raises ValueError where it ends too soon."""

    def __init__(self, data: bytes) -> None:
        self._data, self._place = data, 0

    @property
    def left(self) -> int:
        """How many bytes there are still."""
        return len(self._data) - self._place

    def skip(self, size: int) -> bytes:
        """Return the next bytes."""
        if size > self.left:
            raise ValueError(f"{size} bytes where {self.left} are left")
        self._place += size
        return self._data[self._place - size : self._place]

    def number(self) -> int:
        """Return the next whole number."""
        return int(COUNT.unpack(self.skip(COUNT.size))[0])

    def count(self, least_size: int = 1) -> int:
        """Return the count of the following things, each of ``least_size`` bytes or more."""
        count = self.number()
        if count * least_size > self.left:
            raise ValueError(f"{count} things in {self.left} bytes")
        return count

    def name(self) -> str:
        """Return the next text."""
        end = self._data.find(b"\0", self._place)
        if end < 0:
            raise ValueError("a name without an end")
        return self.skip(end + 1 - self._place)[:-1].decode(errors="replace")

    def row(self, size: int) -> None:
        """Pass over a count of things, each of ``size`` bytes."""
        self.skip(self.count(size) * size)

    def each(self, pass_one: Callable[[_Reader], object], least_size: int) -> None:
        """Pass over a count of things."""
        for _ in range(self.count(least_size)):
            pass_one(self)


def message_in(datagram: bytes) -> tuple[int, bytes]:
    """Return id and content of a datagram. Raises ValueError if it is not as long as it says."""
    if len(datagram) < HEAD.size:
        raise ValueError("a datagram without a head")
    message, size = HEAD.unpack_from(datagram)
    if size != len(datagram) - HEAD.size:
        raise ValueError(f"{len(datagram) - HEAD.size} bytes where {size} are announced")
    return message, datagram[HEAD.size :]


def message(kind: Message, content: bytes = b"") -> bytes:
    """Return a datagram."""
    return HEAD.pack(kind, len(content)) + content


def server_info_in(content: bytes) -> ServerInfo:
    """Return what a server says of itself. Raises ValueError."""
    reader = _Reader(content)
    name, *numbers = SERVER.unpack(reader.skip(SERVER.size))
    said = name.split(b"\0")[0].decode(errors="replace")
    version = (numbers[4], numbers[5])
    if reader.left < SERVER_MORE.size:
        return ServerInfo(said, version)
    clock_hz, data_port, is_multicast, *group = SERVER_MORE.unpack(reader.skip(SERVER_MORE.size))
    return ServerInfo(said, version, clock_hz, ".".join(map(str, group)) if is_multicast else "", data_port)


def frame_in(content: bytes, version: Version) -> Frame:
    """Return what a frame shows. Raises ValueError for one that is not laid out as ``version`` says."""
    reader = _Reader(content)
    number = reader.number()
    _pass_section(reader, version, lambda sets: sets.each(_pass_marker_set, 1 + COUNT.size))
    _pass_section(reader, version, lambda markers: markers.row(_POINT))
    bodies = _bodies(reader, version)
    _pass_section(reader, version, lambda skeletons: skeletons.each(_pass_skeleton, 2 * COUNT.size))
    if version >= SIZED:
        _pass_section(reader, version, lambda assets: None)
    _pass_section(reader, version, lambda markers: markers.row(_LABELLED))
    for _ in ("force plates", "devices"):
        _pass_section(reader, version, lambda devices: devices.each(_pass_device, 2 * COUNT.size))
    _, _, t_s, exposure_ticks, _, _ = STAMPS.unpack(reader.skip(STAMPS.size))
    if not math.isfinite(t_s):
        raise ValueError(f"a frame whose time is {t_s}")
    if version >= SIZED:
        reader.skip(PRECISE_STAMPS.size)
    (flags,) = FLAGS.unpack(reader.skip(FLAGS.size))
    # A later version may say more there.
    if reader.skip(reader.left) not in (b"", END) and version <= NEWEST_KNOWN:
        raise ValueError("a frame with something behind its end")
    return Frame(number, bodies, t_s, exposure_ticks, bool(flags & _MODELS_CHANGED))


def _pass_section(reader: _Reader, version: Version, pass_things: Callable[[_Reader], object]) -> None:
    if version >= SIZED:
        reader.number()
        reader.skip(reader.count())
    else:
        pass_things(reader)


def _bodies(reader: _Reader, version: Version) -> dict[int, Body]:
    count = reader.count(BODY.size)
    if version >= SIZED and (size := reader.count()) != count * BODY.size:
        raise ValueError(f"{count} rigid bodies in {size} bytes")
    bodies = {}
    for _ in range(count):
        number, x, y, z, qx, qy, qz, qw, error_m, flags = BODY.unpack(reader.skip(BODY.size))
        bodies[number] = Body((x, y, z), (qx, qy, qz, qw), error_m, bool(flags & _TRACKED))
    if len(bodies) != count:
        raise ValueError("two rigid bodies with one id")
    return bodies


def _pass_marker_set(reader: _Reader) -> None:
    reader.name()
    reader.row(_POINT)


def _pass_skeleton(reader: _Reader) -> None:
    reader.number()
    reader.row(BODY.size)


def _pass_device(reader: _Reader) -> None:
    reader.number()
    reader.each(lambda channel: channel.row(_WORD), COUNT.size)


def bodies_in(content: bytes, version: Version) -> dict[str, int]:
    """Return the ids of the rigid bodies in a model definition, by name. Raises ValueError."""
    reader, bodies = _Reader(content), {}
    for _ in range(reader.count(COUNT.size)):
        kind = reader.number()
        part = _Reader(reader.skip(reader.count())) if version >= SIZED else reader
        if kind == Description.RIGID_BODY:
            name, number = _described_body(part, version)
            bodies[name] = number
        elif version < SIZED:
            _pass_description(part, kind, version)
    return bodies


def _described_body(reader: _Reader, version: Version) -> tuple[str, int]:
    name = reader.name()
    number = reader.number()
    if version >= SIZED:
        return name, number  # the rest is passed over with the part
    reader.skip(COUNT.size + _POINT)
    markers = reader.count(_POINT + _WORD)
    reader.skip(markers * (_POINT + _WORD))
    for _ in range(markers if version >= NAMED_MARKERS else 0):
        reader.name()
    return name, number


def _pass_description(reader: _Reader, kind: int, version: Version) -> None:
    match kind:
        case Description.MARKER_SET:
            reader.name()
            reader.each(_Reader.name, 1)
        case Description.SKELETON:
            reader.name()
            reader.number()
            reader.each(lambda reader: _described_body(reader, version), 1)
        case Description.FORCE_PLATE:
            reader.number()
            reader.name()
            reader.skip(_PLATE)
            reader.each(_Reader.name, 1)
        case Description.DEVICE:
            reader.number()
            reader.name()
            reader.name()
            reader.skip(2 * _WORD)
            reader.each(_Reader.name, 1)
        case Description.CAMERA:
            reader.name()
            reader.skip(_CAMERA)
        case _:
            raise ValueError(f"a description of kind {kind}")
