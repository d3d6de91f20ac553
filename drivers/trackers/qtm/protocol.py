"""The real-time protocol of Qualisys Track Manager, version 1.25, as far as a tracker needs it. Little-endian.

A packet is its size (uint32, header included), its type (uint32) and a body; commands and XML end in NUL. A data packet
has a time (int64, us), a frame number and a count of components, each with its size, its type and a body. The 6D
components hold for each rigid body three floats (mm), nine floats (a rotation, column by column), and, in the one
with residual, one float (mm). A body that is not seen is all NaN.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from xml.etree import ElementTree

VERSION = "1.25"
PORT = 22223
GREETING = b"QTM RT Interface connected"
HEADER = struct.Struct("<II")

_FRAME, _COMPONENT, _BODIES = struct.Struct("<qII"), struct.Struct("<II"), struct.Struct("<ihh")
_GREATEST_BYTES = 4 << 20  # more than the parameters of any laboratory
_MOST_COMPONENTS = 32


class Kind(IntEnum):
    """What a packet is."""

    ERROR = 0
    COMMAND = 1
    XML = 2
    DATA = 3
    NO_MORE_DATA = 4
    EVENT = 6


class Component(IntEnum):
    """The components of a frame that hold rigid bodies with a rotation matrix."""

    BODIES = 5
    BODIES_WITH_RESIDUAL = 11


_BODY_BYTES = {Component.BODIES: 48, Component.BODIES_WITH_RESIDUAL: 52}


class Event(IntEnum):
    """What QTM tells without being asked."""

    CONNECTED = 1
    CONNECTION_CLOSED = 2
    CAPTURE_STARTED = 3
    CAPTURE_STOPPED = 4
    FETCHING_FINISHED = 5
    CALIBRATION_STARTED = 6
    CALIBRATION_STOPPED = 7
    FILE_STARTED = 8
    FILE_STOPPED = 9
    WAITING_FOR_TRIGGER = 10
    SETTINGS_CHANGED = 11
    SHUTTING_DOWN = 12
    CAPTURE_SAVED = 13
    REPROCESSING_STARTED = 14
    REPROCESSING_STOPPED = 15
    TRIGGER = 16


_KINDS, _EVENTS = frozenset(Kind), frozenset(Event)

ENDINGS = {
    Event.CONNECTION_CLOSED: "QTM has closed the measurement; open a new one (File, New)",
    Event.CAPTURE_STOPPED: "the capture has stopped; start the next one, or let QTM stream its preview",
    Event.CALIBRATION_STARTED: "the cameras are being calibrated; wait until that is done",
    Event.FILE_STOPPED: "QTM no longer plays its file; play it again with real-time output",
    Event.WAITING_FOR_TRIGGER: "QTM waits for its trigger; give it, or start the capture without one",
    Event.SHUTTING_DOWN: "QTM is shutting down; start it again",
    Event.REPROCESSING_STARTED: "QTM is reprocessing a file; wait until that is done",
}
"""The events after which there is no pose until the next frame, each with its cure."""


@dataclass(frozen=True, slots=True)
class NamedBody:
    """A rigid body in QTM's settings."""

    name: str
    is_enabled: bool


def whole_packets(buffer: bytearray) -> Iterator[tuple[Kind, bytes]]:
    """Take the whole packets out of ``buffer``, and yield those of a known kind with their bytes, header included.

    Raises:
        ValueError: the bytes are none of this protocol, or malformed: what follows cannot be understood any more.
    """
    while len(buffer) >= HEADER.size:
        size, kind = HEADER.unpack_from(buffer)
        if not HEADER.size <= size <= _GREATEST_BYTES:
            raise ValueError(f"a packet of {size} bytes; is it QTM's little-endian port, {PORT} by default?")
        if len(buffer) < size:
            return
        packet = bytes(buffer[:size])
        del buffer[:size]
        if kind in _KINDS:
            check_packet(Kind(kind), packet)
            yield Kind(kind), packet


def check_packet(kind: Kind, packet: bytes) -> None:
    """Raise ValueError if a packet does not hold what its counts and sizes say."""
    match kind:
        case Kind.DATA:
            _check_frame(packet)
        case Kind.EVENT if len(packet) != HEADER.size + 1 or packet[-1] not in _EVENTS:
            raise ValueError("an event that is none")
        case Kind.ERROR | Kind.COMMAND | Kind.XML if packet[-1:] != b"\0" or len(packet) == HEADER.size:
            raise ValueError("a text without an end")


def _check_frame(packet: bytes) -> None:
    if len(packet) < HEADER.size + _FRAME.size:
        raise ValueError("a frame without a head")
    count, place = _FRAME.unpack_from(packet, HEADER.size)[2], HEADER.size + _FRAME.size
    if count > _MOST_COMPONENTS:
        raise ValueError(f"a frame of {count} components")
    for _ in range(count):
        if len(packet) < place + _COMPONENT.size:
            raise ValueError("a component without a head")
        size, kind = _COMPONENT.unpack_from(packet, place)
        if kind not in _BODY_BYTES or not _COMPONENT.size + _BODIES.size <= size <= len(packet) - place:
            raise ValueError(f"a component of kind {kind} and {size} bytes")
        bodies = _BODIES.unpack_from(packet, place + _COMPONENT.size)[0]
        if size != _COMPONENT.size + _BODIES.size + bodies * _BODY_BYTES[Component(kind)]:
            raise ValueError(f"{bodies} bodies in {size} bytes")
        place += size
    if place != len(packet):
        raise ValueError("a frame with something behind its end")


def bodies_in(parameters: bytes) -> tuple[NamedBody, ...]:
    """Return the rigid bodies in QTM's parameters (XML), in the order of the frames. Raises ValueError."""
    try:
        root = ElementTree.fromstring(parameters)
    except ElementTree.ParseError as error:
        raise ValueError(f"QTM's parameters are no XML: {error}") from None
    return tuple(
        NamedBody(body.findtext("Name", "").strip(), body.findtext("Enabled", "true").strip().lower() != "false")
        for body in root.findall("*/Body")
    )


def vertical_in(parameters: bytes) -> str:
    """Return the axis that points upwards, as in QTM's parameters (XML): ``+Z``; empty where they do not tell."""
    try:
        return ElementTree.fromstring(parameters).findtext("The_3D/AxisUpwards", "").strip().upper()
    except ElementTree.ParseError:
        return ""


def packet(kind: Kind, body: bytes) -> bytes:
    """Return a packet."""
    return HEADER.pack(HEADER.size + len(body), kind) + body


def text(kind: Kind, words: str | bytes) -> bytes:
    """Return a packet of text: a command, an error or XML."""
    return packet(kind, (words.encode() if isinstance(words, str) else words) + b"\0")


def frame(time_us: int, number: int, bodies: Sequence[Sequence[float]], component: Component) -> bytes:
    """Return a data packet; ``bodies`` are of 12 numbers each (mm, matrix by columns), or 13 with a residual (mm)."""
    floats = b"".join(struct.pack(f"<{_BODY_BYTES[component] // 4}f", *body) for body in bodies)
    content = _BODIES.pack(len(bodies), 0, 0) + floats
    head = _FRAME.pack(time_us, number & 0xFFFFFFFF, 1) + _COMPONENT.pack(_COMPONENT.size + len(content), component)
    return packet(Kind.DATA, head + content)
