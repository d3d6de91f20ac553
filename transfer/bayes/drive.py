"""How strongly a gait drives the robot: a trend of the mean, and inputs through a dead zone.

A vibrating robot stands still until a motor's force overcomes friction, and moves the faster, the harder it is shaken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import GaitSpace, Quantity

USUAL_DRIVE, DRIVE_RANGE = 0.4, 3.0
"""The trend is 3 times what the drive exceeds 0.4 by: near 0 on average over gaits, and near 2 at full drive."""


@dataclass(frozen=True, slots=True)
class Drive:
    """The drive of the gaits in a space. Frequencies u are in units of the greatest of them.

    A motor's frequency beyond the dead zone z is e = max(0, |u| - z) / (1 - z), and the drive of a gait is the mean of
    e over the motors whose frequency is searched, each times its amplitude where that is searched too.

    Args:
        low: lowest value (d,) of each parameter, in units of the greatest frequency where it is a frequency.
        span: range (d,) of each parameter, in the same units.
        frequencies: positions (f,) of the frequencies among the parameters; none where a drive has no meaning.
        amplitudes: positions (f,) of the same motors' amplitudes; the frequency's own where it is not searched.
        greatest_hz: the greatest frequency; 0 where none is searched.
    """

    low: Array
    span: Array
    frequencies: NDArray[np.intp]
    amplitudes: NDArray[np.intp]
    greatest_hz: float

    @classmethod
    def of(cls, space: GaitSpace) -> Drive:
        """Return the drive of the gaits in a space."""
        places = {(p.quantity, p.motor): place for place, p in enumerate(space.parameters)}
        searched = [(place, motor) for (quantity, motor), place in places.items() if quantity is Quantity.FREQUENCY]
        low, high = (np.array([getattr(p, end) for p in space.parameters]) for end in ("low", "high"))
        frequencies = np.array([place for place, _ in searched], dtype=np.intp)
        amplitudes = [places.get((Quantity.AMPLITUDE, motor), place) for place, motor in searched]
        greatest_hz = float(np.abs([low[frequencies], high[frequencies]]).max()) if searched else 0.0
        unit = np.ones(space.dimension)
        unit[frequencies] = greatest_hz
        return cls(low / unit, (high - low) / unit, frequencies, np.array(amplitudes, dtype=np.intp), greatest_hz)

    def without_meaning(self) -> Drive:
        """Return the drive of a space in which frequencies are numbers like any other."""
        none = np.empty(0, dtype=np.intp)
        return replace(self, frequencies=none, amplitudes=none)

    @property
    def has_meaning(self) -> bool:
        """Whether a gait's drive can differ from another's."""
        return len(self.frequencies) > 0

    def view(self, x: Array, dead_zones: Array) -> View:
        """Return places (m, d) under each of the dead zones (h,)."""
        zones = dead_zones[:, None, None]
        warped, slope = np.repeat(x[None], len(zones), axis=0), np.ones((len(zones), *x.shape))
        trend, trend_slope = np.zeros(warped.shape[:2]), np.zeros(warped.shape)
        if not self.has_meaning:
            return View(warped, slope, trend, trend_slope)
        at, by, span = self.frequencies, self.amplitudes, self.span
        u = (self.low + span * x)[:, at]
        beyond, size = np.maximum(np.abs(u) - zones, 0.0) / (1.0 - zones), np.sign(u)
        rise = np.where(beyond > 0.0, 1.0 / (1.0 - zones), 0.0)
        warped[:, :, at], slope[:, :, at] = size * beyond / span[at], rise
        fixed, share = by == at, DRIVE_RANGE / len(at)
        amplitude = np.where(fixed, 1.0, (self.low + span * x)[:, by])
        trend += share * (amplitude * beyond).sum(axis=2) - DRIVE_RANGE * USUAL_DRIVE
        trend_slope[:, :, by[~fixed]] = share * beyond[:, :, ~fixed] * span[by[~fixed]]
        trend_slope[:, :, at] = share * amplitude * size * rise * span[at]
        return View(warped, slope, trend, trend_slope)


@dataclass(frozen=True, slots=True)
class View:
    """Places as they look under some dead zones.

    Without a dead zone they are the same places, moved by a constant, so that length scales keep their meaning.

    Args:
        warped: places (h, m, d) without the dead zone.
        slope: derivative (h, m, d) of each number of a warped place with respect to the place's own.
        trend: trend (h, m) of the drive; 0 where a drive has no meaning.
        trend_slope: its gradient (h, m, d).
    """

    warped: Array
    slope: Array
    trend: Array
    trend_slope: Array
