"""How strongly a gait drives the robot: a trend of the mean, beyond a dead zone.

A vibrating robot stands still until a motor's force overcomes friction, and moves the faster, the harder it is shaken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import GaitSpace, Quantity
from vvvaltr.transfer.bayes.acquisition import draw_uniformly
from vvvaltr.transfer.causes.beating import SCATTER, Flags, beat, move_apart

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
        amplitudes: positions (f,) of the same motors' amplitudes, the frequency's own where it is not searched; where
            none is, the very array ``frequencies``.
        greatest_hz: the greatest frequency; 0 where none is searched.
        is_phased: whether phases are searched too. They then decide what gaits do whose motors turn alike, not chance.
    """

    low: Array
    span: Array
    frequencies: NDArray[np.intp]
    amplitudes: NDArray[np.intp]
    greatest_hz: float
    is_phased: bool

    @classmethod
    def of(cls, space: GaitSpace) -> Drive:
        """Return the drive of the gaits in a space."""
        places = {(p.quantity, p.motor): place for place, p in enumerate(space.parameters)}
        searched = [(place, motor) for (quantity, motor), place in places.items() if quantity is Quantity.FREQUENCY]
        low, high = (np.array([getattr(p, end) for p in space.parameters]) for end in ("low", "high"))
        frequencies = np.array([place for place, _ in searched], dtype=np.intp)
        own = [places.get((Quantity.AMPLITUDE, motor), place) for place, motor in searched]
        amplitudes = np.array(own, dtype=np.intp)
        if np.array_equal(amplitudes, frequencies):
            amplitudes = frequencies
        greatest_hz = float(np.abs([low[frequencies], high[frequencies]]).max()) if searched else 0.0
        unit = np.ones(space.dimension)
        unit[frequencies] = greatest_hz
        is_phased = any(quantity is Quantity.PHASE for quantity, _ in places)
        return cls(low / unit, (high - low) / unit, frequencies, amplitudes, greatest_hz, is_phased)

    def without_meaning(self) -> Drive:
        """Return the drive of a space in which frequencies are numbers like any other."""
        none = np.empty(0, dtype=np.intp)
        return replace(self, frequencies=none, amplitudes=none)

    @property
    def has_meaning(self) -> bool:
        """Whether a gait's drive can differ from another's."""
        return len(self.frequencies) > 0

    @property
    def rest(self) -> Array:
        """The place (d,) at which all motors are off, outside of the unit cube where a frequency cannot be 0."""
        place = np.full(len(self.low), 0.5)
        place[self.frequencies] = -self.low[self.frequencies] / self.span[self.frequencies]
        return place

    @property
    def can_beat(self) -> bool:
        """Whether motors can turn so much alike that chance decides what a gait does; see ``beating``."""
        return len(self.frequencies) > 1 and not self.is_phased

    def noise(self, x: Array, scatter: float = SCATTER) -> Array:
        """Return the noise variance (m,) of trials at places (m, d), in units of that of gaits that do not beat."""
        return np.where(self.beats(x), scatter, 1.0)

    def beats(self, x: Array) -> Flags:
        """Return for each of the places (m, d) whether its motors beat, (m,)."""
        return beat(self._speeds(x)) if self.can_beat else np.zeros(len(x), dtype=np.bool_)

    def draw(self, count: int, dimension: int, rng: np.random.Generator) -> Array:
        """Return random places (count, d) of the unit cube to seek the best one among.

        The best gait is often in a corner or on an edge, which random places inside do not reach. So two fifths are on
        the cube's boundary, and of half of these the motors are moved apart where they would beat.
        """
        if not self.has_meaning:
            return draw_uniformly(count, dimension, rng)
        on_bounds, apart = np.array_split(places_on_bounds(2 * count // 5, dimension, rng), 2)
        inside = draw_uniformly(count - 2 * count // 5, dimension, rng)
        return np.concatenate([inside, on_bounds, self.move_apart(apart, rng)])

    def move_apart(self, x: Array, rng: np.random.Generator) -> Array:
        """Return places (m, d) like the given ones whose motors do not beat."""
        if not self.can_beat:
            return x
        apart, at = x.copy(), self.frequencies
        u = move_apart(self._speeds(x), rng)
        apart[:, at] = np.clip((u - self.low[at]) / self.span[at], 0.0, 1.0)
        return apart

    def trend(self, x: Array, dead_zones: Array) -> Array:
        """Return the trend (h, m) at places (m, d) under each of the dead zones (h,); 0 where it has no meaning."""
        if not self.has_meaning:
            return np.zeros((len(dead_zones), len(x)))
        return self._trend(x, self._beyond(self._speeds(x), dead_zones))

    def trend_and_slopes(self, x: Array, dead_zones: Array) -> tuple[Array, Array]:
        """Return the trend (h, m) and its gradient (h, m, d) at places (m, d) under each of the dead zones (h,)."""
        slopes = np.zeros((len(dead_zones), *x.shape))
        if not self.has_meaning:
            return self.trend(x, dead_zones), slopes
        at, by, share = self.frequencies, self.amplitudes, DRIVE_RANGE / len(self.frequencies)
        u = self._speeds(x)
        beyond = self._beyond(u, dead_zones)
        rise = (beyond > 0.0) / (1.0 - dead_zones[:, None, None])
        free = by != at
        slopes[:, :, by[free]] = share * beyond[:, :, free] * self.span[by[free]]
        slopes[:, :, at] = share * self._amplitude(x) * np.sign(u) * rise * self.span[at]
        return self._trend(x, beyond), slopes

    def _trend(self, x: Array, beyond: Array) -> Array:
        """Return the trend (h, m) at places (m, d), from the frequencies (h, m, f) beyond each dead zone."""
        effect = self._amplitude(x) * beyond
        return np.asarray(DRIVE_RANGE / len(self.frequencies) * effect.sum(axis=2) - DRIVE_RANGE * USUAL_DRIVE)

    @staticmethod
    def _beyond(u: Array, dead_zones: Array) -> Array:
        """Return what of the frequencies u (m, f) is beyond each dead zone, e (h, m, f)."""
        zones = dead_zones[:, None, None]
        return np.asarray(np.maximum(np.abs(u) - zones, 0.0) / (1.0 - zones))

    def _speeds(self, x: Array) -> Array:
        """Return the frequencies u (m, f)."""
        return np.asarray(self.low[self.frequencies] + self.span[self.frequencies] * x[:, self.frequencies])

    def _amplitude(self, x: Array) -> Array | float:
        """Return the amplitude (m, f) of each motor whose frequency is searched; 1 where it is not searched."""
        if self.amplitudes is self.frequencies:
            return 1.0
        by = self.amplitudes
        return np.where(by == self.frequencies, 1.0, self.low[by] + self.span[by] * x[:, by])


def places_on_bounds(count: int, dimension: int, rng: np.random.Generator) -> Array:
    """Return random places (count, d) on the unit cube's boundary: a third on faces, a third on edges, then corners.

    So many parameters are at a bound, drawn at random: one on a face, all but one on an edge, all in a corner.
    """
    x, free = rng.random((count, dimension)), np.resize([dimension - 1, 1, 0], count)
    at_bound = rng.random((count, dimension)).argsort(axis=1).argsort(axis=1) >= free[:, None]
    return np.where(at_bound, np.round(x), x)
