"""One pose as one JSON object, and what is understood of it.

::

    {"sequence": 17, "t_s": 3.4, "position_m": [0.12, 0.0, 0.03], "yaw_rad": 0.1, "pitch_rad": 0.0, "roll_rad": 0.0,
     "markers_m": [[0.1, 0.0, 0.0], ...], "uncertainty_m": 0.0002, "name": "robot"}

``sequence`` counts up, and may begin anew; ``t_s`` is when the pose was taken, on any clock; ``position_m`` is null
while the tracker does not see the robot. All from the angles on may be left out; markers are the strut ends. A NaN or
null in place of a number makes a gap: the pose before it counts until it is too old. One in a marker leaves the
markers out, and the pose counts.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import msgspec

from vvvaltr.controller.core.spelling import did_you_mean
from vvvaltr.controller.core.values import Pose, Vector

Unit = Literal["m", "cm", "mm"]
Up = Literal["z", "y"]
AngleUnit = Literal["rad", "deg"]

_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_MEANT = {
    "yaw": "yaw_rad",
    "heading": "yaw_rad",
    "heading_rad": "yaw_rad",
    "theta": "yaw_rad",
    "yaw_deg": 'yaw_rad, with yaw_unit = "deg" under [tracker]',
    "heading_deg": 'yaw_rad, with yaw_unit = "deg" under [tracker]',
    "position_mm": 'position_m, with unit = "mm" under [tracker]',
    "body": "name",
    "id": "name",
}
"""Keys that others use, and ours."""

_Number = float | None
_Numbers = tuple[_Number, _Number, _Number]


class _Message(msgspec.Struct):
    sequence: int
    t_s: _Number
    position_m: _Numbers | None
    yaw_rad: _Number = 0.0
    pitch_rad: _Number = 0.0
    roll_rad: _Number = 0.0
    markers_m: tuple[_Numbers | None, ...] | None = ()
    uncertainty_m: _Number = None
    name: str = ""


@dataclass(frozen=True, slots=True)
class Axes:
    """How a sender's numbers are meant.

    Args:
        unit: of positions, markers and the uncertainty.
        up: the axis that points upwards; with ``"y"``, the yaw is about it, counterclockwise seen from above.
        yaw_unit: of yaw, pitch and roll.
    """

    unit: Unit = "m"
    up: Up = "z"
    yaw_unit: AngleUnit = "rad"

    def place_m(self, numbers: Iterable[float]) -> Vector:
        """Return a position in metres, z upwards."""
        x_m, y_m, z_m = (_METRES[self.unit] * number for number in numbers)
        return (x_m, y_m, z_m) if self.up == "z" else (x_m, -z_m, y_m)

    def angle_rad(self, number: float) -> float:
        """Return an angle in radians."""
        return number if self.yaw_unit == "rad" else math.radians(number)


OURS = Axes()
"""Metres and radians, z upwards."""


@dataclass(frozen=True, slots=True)
class Told:
    """What one datagram tells.

    Args:
        sequence: its number.
        pose: on the sender's clock; None where there is none.
        missing: the number for want of which there is no pose; empty if none is missing, or the robot is not seen.
        name: of the body; empty where the sender names none.
        keys: those that are not known.
    """

    sequence: int
    pose: Pose | None
    missing: str = ""
    name: str = ""
    keys: tuple[str, ...] = ()


def encode_pose(sequence: int, pose: Pose, name: str = "") -> bytes:
    """Return the datagram for a pose."""
    angles = (pose.yaw_rad, pose.pitch_rad, pose.roll_rad)
    return msgspec.json.encode(
        _Message(sequence, pose.t_s, pose.position_m, *angles, pose.markers_m, pose.uncertainty_m, name)
    )


def encode_lost(sequence: int, t_s: float) -> bytes:
    """Return the datagram that says that the robot is not seen: ends a trial at once."""
    return msgspec.json.encode(_Message(sequence, t_s, None))


def decode_pose(datagram: bytes, axes: Axes = OURS) -> Told:
    """Return what a datagram tells. Raises ValueError for one that is malformed."""
    try:
        content = _plain(datagram)
        message = msgspec.convert(content, _Message)
    except (msgspec.DecodeError, ValueError, OverflowError, RecursionError) as error:
        raise ValueError(f"malformed pose: {error}") from error
    keys = tuple(sorted(content.keys() - set(_Message.__struct_fields__)))
    if message.position_m is None:
        return Told(message.sequence, None, "", message.name, keys)
    pose = _pose(message, axes)
    return Told(message.sequence, pose, "" if pose else _missing(message), message.name, keys)


def explain_key(key: str) -> str:
    """Return what a sender probably meant by a key that is not known; empty where nothing is like it."""
    meant = _MEANT.get(key.lower())
    guess = f" (did you mean {meant}?)" if meant else did_you_mean(key, _Message.__struct_fields__)
    return f"the poses have a key {key[:40]!r}, which is not known{guess}" if guess else ""


def _plain(datagram: bytes) -> Mapping[str, Any]:
    try:
        content = msgspec.json.decode(datagram)
    except msgspec.DecodeError:
        content = json.loads(datagram)  # it understands NaN, which JSON does not know, but many programs write
    if not isinstance(content, dict):
        raise ValueError("it is not a JSON object")
    return content


def _pose(message: _Message, axes: Axes) -> Pose | None:
    """Return the pose; None if a number of it is missing."""
    numbers = (message.t_s, message.yaw_rad, message.pitch_rad, message.roll_rad)
    place, known = _known(message.position_m), _known(numbers)
    if place is None or known is None:
        return None
    t_s, *angles = known
    yaw_rad, pitch_rad, roll_rad = map(axes.angle_rad, angles)
    markers = [_known(marker) for marker in message.markers_m or ()]
    uncertainty = _known((message.uncertainty_m,))
    return Pose(
        t_s,
        axes.place_m(place),
        yaw_rad,
        pitch_rad,
        roll_rad,
        markers_m=() if None in markers else tuple(axes.place_m(marker) for marker in markers if marker),
        uncertainty_m=_METRES[axes.unit] * uncertainty[0] if uncertainty else None,
    )


def _missing(message: _Message) -> str:
    """Return which of a pose's numbers is missing first."""
    needed = {"position_m": message.position_m, "t_s": (message.t_s,), "yaw_rad": (message.yaw_rad,)}
    return next((key for key, numbers in needed.items() if _known(numbers) is None), "pitch_rad or roll_rad")


def _known(numbers: Iterable[float | None] | None) -> tuple[float, ...] | None:
    """Return the numbers; None if one is missing."""
    found = tuple(numbers or ())
    known = tuple(number for number in found if number is not None and math.isfinite(number))
    return known if known and len(known) == len(found) else None
