"""Whether each motor turns, how fast and which way: as its sensor measures, or as the tracker sees the robot shake."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from vvvaltr.controller.core.errors import DeviceError, TrackingLost, UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Tracker
from vvvaltr.controller.robot.commissioning.finding import Finding
from vvvaltr.controller.robot.commissioning.vibration import (
    Peak,
    find_peak,
    followed_hz,
    measure_spectrum,
    needed_rate_hz,
    record_poses,
    record_states,
)
from vvvaltr.controller.robot.hardware import JoinedMotors
from vvvaltr.drivers.trackers.registry import PoseTracker

SETTLE_S = 0.6
"""Time after which a motor is near its speed."""

_TEST_SHARE, _TEST_HZ = 0.75, 15.0  # of the greatest frequency, but no faster than any tracker can see
_LOOK_S, _LOOK_POSES = 1.0, 50.0
_LONGER = 4.0  # a second look, for a shaking that is as faint as the poses' noise
_TOLERANCE = 0.15
_REOPENING_S = 2.0


def chosen_hz(max_hz: float) -> float:
    """Return the frequency at which a motor is tested."""
    return min(_TEST_SHARE * max_hz, _TEST_HZ)


@dataclass(frozen=True, slots=True)
class Seeing:
    """A tracker that works, and how many poses it sends a second."""

    tracker: PoseTracker
    rate_hz: float


@dataclass(frozen=True, slots=True)
class RotationTest:
    """Rotates one motor both ways."""

    motors: JoinedMotors
    seeing: Seeing | None
    motor: int
    max_hz: float
    reverses: bool = True

    @property
    def frequency_hz(self) -> float:
        """How fast: what can be seen with some room, where there is no sensor."""
        asked_hz = chosen_hz(self.max_hz)
        if self.seeing is None or self.motors.state().measured:
            return asked_hz
        return min(asked_hz, followed_hz(self.seeing.rate_hz) / (1.0 + _TOLERANCE))

    def findings(self, name: str) -> Iterator[Finding]:
        """Rotate it; yields what that shows."""
        cure = "check its wiring and supply, and run vvvaltr calibrate"
        try:
            if not self.motors.state().measured:
                yield from self._tracked(name, cure)
                return
            asked_hz = self.frequency_hz
            forward_hz, reverse_hz = self._measured_hz(asked_hz), self._measured_hz(-asked_hz)
        except (DeviceError, TrackingLost) as error:
            yield Finding(name, False, str(error), cure)
            with suppress(DeviceError, UserError):
                self.motors.ready(_REOPENING_S)  # the next motor is judged for itself
            return
        detail = f"set to {asked_hz:.1f} Hz, turns at {forward_hz:.1f} Hz"
        passed = _is_near(abs(forward_hz), asked_hz)
        yield Finding(name, passed, detail, "" if passed else cure)
        detail = f"turns at {forward_hz:+.1f} and {reverse_hz:+.1f} Hz"
        passed = forward_hz > 0.0 > reverse_hz
        yield Finding(f"{name} direction", passed, detail, "" if passed else "swap the motor's or its encoder's wires")

    def _tracked(self, name: str, cure: str) -> Iterator[Finding]:
        """Yield what the tracker shows of a motor that has no sensor."""
        if self.seeing is None:
            yield Finding(
                name, False, "it has no sensor, and no working tracker to measure it", "make the tracker work first"
            )
            return
        asked_hz, look_s = self.frequency_hz, max(_LOOK_S, _LOOK_POSES / self.seeing.rate_hz)
        for title, sign in ((name, 1.0), (f"{name} direction", -1.0))[: 2 if self.reverses else 1]:
            peak = self._find_peak(self.seeing.tracker, sign * asked_hz, look_s)
            if not peak.is_clear:  # a motor may stand still now and then
                peak = self._find_peak(self.seeing.tracker, sign * asked_hz, _LONGER * look_s)
            if not peak.is_clear:
                yield _unseen(title, sign * asked_hz, peak.least_m)
                continue
            passed = _is_near(peak.frequency_hz, asked_hz)
            detail = f"set to {sign * asked_hz:.1f} Hz, the robot shakes at {peak.frequency_hz:.1f} Hz"
            if sign < 0.0:
                detail += "; without a sensor the direction is unknown: look at the motor"
            yield Finding(title, passed, detail, "" if passed else cure)
        yield from self._too_fast(f"{name} speed", self.seeing.rate_hz)

    def _find_peak(self, tracker: Tracker, motor_hz: float, look_s: float) -> Peak:
        """Drive the motor and return the strongest vibration around its frequency."""
        poses = record_poses(self.motors, tracker, self._gait(motor_hz), SETTLE_S, look_s)
        return find_peak(measure_spectrum(poses), 0.6 * abs(motor_hz), 1.4 * abs(motor_hz))

    def _too_fast(self, name: str, rate_hz: float) -> Iterator[Finding]:
        """Yield a warning where the tracker cannot follow the motor to its greatest frequency."""
        if self.max_hz <= (limit_hz := followed_hz(rate_hz)):
            return
        yield Finding(
            name,
            True,
            f"{rate_hz:.0f} poses/s show up to {limit_hz:.1f} Hz, and it turns at up to {self.max_hz:.1f} Hz",
            f"let the tracker send {needed_rate_hz(self.max_hz):.0f} poses/s, or calibrate up to {limit_hz:.1f} Hz",
        )

    def _measured_hz(self, frequency_hz: float) -> float:
        states = record_states(self.motors, self._gait(frequency_hz), max(SETTLE_S, self.motors.settle_s), 0.3)
        return sum(state.frequency_hz[self.motor] for state in states) / len(states)

    def _gait(self, motor_hz: float) -> Gait:
        frequency_hz = [0.0] * self.motors.motor_count
        frequency_hz[self.motor] = motor_hz
        return Gait(tuple(frequency_hz))


def _unseen(name: str, asked_hz: float, least_m: float) -> Finding:
    """Return the finding of a motor that stands still, or shakes the robot too faintly to be told from noise."""
    return Finding(
        name,
        False,
        f"set to {asked_hz:.1f} Hz, no shaking is seen; the poses' noise hides up to {1000.0 * least_m:.2g} mm",
        "look at the motor: if it stands still, check its wiring and supply; if it turns, its shaking is too faint for "
        "this tracker: let it send more poses/s, or bring the cameras nearer",
    )


def _is_near(frequency_hz: float, asked_hz: float) -> bool:
    return math.isclose(frequency_hz, asked_hz, rel_tol=_TOLERANCE)
