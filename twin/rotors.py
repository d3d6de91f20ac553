"""The motors in motion: their actual frequencies, their angles, and the forces that result."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.twin.body import Motor

REACHED_WITHIN_HZ = 1e-6  # within this of its command, a motor counts as having reached it


class Rotors:
    """Motors that start at rest and follow their commands, each with its own lag and within its own limit.

    Args:
        motors: the motors.
        time_step_s: time step of the integration.
    """

    def __init__(self, motors: Sequence[Motor], time_step_s: float) -> None:
        self._laws = [motor.law for motor in motors]
        self._same_law = len(set(self._laws)) == 1
        self._max_hz = np.array([motor.max_hz for motor in motors])
        down_s = [motor.spin_up_s if motor.spin_down_s is None else motor.spin_down_s for motor in motors]
        self._up_steps = self._lag_steps = np.array([motor.spin_up_s for motor in motors]) / time_step_s
        self._down_steps = np.array(down_s) / time_step_s
        self._step_rad = 2.0 * math.pi * time_step_s
        self._angle_rad = np.zeros(len(motors))
        self.applied_hz = np.zeros(len(motors))
        self._gait: Gait | None = None
        self._is_steady = False

    def spin(self, gait: Gait, steps: int) -> tuple[Array, NDArray[np.complex128]]:
        """Follow ``gait`` for ``steps`` time steps, at least one; return frequencies and forces, both (steps, motors).

        Frequencies are in Hz. A force is x + iy in newtons in the frame of its strut: F (sin a + i cos a) at the angle
        a, which is the integral of the frequency plus the gait's phase.
        """
        if gait is not self._gait:  # most calls continue with the gait of the last
            self._take(gait)
        step = np.arange(1, steps + 1)[:, None]
        if self._is_steady:
            hz, turned, forces_n = self._target_hz[None].repeat(steps, axis=0), step * self._target_hz, self._steady_n
        else:
            hz = self._target_hz - (self._target_hz - self.applied_hz) * np.exp(-step / self._lag_steps)
            turned, forces_n = np.cumsum(hz, axis=0), self._forces_n(hz)
        angle_rad = self._angle_rad + self._step_rad * turned
        self.applied_hz, self._angle_rad = hz[-1], angle_rad[-1]
        self._is_steady = self._is_steady or self._has_reached()
        return hz, forces_n * np.exp(-1j * (angle_rad + self._phase_rad))

    def _take(self, gait: Gait) -> None:
        self._gait = gait
        self._target_hz = np.minimum(np.maximum(gait.frequency_hz, -self._max_hz), self._max_hz)
        is_faster = np.abs(self._target_hz) >= np.abs(self.applied_hz)
        self._lag_steps = np.where(is_faster, self._up_steps, self._down_steps)
        self._amplitude, self._phase_rad = np.array(gait.amplitude), np.array(gait.phase_rad)
        self._steady_n = self._forces_n(self._target_hz)
        self._is_steady = self._has_reached()

    def _has_reached(self) -> bool:
        return bool(np.abs(self._target_hz - self.applied_hz).max() < REACHED_WITHIN_HZ)

    def _forces_n(self, hz: Array) -> NDArray[np.complex128]:
        """Return the forces at the angle 0, for frequencies of shape (..., motors)."""
        return np.asarray(self._sizes_n(hz) * self._amplitude * 1j)

    def _sizes_n(self, hz: Array) -> Array:
        """Return the sizes of the forces, for frequencies of shape (..., motors)."""
        if self._same_law:
            return np.asarray(self._laws[0].at(hz))
        return np.array([law.at(of_motor) for law, of_motor in zip(self._laws, hz.T, strict=True)]).T
