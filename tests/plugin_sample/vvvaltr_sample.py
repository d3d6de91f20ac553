"""A package of its own that adds a motor device, a tracker and a method."""

import time
from functools import partial

import numpy as np

from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState, Pose
from vvvaltr.drivers.registry import Driver
from vvvaltr.drivers.table import LineTable, TrackerTable
from vvvaltr.drivers.trackers.registry import TrackerKind
from vvvaltr.transfer.bayes.belief import learn_alone
from vvvaltr.transfer.bayes.proposal import Proposal
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.methods.method import Method


class SampleLineTable(LineTable, frozen=True, kw_only=True, tag="sample"):
    """``[[line]] driver = "sample"``: motors in this process, which do at once as they are told."""

    port: str


class SampleLine:
    """The motors on one line: satisfies ``vvvaltr.drivers.motor_line.MotorLine``."""

    quantities = frozenset({Quantity.FREQUENCY})
    period_s = 0.02
    watchdog_s = 0.25

    def __init__(self, table: SampleLineTable) -> None:
        self.name = table.port
        self.motor_count = len(table.motor)
        self._curves = [motor.calibration for motor in table.motor]
        self._told_s = self.heard_s = time.monotonic()
        self.rest()

    def check(self, gait: Gait) -> None:
        self._commands(gait)

    def send(self, gait: Gait) -> None:
        self._told_s, self._applied = time.monotonic(), self._commands(gait)

    repeat = send

    def rest(self) -> None:
        self._applied = (0.0,) * self.motor_count

    def listen(self, until_s: float) -> None:
        time.sleep(max(0.0, until_s - time.monotonic()))
        self.heard_s = time.monotonic()
        if self.heard_s > self._told_s + self.watchdog_s:
            self.rest()

    def state(self) -> MotorState:
        turning = tuple(c.frequency_hz(command) for c, command in zip(self._curves, self._applied, strict=True))
        return MotorState(self.heard_s, turning, measured=False)

    def close(self) -> None:
        self.rest()

    def _commands(self, gait: Gait) -> tuple[float, ...]:
        return tuple(curve.command(hz) for curve, hz in zip(self._curves, gait.frequency_hz, strict=True))


class SampleTrackerTable(TrackerTable, frozen=True, kw_only=True, tag="sample"):
    """``[tracker] kind = "sample"``: a robot on a conveyor belt."""

    speed_m_s: float


class SampleTracker:
    """Knows the belt's speed: satisfies ``vvvaltr.drivers.trackers.registry.PoseTracker``."""

    def __init__(self, table: SampleTrackerTable) -> None:
        self._speed_m_s, self._start_s = table.speed_m_s, time.monotonic()

    def pose(self) -> Pose:
        now_s = time.monotonic()
        return Pose(now_s, (self._speed_m_s * (now_s - self._start_s), 0.0, 0.0))

    def close(self) -> None:
        """Nothing is open."""


def make_search(space, seed, sources):
    """Tries one frequency for all motors: low, middle or high."""

    def propose(trials, belief, rng):
        return Proposal(np.full(space.dimension, rng.choice([0.1, 0.5, 0.9])), "sample")

    return Search(space, seed, partial(learn_alone, space), propose)


DRIVER = Driver(SampleLineTable, SampleLine)
TRACKER = TrackerKind(SampleTrackerTable, SampleTracker)
METHOD = Method("sample", "the same frequency for all motors", uses_sources=False, make=make_search)
