"""The robot of a mock device: a twin that moves in real time and is shown to a tracker."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from vvvaltr.controller.core.errors import DeviceFault
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.values import Vector
from vvvaltr.drivers.mocking.hand import MockHand
from vvvaltr.drivers.mocking.pose_faults import PoseFaults
from vvvaltr.drivers.trackers.registry import PoseFeed

POSE_RATE_HZ = 50.0
"""How often a mock shows its robot to the tracker, where nothing else is asked."""

_SHORTEST_STEP_S = 0.01  # finer than a tracker resolves; shorter steps would delay the next byte
_LONGEST_STEP_S = 0.05  # a mock that was held up for longer skips the rest


class MovingTwin:
    """Moves a twin at the frequencies that the device applies, and shows its pose to a tracker.

    Args:
        twin: the robot; it is not put back between trials.
        feed: shows its poses to the tracker.
        hand: puts the twin back when it is asked to; None for nobody.
        pose_rate_hz: how often its pose is shown.
    """

    def __init__(
        self, twin: Robot, feed: PoseFeed, hand: MockHand | None = None, pose_rate_hz: float = POSE_RATE_HZ
    ) -> None:
        self._pose_period_s = 1.0 / pose_rate_hz
        self._hand = hand
        self._twin = twin
        self._feed = feed
        self._now_s = -math.inf
        self._next_pose_s = -math.inf
        self.faults = PoseFaults()

    def advance(self, applied_hz: Sequence[float], now_s: float) -> None:
        """Move the robot until ``now_s``, as ``time.monotonic()`` counts, and show its pose when that is due."""
        if now_s - self._now_s < _SHORTEST_STEP_S:
            return
        elapsed_s = min(now_s - self._now_s, _LONGEST_STEP_S)
        self._now_s = now_s
        if self._hand is not None:
            self._hand.work()
        try:
            self._twin.motors.drive(Gait(tuple(applied_hz)), 1.0)
            self._twin.clock.sleep(max(0.0, elapsed_s))
        except DeviceFault:
            self._twin.place(0)  # the physics diverged: place the robot anew
        if now_s >= self._next_pose_s:
            self._next_pose_s = max(self._next_pose_s + self._pose_period_s, now_s)
            if (shown := self.faults.shown(replace(self._twin.tracker.pose(), t_s=now_s))) is None:
                self._feed.send_lost(now_s)
            else:
                self._feed.send(shown)

    @property
    def place_m(self) -> Vector:
        """Where the robot truly is, as its twin's tracker tells: whatever the faults are."""
        return self._twin.tracker.pose().position_m

    def close(self) -> None:
        """Close the twin and the feed."""
        self._twin.close()
        self._feed.close()
        if self._hand is not None:
            self._hand.close()
