"""What a run has learned, as maps: the speed that its model expects over the frequencies of two motors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Estimate, Gait, GaitSpace, Parameter, Quantity

if TYPE_CHECKING:
    import rerun as rr

Pair = tuple[Parameter, Parameter]  # the searched frequencies of two motors

_POINTS = 25  # along each side of a map
# Bounds of a map's view, in points of the map: the picture, ticks on two sides, the colour scale on the right.
MAP_X = (-8.0, _POINTS + 9.0)
MAP_Y = (-5.0, _POINTS + 8.0)
_BEST = (255, 60, 60)
# The colour map viridis at nine places, from dark to bright.
_VIRIDIS = np.array(
    [
        (68, 1, 84),
        (71, 44, 122),
        (59, 81, 139),
        (44, 113, 142),
        (33, 144, 141),
        (39, 173, 129),
        (92, 200, 99),
        (170, 220, 50),
        (253, 231, 37),
    ]
)


@dataclass(frozen=True, slots=True)
class Learned:
    """What a run has learned.

    Args:
        space: gaits that were searched.
        predict: returns the estimated mean speed of each gait, in m/s.
    """

    space: GaitSpace
    predict: Callable[[Sequence[Gait]], tuple[Estimate, ...]]

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """All pairs of searched frequencies, each the axes of a map."""
        return tuple(combinations((p for p in self.space.parameters if p.quantity is Quantity.FREQUENCY), 2))


def map_path(pair: Pair) -> str:
    """Return the path of the Rerun entity of a pair's map."""
    return f"learned/motors_{pair[0].motor + 1}_{pair[1].motor + 1}"


def send_maps(recording: rr.RecordingStream, learned: Learned, trials: Sequence[LoggedTrial]) -> None:
    """Send the map of each pair of motors; all other parameters are those of the last recommended gait."""
    recommended = [logged.recommendation for logged in trials if logged.recommendation is not None]
    if not recommended:
        return
    held = recommended[-1].gait
    speeds = {pair: _speeds_mm_s(learned, pair, held) for pair in learned.pairs}
    low, high = min(map(np.min, speeds.values()), default=0.0), max(map(np.max, speeds.values()), default=1.0)
    tried = [logged.trial.gait for logged in trials if logged.score is not None]
    for pair, values in speeds.items():
        _send_map(recording, pair, (values - low) / max(high - low, 1e-9))
        _send_gaits(recording, pair, tried, held)
        _send_axes(recording, pair, low, high)


def _speeds_mm_s(learned: Learned, pair: Pair, held: Gait) -> Array:
    """Return the expected speeds, (points, points): a row per frequency of the second motor, a column of the first."""
    gaits = []
    for second in np.linspace(pair[1].low, pair[1].high, _POINTS):
        for first in np.linspace(pair[0].low, pair[0].high, _POINTS):
            frequency_hz = list(held.frequency_hz)
            frequency_hz[pair[0].motor], frequency_hz[pair[1].motor] = float(first), float(second)
            gaits.append(replace(held, frequency_hz=tuple(frequency_hz)))
    return 1000.0 * np.array([estimate.mean for estimate in learned.predict(gaits)]).reshape(_POINTS, _POINTS)


def _place(pair: Pair, first_hz: float, second_hz: float) -> tuple[float, float]:
    """Return the place of two frequencies in the picture: the first to the right, the second up."""
    across, up = ((hz - p.low) / (p.high - p.low) for hz, p in zip((first_hz, second_hz), pair, strict=True))
    return 0.5 + across * (_POINTS - 1), 0.5 + (1.0 - up) * (_POINTS - 1)


def _send_map(recording: rr.RecordingStream, pair: Pair, shares: Array) -> None:
    import rerun as rr

    picture = rr.Image(_colours(np.flipud(shares)), magnification_filter="Linear")
    recording.log(f"{map_path(pair)}/speed", picture, static=True)


def _colours(shares: Array) -> NDArray[np.uint8]:
    """Return the colours, shape (..., 3), of numbers from 0 to 1, shape (...)."""
    places = np.linspace(0.0, 1.0, len(_VIRIDIS))
    return np.stack([np.interp(shares, places, part) for part in _VIRIDIS.T], axis=-1).astype(np.uint8)


def _send_gaits(recording: rr.RecordingStream, pair: Pair, tried: Sequence[Gait], best: Gait) -> None:
    import rerun as rr

    first, second = pair[0].motor, pair[1].motor
    places = [_place(pair, gait.frequency_hz[first], gait.frequency_hz[second]) for gait in (*tried, best)]
    dots = rr.Points2D(places[:-1], colors=(255, 255, 255), radii=0.2)
    recording.log(f"{map_path(pair)}/tried", dots, static=True)
    recording.log(f"{map_path(pair)}/best", rr.Points2D(places[-1:], colors=_BEST, radii=0.6), static=True)


def _send_axes(recording: rr.RecordingStream, pair: Pair, low: float, high: float) -> None:
    """Send ticks in Hz along two sides, and a scale of colours in mm/s."""
    import rerun as rr

    right, left, below = _POINTS + 2.0, -3.0, _POINTS + 2.0
    ticks = [
        ((_POINTS / 2, below + 3.0), f"motor {pair[0].motor + 1} (Hz)"),
        ((left + 4.0, -3.0), f"motor {pair[1].motor + 1} (Hz)"),
        ((right + 1.0, -3.0), "mm/s"),
    ]
    for share in (0.0, 1.0):
        first, second = (p.low + share * (p.high - p.low) for p in pair)
        across, down = share * _POINTS, (1.0 - share) * _POINTS
        ticks += [((across, below), f"{first:.0f}"), ((left, down), f"{second:.0f}")]
        ticks.append(((right + 4.0, down), f"{low + share * (high - low):.0f}"))
    texts = rr.Points2D(
        [place for place, _ in ticks],
        labels=[text for _, text in ticks],
        radii=0.0,
        colors=(180, 180, 180),
        show_labels=True,
    )
    recording.log(f"{map_path(pair)}/axes", texts, static=True)
    heights = np.linspace(_POINTS, 0.0, 33)
    strips = [[(right, a), (right, b)] for a, b in pairwise(heights)]
    bar = rr.LineStrips2D(strips, colors=_colours(np.linspace(0.0, 1.0, 32)), radii=0.5)
    recording.log(f"{map_path(pair)}/scale", bar, static=True)
