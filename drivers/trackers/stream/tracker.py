"""Poses as JSON over UDP: what the mock devices send, and what any laboratory's tracker can be made to send.

One datagram holds one pose::

    {"sequence": 17, "t_s": 3.4, "position_m": [0.12, 0.0, 0.03],
     "yaw_rad": 0.1, "pitch_rad": 0.0, "roll_rad": 0.0, "markers_m": [[0.1, 0.0, 0.0], ...], "uncertainty_m": 0.0002}

``sequence`` counts up; ``t_s`` is when the pose was taken, on any clock that never goes back; ``position_m`` is null
while the tracker does not see the robot. Angles, markers (the strut ends) and the uncertainty of the position may be
left out.
"""

from __future__ import annotations

import math
import socket
import threading
import time

import msgspec

from vvvaltr.controller.core.values import Pose, Vector
from vvvaltr.drivers.links.remote_clock import RemoteClock
from vvvaltr.drivers.trackers.newest import UNSEEN, NewestPose

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
    uncertainty_m: float | None = None


def encode_pose(sequence: int, pose: Pose) -> bytes:
    """Return the datagram for a pose."""
    angles = (pose.yaw_rad, pose.pitch_rad, pose.roll_rad)
    return msgspec.json.encode(
        _Message(sequence, pose.t_s, pose.position_m, *angles, pose.markers_m, pose.uncertainty_m)
    )


def encode_lost(sequence: int, t_s: float) -> bytes:
    """Return the datagram that says that the robot is not seen: ends a trial at once."""
    return msgspec.json.encode(_Message(sequence, t_s, None))


def decode_pose(datagram: bytes) -> tuple[int, Pose | None]:
    """Return sequence number and pose (sender's time; None if the robot is not seen) of a datagram.

    Raises:
        ValueError: the datagram is malformed, or a value is not finite.
    """
    try:
        message = msgspec.json.decode(datagram, type=_Message)
    except (msgspec.DecodeError, RecursionError) as error:
        raise ValueError(f"malformed pose: {error}") from error
    if message.position_m is None:
        return message.sequence, None
    angles = (message.yaw_rad, message.pitch_rad, message.roll_rad)
    pose = Pose(message.t_s, message.position_m, *angles, message.markers_m, uncertainty_m=message.uncertainty_m)
    more = (pose.t_s, pose.uncertainty_m or 0.0, *(value for marker in pose.markers_m for value in marker))
    if not (pose.is_finite and all(map(math.isfinite, more))):
        raise ValueError("malformed pose: a value is not a finite number")
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
        """Send one pose. It is lost where no tracker listens yet or the network is full."""
        self._send(encode_pose(self._sequence, pose))

    def send_lost(self, t_s: float) -> None:
        """Report that the robot was not in view at ``t_s``."""
        self._send(encode_lost(self._sequence, t_s))

    def close(self) -> None:
        """Close the socket. Idempotent."""
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
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise ValueError(
                f"cannot listen for poses on {host}:{port}: {error.strerror}; choose another tracker.port"
            ) from error
        reason = f"no pose has come to {self.address}; start the tracker and let it send there"
        self._newest = NewestPose(age_limit_s, reason)
        self._datagram, self._sent_s = b"", -math.inf
        self._closing = threading.Event()
        # A thread of its own, for a socket that is not read keeps the oldest datagrams and discards the newest.
        self._thread = threading.Thread(target=self._listen, name=f"poses on {self.address}", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """Address of the tracker, as ``host:port``."""
        host, port = self._socket.getsockname()
        return f"{host}:{port}"

    @property
    def clock(self) -> RemoteClock:
        """The sender's clock."""
        return self._newest.clock

    def pose(self) -> Pose:
        """Return the newest pose. Raises TrackingLost if it is too old, malformed, or the robot was not seen."""
        return self._newest.pose()

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
            return  # a tracker that hangs may repeat itself: the pose ages all the same
        self._datagram = datagram
        try:
            sequence, pose = decode_pose(datagram)
        except ValueError as error:
            self._newest.lose(str(error))
            return
        sent_s = self._sent_s if pose is None else pose.t_s
        if self._newest.take(sequence, sent_s, pose or UNSEEN, received_s):
            self._sent_s = sent_s
