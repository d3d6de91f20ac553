"""How fast a motor really turns, as the tracker sees it: the robot shakes at the motor's frequency."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from controller.interface import MotorDriver, Tracker, TrackingLost
from controller.types import Gait, MotorState, Pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

_LOOK_PERIOD_S, _DRIVE_PERIOD_S, _HOLD_S = 0.005, 0.04, 0.25
_LEAST_HZ = 1.0  # slower movement is the robot's walk
_BINS = 8192
_SHARE_OF_NYQUIST = 0.96


@dataclass(frozen=True, slots=True)
class Shaking:
    """The spectrum of a robot's movement.

    Args:
        frequency_hz: (frequencies,) of the lines of the spectrum.
        amplitude: (frequencies, coordinates), complex, in units of each coordinate's noise.
    """

    frequency_hz: NDArray[np.float64]
    amplitude: NDArray[np.complex128]

    @property
    def limit_hz(self) -> float:
        """The fastest vibration that the tracker can follow."""
        return float(_SHARE_OF_NYQUIST * self.frequency_hz[-1])


@dataclass(frozen=True, slots=True)
class Peak:
    """The strongest vibration.

    Args:
        frequency_hz: how fast.
        clarity: its amplitude over the spectrum's median; noise alone reaches 1.3, of one shape 3.
        shape: (coordinates,) how the robot moves with it, complex, of length 1.
    """

    frequency_hz: float
    clarity: float
    shape: NDArray[np.complex128]


def watch(motors: MotorDriver, tracker: Tracker, gait: Gait, settle_s: float, duration_s: float) -> list[Pose]:
    """Drive ``gait`` and return the poses of ``duration_s``, after ``settle_s``. The motors are stopped after it.

    Raises:
        DeviceError: a device failed.
        TrackingLost: the tracker lost the robot.
    """
    poses: list[Pose] = []

    def look() -> None:
        if (pose := tracker.pose()) not in poses[-1:]:
            poses.append(pose)

    _drive(motors, gait, settle_s, duration_s, look)
    return poses


def applied(motors: MotorDriver, gait: Gait, settle_s: float, duration_s: float) -> list[MotorState]:
    """Drive ``gait`` and return what the motors did for ``duration_s``, after ``settle_s``. Else as ``watch``."""
    states: list[MotorState] = []
    _drive(motors, gait, settle_s, duration_s, lambda: states.append(motors.state()))
    return states


def _drive(motors: MotorDriver, gait: Gait, settle_s: float, duration_s: float, look: Callable[[], None]) -> None:
    """Drive ``gait``, and look often once it has settled."""
    begin_s = next_drive_s = time.monotonic()
    try:
        while (now_s := time.monotonic()) < begin_s + settle_s + duration_s:
            if now_s >= next_drive_s:
                motors.drive(gait, _HOLD_S)
                motors.state()
                next_drive_s += _DRIVE_PERIOD_S
            if now_s >= begin_s + settle_s:
                look()
            time.sleep(_LOOK_PERIOD_S)
    finally:
        motors.stop()


def shaking(poses: list[Pose]) -> Shaking:
    """Return the spectrum of the movement in ``poses``. Raises TrackingLost for too few of them."""
    if len(poses) < 20:
        raise TrackingLost(f"only {len(poses)} poses came, too few to see a vibration in")
    t_s = np.array([pose.t_s for pose in poses])
    grid_s = np.linspace(t_s[0], t_s[-1], len(t_s))
    seen = np.array([_coordinates(pose) for pose in poses])
    even = np.stack([np.interp(grid_s, t_s, column) for column in seen.T], axis=1)
    still = even - np.polynomial.polynomial.polyval(grid_s, np.polynomial.polynomial.polyfit(grid_s, even, 1)).T
    scaled = still / (np.std(np.diff(still, axis=0), axis=0) + 1e-12)
    rate_hz = (len(t_s) - 1) / (t_s[-1] - t_s[0])
    amplitude = np.fft.rfft(scaled * np.hanning(len(t_s))[:, None], _BINS, axis=0)
    return Shaking(np.fft.rfftfreq(_BINS, 1.0 / rate_hz), amplitude)


def strongest(seen: Shaking, low_hz: float, high_hz: float, like: Peak | None = None) -> Peak:
    """Return the strongest vibration between two frequencies; of the shape of ``like``, which finds weaker ones."""
    power = np.sum(np.abs(seen.amplitude) ** 2, axis=1)
    if like is not None:
        power = np.abs(seen.amplitude @ like.shape.conj()) ** 2
    high_hz = min(high_hz, seen.limit_hz)
    walk = seen.frequency_hz < _LEAST_HZ
    within = (seen.frequency_hz >= max(low_hz, _LEAST_HZ)) & (seen.frequency_hz <= high_hz)
    line = int(np.argmax(np.where(within, power, -1.0)))
    shape = seen.amplitude[line] / (np.linalg.norm(seen.amplitude[line]) + 1e-300)
    return Peak(float(seen.frequency_hz[line]), math.sqrt(power[line] / np.median(power[~walk])), shape)


def _coordinates(pose: Pose) -> list[float]:
    angles = [pose.yaw_rad, pose.pitch_rad, pose.roll_rad]
    return [*pose.position_m, *angles, *(value for marker in pose.markers_m for value in marker)]
