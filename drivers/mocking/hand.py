"""The hand beside a mock's robot: asked over a channel of its own, it puts the twin back as an operator would.

One JSON object a datagram, over UDP on this computer: the start place there, ``{"number": N}`` back when it is done.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import count

import msgspec
import numpy as np

from vvvaltr.controller.core.attending import StartPlace
from vvvaltr.controller.core.errors import DeviceTimeout

_HOST = "127.0.0.1"
_ANSWER_S, _TRIES = 0.5, 3
_MOST_BYTES = 1024
_SHARE = 0.2  # standard deviation of where the robot is put, over the radius of the start circle


class _Wanted(msgspec.Struct, frozen=True):
    """A start place on its way to the mock."""

    number: int
    place: StartPlace


class _Done(msgspec.Struct, frozen=True):
    """What the mock answers."""

    number: int


class MockHand:
    """The mock's end: puts its twin down wherever the controller asks, about as exactly as a person.

    Args:
        put_down: puts the twin down at rest, at x and y in m with a yaw in rad.
    """

    def __init__(self, put_down: Callable[[float, float, float], None]) -> None:
        self._put_down = put_down
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((_HOST, 0))
        self._socket.setblocking(False)
        self._random = np.random.default_rng(0)

    @property
    def port(self) -> int:
        """Where it is asked."""
        return int(self._socket.getsockname()[1])

    def work(self) -> None:
        """Do what has been asked for, if anything."""
        with suppress(BlockingIOError):
            text, sender = self._socket.recvfrom(_MOST_BYTES)
            try:
                wanted = msgspec.json.decode(text, type=_Wanted)
            except (msgspec.DecodeError, ValueError):  # from another program
                return
            self._put_down(*self._near(wanted.place))
            self._socket.sendto(msgspec.json.encode(_Done(wanted.number)), sender)

    def close(self) -> None:
        """Let go of the channel. Idempotent."""
        self._socket.close()

    def _near(self, place: StartPlace) -> tuple[float, float, float]:
        """Return x, y and yaw, each off by a normal error, but never by more than two of its standard deviations."""
        errors = np.clip(self._random.standard_normal(3), -2.0, 2.0) * _SHARE
        x_m, y_m = place.x_m + errors[0] * place.within_m, place.y_m + errors[1] * place.within_m
        return float(x_m), float(y_m), float((place.yaw_rad or 0.0) + errors[2] * min(place.within_rad, 0.5))


class AskedHand:
    """The controller's end: a ``Hand``."""

    def __init__(self, port: int) -> None:
        self._address = (_HOST, port)
        self._numbers = count(time.monotonic_ns() % 2**32)

    def put_back(self, place: StartPlace) -> None:
        """Have the mock put its twin back. Raises DeviceTimeout if it does not answer."""
        wanted = _Wanted(next(self._numbers), place)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
            channel.settimeout(_ANSWER_S)
            for _ in range(_TRIES):
                with suppress(TimeoutError, ConnectionError, msgspec.DecodeError):
                    channel.sendto(msgspec.json.encode(wanted), self._address)
                    answer = msgspec.json.decode(channel.recv(_MOST_BYTES), type=_Done)
                    if answer.number == wanted.number:
                        return
        raise DeviceTimeout(f"the mock's hand on port {self._address[1]} does not answer; start the mock again")
