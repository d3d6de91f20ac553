"""How fast a motor turns, measured by the tracker: the robot shakes at the motor's frequency."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from vvvaltr.controller.core.errors import DeviceError, DeviceTimeout, TrackingLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Tracker
from vvvaltr.controller.core.values import MotorState, Pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from vvvaltr.controller.robot.hardware import JoinedMotors

T = TypeVar("T")

_LOOK_PERIOD_S, _DRIVE_PERIOD_S, _HOLD_S = 0.005, 0.04, 0.25
_ATTEMPTS, _HELD_UP_S = 3, 0.1
_REOPENING_S = 10.0  # time for a line to open again after this computer was held up
_GAP = 3.5  # of the usual time between two poses: what is longer spoils the spectrum
_LEAST_HZ = 1.0  # slower movement is the robot's walk
_LEAST_NOISE = 1e-9  # in m or rad, from pose to pose: what is less is rounding, and no movement
_BINS = 8192
_SHARE_OF_NYQUIST = 0.96
_CHANCE = 1e-3  # that noise alone is clear, for each line of a spectrum
_SURE_SHARE = 0.9  # of half the pose rate: up to there no motor is mistaken for a slower one


def followed_hz(rate_hz: float) -> float:
    """Return the fastest vibration that poses at ``rate_hz`` show for what it is."""
    return _SURE_SHARE * rate_hz / 2.0


def needed_rate_hz(frequency_hz: float) -> float:
    """Return the pose rate, a whole number, that it takes to follow a vibration."""
    return float(math.ceil(2.0 * frequency_hz / _SURE_SHARE))


@dataclass(frozen=True, slots=True)
class Spectrum:
    """The spectrum of a robot's movement.

    Args:
        frequency_hz: (frequencies,) of the lines of the spectrum.
        amplitude: (frequencies, coordinates), complex, in units of each coordinate's noise.
        freedom: how many coordinates scatter independently of each other, 1 or more.
        per_m: ``amplitude`` of a vibration of 1 m along the axis that scatters most; infinite where none does.
    """

    frequency_hz: NDArray[np.float64]
    amplitude: NDArray[np.complex128]
    freedom: float
    per_m: float

    @property
    def limit_hz(self) -> float:
        """The fastest vibration that the tracker can follow."""
        return float(_SHARE_OF_NYQUIST * self.frequency_hz[-1])


@dataclass(frozen=True, slots=True)
class Peak:
    """The strongest vibration.

    Args:
        frequency_hz: how fast.
        clarity: its amplitude over the spectrum's median.
        shape: (coordinates,) how the robot moves with it, complex, of length 1.
        least_clarity: what noise alone hardly reaches: 3.2 in one coordinate, 2.0 in three, 1.7 in six.
        least_m: the amplitude of a vibration along an axis that has that clarity.
    """

    frequency_hz: float
    clarity: float
    shape: NDArray[np.complex128]
    least_clarity: float
    least_m: float

    @property
    def is_clear(self) -> bool:
        """Whether it is more than noise."""
        return self.clarity > self.least_clarity


def record_poses(motors: JoinedMotors, tracker: Tracker, gait: Gait, settle_s: float, duration_s: float) -> list[Pose]:
    """Drive ``gait`` and return the poses of ``duration_s``, from ``settle_s`` after its ramp on; then stop the motors.

    A recording during which this computer was held up, or the poses had a gap, is discarded and repeated.

    Raises:
        DeviceError: a device failed, or the computer is held up again and again.
        TrackingLost: the tracker lost the robot, or its poses have gaps again and again.
    """
    gap_s = 0.0
    for _ in range(_ATTEMPTS):
        seen = _record(motors, gait, settle_s, duration_s, tracker.pose)
        poses = [pose for number, pose in enumerate(seen) if number == 0 or pose != seen[number - 1]]
        apart_s = np.diff([pose.t_s for pose in poses])
        gap_s = max(apart_s, default=0.0)
        if len(poses) < 2 or gap_s < _GAP * np.median(apart_s):
            return poses
    raise TrackingLost(f"the poses have gaps of {gap_s:.2f} s, too long for a spectrum; check the tracker's network")


def record_states(motors: JoinedMotors, gait: Gait, settle_s: float, duration_s: float) -> list[MotorState]:
    """Drive ``gait`` and return the motors' states of ``duration_s``; see ``record_poses``."""
    return _record(motors, gait, settle_s, duration_s, motors.state)


def _record(motors: JoinedMotors, gait: Gait, settle_s: float, duration_s: float, look: Callable[[], T]) -> list[T]:
    """Return what ``look`` returned over a time in which this computer was not held up."""
    pace = _Pace()
    for _ in range(_ATTEMPTS):
        pace = _Pace()
        try:
            seen = _drive(motors, gait, settle_s, duration_s, look, pace)
        except (DeviceError, TrackingLost):
            if not pace.was_held_up:
                raise
            motors.ready(_REOPENING_S)
        else:
            if not pace.was_held_up:
                return seen
    raise DeviceTimeout(f"this computer was held up for {pace.longest_s:.2f} s, again and again; end other programs")


