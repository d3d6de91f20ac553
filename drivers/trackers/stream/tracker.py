"""Poses as JSON over UDP: what the mock devices send, and what any laboratory's tracker can be made to send."""

from __future__ import annotations

import logging
import math
import socket
import threading
import time

from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.newest import UNSEEN, NewestPose
from vvvaltr.drivers.trackers.receiving import ReceivingTracker
from vvvaltr.drivers.trackers.stream.message import Axes, Told, decode_pose, encode_lost, encode_pose, explain_key
from vvvaltr.drivers.trackers.stream.origin import OneOrigin, TwoPlaces
from vvvaltr.drivers.trackers.stream.table import StreamTable
from vvvaltr.drivers.trackers.stream.wire import LOOPBACK, Address, PoseSocket

_log = logging.getLogger(__name__)

_MOST_REMARKS = 8


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


class StreamTracker(ReceivingTracker):
    """A tracker that listens for poses: satisfies ``PoseTracker``.

    Args:
        table: where to listen, and how the sender's numbers are meant.

    Raises:
        ValueError: the address cannot be listened on.
    """

    def __init__(self, table: StreamTable) -> None:
        self._table = table
        self._axes = Axes(table.unit, table.up, table.yaw_unit)
        self._socket = PoseSocket(table.host, table.port, table.interface)
        self.address = self._socket.address
        reason, cure = f"no pose has come to {self.address}", "start the tracker and let it send there"
        super().__init__(NewestPose(table.age_limit_s, reason, cure))
        self._origin, self._places = OneOrigin(table.name), TwoPlaces()
        self._datagram, self._sent_s, self._heard_s = b"", -math.inf, -math.inf
        self._keys: set[str] = set()
        self.remarks: tuple[str, ...] = ()
        self._is_closed = False
        # A thread of its own, for a socket that is not read keeps the oldest datagrams and discards the newest.
        self._thread = threading.Thread(target=self._listen, name=f"poses on {self.address}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening. Idempotent."""
        if not self._is_closed:
            self._is_closed = True
            self._socket.end()
            self._thread.join()
            self._socket.close()

    def _listen(self) -> None:
        while (heard := self._socket.receive()) is not None:
            self._take(*heard, time.monotonic())

    def _take(self, datagram: bytes, sender: Address, received_s: float) -> None:
        if datagram == self._datagram:
            return  # a tracker that hangs may repeat itself: the pose ages all the same
        self._datagram = datagram
        try:
            told = decode_pose(datagram, self._axes)
        except ValueError as error:
            self._newest.lose(str(error), "correct what is sent, as docs/trackers.md says")
            return
        self._remark_on(told.keys)
        if not self._origin.is_wanted(told):
            self._overhear(told, received_s)
            return
        self._heard_s = received_s
        conflict = self._origin.conflict(told, sender, received_s)
        if told.pose is not None and not conflict:
            conflict = self._places.conflict(told.pose.position_m)
        if conflict:
            self._newest.lose(*conflict)
        elif told.missing:
            self._newest.miss(f"{told.missing} is NaN or null in what is sent; show the robot to the tracker")
        else:
            self._take_in(told, received_s)

    def _take_in(self, told: Told, received_s: float) -> None:
        sent_s = self._sent_s if told.pose is None else told.pose.t_s
        if self._newest.take(told.sequence, sent_s, told.pose or UNSEEN, received_s):
            self._sent_s = sent_s

    def _overhear(self, told: Told, received_s: float) -> None:
        """Note a pose of another body: the reason where none of the robot comes."""
        if received_s - self._heard_s > self._table.age_limit_s:
            other = f"of {told.name[:40]!r}" if told.name else "without a name"
            self._newest.lose(f"poses come {other}, but none of {self._table.name!r}", "correct tracker.name")

    def _remark_on(self, keys: tuple[str, ...]) -> None:
        """Warn of keys that look like misspelt ones, each once."""
        for key in keys:
            if key in self._keys or len(self._keys) >= _MOST_REMARKS:
                continue
            self._keys.add(key)
            if remark := explain_key(key):
                self.remarks += (remark,)
                _log.warning("%s", remark)
