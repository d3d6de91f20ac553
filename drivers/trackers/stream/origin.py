"""Whose poses arrive on a port: those of one body, from one sender."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from vvvaltr.controller.core.values import Vector
from vvvaltr.drivers.trackers.stream.message import Told
from vvvaltr.drivers.trackers.stream.wire import Address

_SILENCE_S = 1.0  # after which another sender may take over
_APART_M = 0.05  # further than a robot gets from one frame to the next
_NEAR_M = 0.02  # what a body moves within a few frames
_JUDGED, _MOST_RETURNS = 10, 5  # frames; an outlier now and then is not a second body


@dataclass(frozen=True, slots=True)
class _Origin:
    sender: Address
    name: str

    def __str__(self) -> str:
        address = f"{self.sender[0]}:{self.sender[1]}"
        return f"{self.name[:40]!r} from {address}" if self.name else address


class OneOrigin:
    """Tells the robot's poses from those of others.

    Args:
        wanted: name of the body; empty for whatever body there is, but only one.
    """

    def __init__(self, wanted: str) -> None:
        self._wanted = wanted
        self._ours: _Origin | None = None
        self._sequence = -1
        self._heard: dict[_Origin, float] = {}

    def is_wanted(self, told: Told) -> bool:
        """Return whether the pose is of the body that was asked for."""
        return not self._wanted or told.name == self._wanted

    def conflict(self, told: Told, sender: Address, received_s: float) -> tuple[str, str] | None:
        """Return why it is not clear which body is the robot, and the cure; None if it is."""
        origin = _Origin(sender, told.name)
        self._heard = {other: at_s for other, at_s in self._heard.items() if received_s - at_s < _SILENCE_S}
        if self._ours not in self._heard or self._has_moved(origin, told.sequence):
            self._heard.pop(self._ours or origin, None)
            self._ours = origin
        self._heard[origin] = received_s
        if origin == self._ours:
            self._sequence = told.sequence
        others = [other for other in self._heard if other != self._ours]
        if self._ours is None or not others:
            return None
        if others[0].sender == self._ours.sender:
            bodies = " and ".join(
                f"{body.name[:40]!r}" if body.name else "one without a name" for body in (self._ours, others[0])
            )
            return f"poses of two bodies come, {bodies}", 'say which one is the robot, name = "..." under [tracker]'
        cure = "end one of them" if self._wanted else 'end one of them, or name the robot\'s body, name = "robot"'
        return f"two senders send poses to one port, {self._ours} and {others[0]}", cure

    def _has_moved(self, origin: _Origin, sequence: int) -> bool:
        """Return whether our sender goes on from another port: some open a socket for each pose."""
        ours = self._ours
        if ours is None or origin in self._heard:
            return False
        is_alike = (origin.sender[0], origin.name) == (ours.sender[0], ours.name)
        return is_alike and sequence == self._sequence + 1


class TwoPlaces:
    """Notices poses that jump to and fro: two bodies, sent by one sender without names."""

    def __init__(self) -> None:
        self._places_m: deque[Vector] = deque(maxlen=3)
        self._returns_m: deque[float] = deque(maxlen=_JUDGED)

    def conflict(self, position_m: Vector) -> tuple[str, str] | None:
        """Take in a position; return why it is not clear where the robot is, and the cure; None if it is."""
        if self._places_m:
            *before, last_m = self._places_m
            step_m = math.dist(position_m, last_m)
            is_return = step_m > _APART_M and any(math.dist(position_m, place_m) < _NEAR_M for place_m in before)
            self._returns_m.append(step_m if is_return else 0.0)
        self._places_m.append(position_m)
        returns_m = [step_m for step_m in self._returns_m if step_m]
        if len(returns_m) <= _MOST_RETURNS:
            return None
        return (
            f"the poses jump to and fro by {min(returns_m):.3g} m, as of two bodies",
            'send the robot alone, or let the sender name them and write name = "robot"',
        )