@dataclass(slots=True)
class _Pace:
    """The longest time between two passes of the program's own loop."""

    last_s: float = math.inf
    longest_s: float = 0.0

    def note_pass(self) -> float:
        """Note a pass of the loop and return its time."""
        now_s = time.monotonic()
        self.longest_s = max(self.longest_s, now_s - self.last_s)
        self.last_s = now_s
        return now_s

    @property
    def was_held_up(self) -> bool:
        """Whether set-points may have expired meanwhile."""
        return self.longest_s > _HELD_UP_S


def _drive(
    motors: JoinedMotors, gait: Gait, settle_s: float, duration_s: float, look: Callable[[], T], pace: _Pace
) -> list[T]:
    """Drive ``gait``, and look often once it has been reached and has settled."""
    seen = []
    next_drive_s = pace.note_pass()
    look_s = next_drive_s + motors.ramp_s(gait) + settle_s
    try:
        while (now_s := pace.note_pass()) < look_s + duration_s:
            if now_s >= next_drive_s:
                motors.drive(gait, _HOLD_S)
                motors.state()
                next_drive_s += _DRIVE_PERIOD_S
            if now_s >= look_s:
                seen.append(look())
            time.sleep(_LOOK_PERIOD_S)
    finally:
        pace.note_pass()
        motors.stop()
    return seen


def measure_spectrum(poses: list[Pose]) -> Spectrum:
    """Return the spectrum of the movement in ``poses``. Raises TrackingLost for too few of them."""
    if len(poses) < 20:
        raise TrackingLost(f"only {len(poses)} poses came, too few for a spectrum; let the tracker send faster")
    t_s = np.array([pose.t_s for pose in poses])
    grid_s = np.linspace(t_s[0], t_s[-1], len(t_s))
    has_markers = len({len(pose.markers_m) for pose in poses}) == 1  # not if one was hidden for a while
    seen = np.array([_coordinates(pose, has_markers) for pose in poses])
    even = np.stack([np.interp(grid_s, t_s, column) for column in seen.T], axis=1)
    still = even - np.polynomial.polynomial.polyval(grid_s, np.polynomial.polynomial.polyfit(grid_s, even, 1)).T
    noise = np.std(np.diff(still, axis=0), axis=0)
    gain = np.where(noise > _LEAST_NOISE, 1.0 / np.maximum(noise, _LEAST_NOISE), 0.0)
    scaled = still * gain
    rate_hz = (len(t_s) - 1) / (t_s[-1] - t_s[0])
    window = np.hanning(len(t_s))
    amplitude = np.fft.rfft(scaled * window[:, None], _BINS, axis=0)
    axis_gains = [math.hypot(gain[axis], *gain[6 + axis :: 3]) for axis in range(3)]  # the markers move along
    per_m = 0.5 * float(window.sum()) * min((each for each in axis_gains if each), default=math.inf)
    return Spectrum(np.fft.rfftfreq(_BINS, 1.0 / rate_hz), amplitude, _freedom(scaled), per_m)


def _freedom(scaled: NDArray[np.floating[Any]]) -> float:
    """Return the number of independent coordinates: that of all that scatter, over the mean square of correlation.

    Markers move with the body, so a tracker that tells ten of them does not see 36 coordinates.
    """
    steps = np.diff(scaled, axis=0)
    steps = steps[:, steps.std(axis=0) > 0.0]
    if steps.shape[1] < 2:
        return 1.0
    return float(steps.shape[1] ** 2 / np.sum(np.corrcoef(steps, rowvar=False) ** 2))


def find_peak(seen: Spectrum, low_hz: float, high_hz: float, like: Peak | None = None) -> Peak:
    """Return the strongest vibration between two frequencies; with ``like``, of its shape, which finds weaker ones.

    The power of noise in n independent coordinates is distributed as chi squared with 2 n degrees of freedom.
    """
    from scipy.special import gammaincinv

    power = np.sum(np.abs(seen.amplitude) ** 2, axis=1)
    if like is not None:
        power = np.abs(seen.amplitude @ like.shape.conj()) ** 2
    high_hz = min(high_hz, seen.limit_hz)
    walk = seen.frequency_hz < _LEAST_HZ
    within = (seen.frequency_hz >= max(low_hz, _LEAST_HZ)) & (seen.frequency_hz <= high_hz)
    line = int(np.argmax(np.where(within, power, -1.0)))
    shape = seen.amplitude[line] / (np.linalg.norm(seen.amplitude[line]) + 1e-300)
    usual = float(np.median(power[~walk]))
    clarity = math.sqrt(power[line] / usual) if usual > 0.0 else 0.0
    freedom = seen.freedom if like is None else 1.0
    least = math.sqrt(gammaincinv(freedom, 1.0 - _CHANCE) / gammaincinv(freedom, 0.5))
    least_m = least * math.sqrt(usual) / seen.per_m
    return Peak(float(seen.frequency_hz[line]), clarity, shape, least, least_m)


def _coordinates(pose: Pose, has_markers: bool) -> list[float]:
    angles = [pose.yaw_rad, pose.pitch_rad, pose.roll_rad]
    markers = pose.markers_m if has_markers else ()
    return [*pose.position_m, *angles, *(value for marker in markers for value in marker)]
