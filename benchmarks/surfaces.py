"""Functions with known optima over the unit cube, for a search to climb."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array

HEIGHTS = np.array([1.0, 1.2, 3.0, 3.2])
WIDTHS_3 = np.array([[3, 10, 30], [0.1, 10, 35], [3, 10, 30], [0.1, 10, 35]])
PEAKS_3 = 1e-4 * np.array([[3689, 1170, 2673], [4699, 4387, 7470], [1091, 8732, 5547], [381, 5743, 8828]])
WIDTHS_6 = np.array(
    [[10, 3, 17, 3.5, 1.7, 8], [0.05, 10, 17, 0.1, 8, 14], [3, 3.5, 1.7, 10, 17, 8], [17, 8, 0.05, 10, 0.1, 14]]
)
PEAKS_6 = 1e-4 * np.array(
    [
        [1312, 1696, 5569, 124, 8283, 5886],
        [2329, 4135, 8307, 3736, 1004, 9991],
        [2348, 1451, 3522, 2883, 3047, 6650],
        [4047, 8828, 8732, 5743, 1091, 381],
    ]
)


@dataclass(frozen=True, slots=True)
class Surface:
    """A function to maximise.

    Args:
        dimension: dimension d of the unit cube.
        best: greatest value.
        true: returns the values (m,) at places (m, d).
        noise_sd: returns the standard deviation of an observation from its true value.
    """

    dimension: int
    best: float
    true: Callable[[Array], Array]
    noise_sd: Callable[[float], float]

    def observed(self, x: Array, rng: np.random.Generator) -> float:
        """Return a noisy observation at a place (d,)."""
        value = float(self.true(x[None, :])[0])
        return value + self.noise_sd(value) * float(rng.normal())


def hartmann3() -> Surface:
    """Return the Hartmann function of three variables (negated, to be maximised) with noise of 0.1."""
    return Surface(3, 3.86278, lambda x: _hartmann(x, WIDTHS_3, PEAKS_3), lambda _: 0.1)


def hartmann6() -> Surface:
    """Return the Hartmann function of six variables (negated, to be maximised) with noise of 0.1."""
    return Surface(6, 3.32237, lambda x: _hartmann(x, WIDTHS_6, PEAKS_6), lambda _: 0.1)


def gait3(seed: int) -> Surface:
    """Return a speed in m/s over three motors, like a vibrating robot's: rugged, often zero, and noisy.

    It has twelve bumps of random place, size and width, and no motion where the motors are too slow to overcome
    friction. Repeats of a gait scatter with a standard deviation of 40 % of its speed plus 2 mm/s.
    """
    rng = np.random.default_rng(seed)
    peaks, heights, widths = rng.random((12, 3)), rng.uniform(0.2, 1.0, 12), rng.uniform(0.12, 0.3, 12)

    def true(x: Array) -> Array:
        squares = ((x[:, None, :] - peaks) ** 2).sum(axis=2)
        bumps = (heights * np.exp(-0.5 * squares / widths**2)).max(axis=1)
        moving = 1.0 / (1.0 + np.exp(-20.0 * (np.abs(2.0 * x - 1.0).sum(axis=1) - 0.9)))
        return np.asarray(0.1 * bumps * moving)

    grid = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 61)] * 3), axis=-1).reshape(-1, 3)
    return Surface(3, float(true(grid).max()), true, lambda value: 0.4 * value + 0.002)


def _hartmann(x: Array, widths: Array, peaks: Array) -> Array:
    squares = (widths * (x[:, None, :] - peaks) ** 2).sum(axis=2)
    return np.asarray(np.exp(-squares) @ HEIGHTS)
