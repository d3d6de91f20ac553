"""Poses as JSON over UDP: what the mock devices send, and what any laboratory's tracker can be made to send.

One datagram holds one pose::

    {"sequence": 17, "t_s": 3.4, "position_m": [0.12, 0.0, 0.03],
     "yaw_rad": 0.1, "pitch_rad": 0.0, "roll_rad": 0.0, "markers_m": [[0.1, 0.0, 0.0], ...]}

``sequence`` counts up; ``t_s`` is when the pose was taken, on any clock that never goes back; ``position_m`` is null
while the tracker does not see the robot. Angles and markers (the strut ends) may be left out.
"""

from __future__ import annotations

import math
import socket
import threading
import time
from dataclasses import replace

import msgspec

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose, Vector
from vvvaltr.drivers.links.remote_clock import RemoteClock

LOOPBACK = "127.0.0.1"
_LONGEST_BYTES = 65536


class _Message(msgspec.Struct):
    sequence: int
    t_s: float
    position_m: Vector | None
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    markers_m: tuple[Vector, ...] = ()


def encode_pose(sequence: int, pose: Pose) -> bytes:
    """Return the datagram for a pose."""
    angles = (pose.yaw_rad, pose.pitch_rad, pose.roll_rad)
    return msgspec.json.encode(_Message(sequence, pose.t_s, pose.position_m, *angles, pose.markers_m))


def encode_lost(sequence: int, t_s: float) -> bytes:
    """Return the datagram that says that the robot is not seen: ends a trial at once."""
    return msgspec.json.encode(_Message(sequence, t_s, None))


def decode_pose(datagram: bytes) -> tuple[int, Pose | None]:
    """Return sequence number and pose (sender's time; None if the robot is not seen) of a datagram.

    Raises:
        ValueError: the datagram is malformed, or holds what is not a number.
    """
    try:
        message = msgspec.json.decode(datagram, type=_Message)
    except (msgspec.DecodeError, RecursionError) as error:
        raise ValueError(f"malformed pose: {error}") from error
    if message.position_m is None:
        return message.sequence, None
    angles = (message.yaw_rad, message.pitch_rad, message.roll_rad)
    pose = Pose(message.t_s, message.position_m, *angles, message.markers_m)
    markers = (value for marker in pose.markers_m for value in marker)
    if not (pose.is_finite and math.isfinite(pose.t_s) and all(map(math.isfinite, markers))):
        raise ValueError("malformed pose: it holds what is not a number")
    return message.sequence, pose


def find_free_port() -> int:
    """Return a UDP port of the loopback address that nobody uses at present."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


class PoseSender:
    """Sends poses to a ``StreamTracker``: satisfies ``PoseFeed``.

    Args:
        host, port: where the tracker listens.
    """

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._sequence = 0

    def send(self, pose: Pose) -> None:
        """Send one pose, or lose it: nobody may be listening yet, or the network may be full."""
        self._send(encode_pose(self._sequence, pose))

    def send_lost(self, t_s: float) -> None:
        """Say that at ``t_s`` the robot was not seen."""
        self._send(encode_lost(self._sequence, t_s))

    def close(self) -> None:
        """Let go of the socket. Idempotent."""
        self._socket.close()

    def _send(self, datagram: bytes) -> None:
        self._sequence += 1
        try:
            self._socket.sendto(datagram, self._address)
        except OSError:
            return


class StreamTracker:
    """A tracker that listens for poses: satisfies ``PoseTracker``.

    Args:
        host: address to listen on; the loopback one lets no other computer in.
        port: UDP port; 0 for any that is free.
        age_limit_s: the greatest age of a pose that is still the robot's.

    Raises:
        ValueError: the address cannot be listened on.
    """

    def __init__(self, host: str = LOOPBACK, port: int = 0, age_limit_s: float = 0.2) -> None:
        self._age_limit_s = age_limit_s
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise ValueError(f"cannot listen for poses on {host}:{port}: {error.strerror}") from error
        self._clock = RemoteClock()
        self._datagram = b""
        self._sequence, self._sent_s, self._heard_s = -1, -math.inf, -math.inf
        # What the newest datagram says, or why it says nothing: one attribute, for two threads share it.
        self._newest: Pose | str = f"no pose has come to {self.address}; is the tracker sending?"
        self._closing = threading.Event()
        # A thread, for a socket that nobody reads keeps the oldest datagrams and throws away the newest.
        self._thread = threading.Thread(target=self._listen, name=f"poses on {self.address}", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """Where it listens, as ``host:port``."""
        host, port = self._socket.getsockname()
        return f"{host}:{port}"

    def pose(self) -> Pose:
        """Return the newest pose. Raises TrackingLost if it is too old, malformed, or the robot was not seen."""
        newest = self._newest
        if isinstance(newest, str):
            raise TrackingLost(newest)
        age_s = time.monotonic() - newest.t_s
        if age_s > self._age_limit_s:
            raise TrackingLost(f"the last pose is {age_s:.2f} s old; the limit is {self._age_limit_s:g} s")
        return newest

    def close(self) -> None:
        """Stop listening. Idempotent."""
        if not self._closing.is_set():
            self._closing.set()
            self._socket.sendto(b"", self._socket.getsockname())  # wakes the thread
            self._thread.join()
            self._socket.close()

    def _listen(self) -> None:
        while not self._closing.is_set():
            self._take(self._socket.recv(_LONGEST_BYTES), time.monotonic())

    def _take(self, datagram: bytes, received_s: float) -> None:
        if datagram == self._datagram:
            return  # of a tracker that hangs and repeats itself: the pose grows old all the same
        self._datagram = datagram
        try:
            sequence, pose = decode_pose(datagram)
        except ValueError as error:
            self._newest = str(error)
            return
        sent_s = self._sent_s if pose is None else pose.t_s
        if sequence <= self._sequence or sent_s < self._sent_s:
            if received_s - self._heard_s < self._age_limit_s:
                return  # repeated, or overtaken on its way
            self._clock = RemoteClock()  # after a silence another sender may begin, at any number and time
        self._sequence, self._sent_s, self._heard_s = sequence, sent_s, received_s
        if pose is None:
            self._newest = "the tracker does not see the robot"
        else:
            self._newest = replace(pose, t_s=self._clock.here_s(pose.t_s, received_s))
