"""What a run has learned, as maps: the speed that its model expects over the frequencies of two motors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, islice, pairwise

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait, GaitSpace, Parameter, Quantity
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Estimate
from vvvaltr.controller.view.canvas import Canvas, When
from vvvaltr.controller.view.chart import ticks

Pair = tuple[Parameter, Parameter]  # the searched frequencies of two motors
Predict = Callable[[Sequence[Gait]], tuple[Estimate, ...]]

_MOST_PAIRS = 45  # all of ten motors; the 1770 of sixty would take a recording minutes
_POINTS = 25  # along each side of a map
# Bounds of a map's view, in points of the map: the picture, ticks on two sides, the colour scale on the right.
MAP_X = (-6.5, _POINTS + 9.5)
MAP_Y = (-6.0, _POINTS + 8.0)
_MARKS = {"best": (255, 70, 70), "next": (255, 255, 255)}
_TEXT = (190, 194, 200)
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
class Belief:
    """What a run believed after one of its trials.

    Args:
        trial: number of that trial.
        space: gaits that are searched.
        predict: returns the estimated mean speed of each gait, in m/s.
        next_gait: the gait that is tried next; None where that is not known.
    """

    trial: int
    space: GaitSpace
    predict: Predict
    next_gait: Gait | None = None


def list_pairs(space: GaitSpace) -> tuple[Pair, ...]:
    """Return the pairs of searched frequencies, each the axes of a map; of more than ten motors the first 45 pairs."""
    pairs = combinations((p for p in space.parameters if p.quantity is Quantity.FREQUENCY), 2)
    return tuple(islice(pairs, _MOST_PAIRS))


def map_path(pair: Pair) -> str:
    """Return the path of the Rerun entity of a pair's map."""
    return f"learned/motors_{pair[0].motor + 1}_{pair[1].motor + 1}"


def send_maps(
    canvas: Canvas, belief: Belief, trials: Sequence[LoggedTrial], when: When, range_mm_s: tuple[float, float]
) -> bool:
    """Send the map of each pair of motors; all other parameters are those of the last recommended gait.

    Returns whether there is anything to map: a gait must have been recommended.

    Args:
        canvas: where to send to.
        belief: what is believed after ``trials``.
        trials: the trials so far.
        when: when the last of them ended.
        range_mm_s: speeds at the two ends of the colours.
    """
    recommended = [logged.recommendation for logged in trials if logged.recommendation is not None]
    if not recommended:
        return False
    held, low, high = recommended[-1].gait, *range_mm_s
    scored = [(logged.trial.gait.frequency_hz, 1000.0 * logged.score) for logged in trials if logged.score is not None]
    tried_hz = np.array([hz for hz, _ in scored])
    shades = colours(np.clip((np.array([speed for _, speed in scored]) - low) / (high - low), 0.0, 1.0))
    for pair in list_pairs(belief.space):
        speeds = speeds_mm_s(belief.predict, pair, held, _POINTS)
        _send_map(canvas, pair, when, np.clip((speeds - low) / (high - low), 0.0, 1.0))
        _send_tried(canvas, pair, when, tried_hz, shades)
        _send_marks(canvas, pair, when, (held, belief.next_gait))
    return True


def send_map_frames(canvas: Canvas, space: GaitSpace, range_mm_s: tuple[float, float]) -> None:
    """Send what stays the same in all maps: styles, axes, and the scale of colours, which spans ``range_mm_s``."""
    for pair in list_pairs(space):
        _send_styles(canvas, pair)
        _send_axes(canvas, pair, *range_mm_s)


def _send_styles(canvas: Canvas, pair: Pair) -> None:
    import rerun as rr

    for name, style in (
        ("speed", rr.Image.from_fields(magnification_filter="Linear", draw_order=1.0)),
        ("rim", rr.Points2D.from_fields(radii=-3.4, draw_order=2.0)),
        ("tried", rr.Points2D.from_fields(radii=-2.4, draw_order=3.0)),
        *(
            (mark, rr.LineStrips2D.from_fields(colors=colour, radii=-1.6, draw_order=4.0))
            for mark, colour in _MARKS.items()
        ),
    ):
        canvas.log(f"{map_path(pair)}/{name}", style)


def speeds_mm_s(predict: Predict, pair: Pair, held: Gait, points: int) -> Array:
    """Return the expected speeds, (points, points): a row per frequency of the second motor, a column of the first."""
    gaits = []
    for second in np.linspace(pair[1].low, pair[1].high, points):
        for first in np.linspace(pair[0].low, pair[0].high, points):
            frequency_hz = list(held.frequency_hz)
            frequency_hz[pair[0].motor], frequency_hz[pair[1].motor] = float(first), float(second)
            gaits.append(Gait(tuple(frequency_hz), held.phase_rad, held.amplitude))
    return 1000.0 * np.array([estimate.mean for estimate in predict(gaits)]).reshape(points, points)


def _places(pair: Pair, first_hz: Array, second_hz: Array) -> Array:
    """Return the places in the picture of some pairs of frequencies, (n, 2): the first to the right, the second up."""
    across, up = ((hz - p.low) / (p.high - p.low) for hz, p in zip((first_hz, second_hz), pair, strict=True))
    return np.stack([0.5 + across * (_POINTS - 1), 0.5 + (1.0 - up) * (_POINTS - 1)], axis=1)


def _place(pair: Pair, first_hz: float, second_hz: float) -> tuple[float, float]:
    """Return the place of two frequencies in the picture."""
    x, y = _places(pair, np.array([first_hz]), np.array([second_hz]))[0].tolist()
    return x, y


def _send_map(canvas: Canvas, pair: Pair, when: When, shares: Array) -> None:
    import rerun as rr

    shape = rr.components.ImageFormat(width=_POINTS, height=_POINTS, color_model="RGB", channel_datatype="U8")
    pixels = colours(np.flipud(shares)).reshape(1, -1)
    path = f"{map_path(pair)}/speed"
    canvas.send(path, [when], rr.Image.columns(buffer=pixels, format=[shape]))


def colours(shares: Array) -> NDArray[np.uint8]:
    """Return the colours, shape (..., 3), of numbers from 0 to 1, shape (...)."""
    places = np.linspace(0.0, 1.0, len(_VIRIDIS))
    return np.stack([np.interp(shares, places, part) for part in _VIRIDIS.T], axis=-1).astype(np.uint8)


def _send_tried(canvas: Canvas, pair: Pair, when: When, tried_hz: Array, shades: NDArray[np.uint8]) -> None:
    """Send the gaits that were tried, frequencies (n, motors), in the colours (n, 3) of their speeds."""
    import rerun as rr

    dots = _places(pair, tried_hz[:, pair[0].motor], tried_hz[:, pair[1].motor])
    for name, shade in (("rim", np.zeros_like(shades)), ("tried", shades)):
        path = f"{map_path(pair)}/{name}"
        columns = rr.Points2D.columns(positions=dots, colors=shade)
        canvas.send(path, [when], columns.partition([len(dots)]))


def _send_marks(canvas: Canvas, pair: Pair, when: When, marked: tuple[Gait, Gait | None]) -> None:
    """Send the recommended gait, and the one that is next."""
    import rerun as rr

    first, second = pair[0].motor, pair[1].motor
    for name, shape, gait in (("best", _star, marked[0]), ("next", _ring, marked[1])):
        path = f"{map_path(pair)}/{name}"
        known = [] if gait is None else [shape(_place(pair, gait.frequency_hz[first], gait.frequency_hz[second]))]
        canvas.send(path, [when], rr.LineStrips2D.columns(strips=known).partition([len(known)]))


def _ring(centre: tuple[float, float]) -> list[tuple[float, float]]:
    turns = np.linspace(0.0, 2.0 * np.pi, 25)
    return [(centre[0] + 1.1 * float(np.cos(a)), centre[1] + 1.1 * float(np.sin(a))) for a in turns]


def _star(centre: tuple[float, float]) -> list[tuple[float, float]]:
    """Return the outline of a star with five points."""
    turns = -0.5 * np.pi + np.linspace(0.0, 2.0 * np.pi, 11)
    radii = [1.6 if place % 2 == 0 else 0.7 for place in range(11)]
    return [
        (centre[0] + r * float(np.cos(a)), centre[1] + r * float(np.sin(a))) for a, r in zip(turns, radii, strict=True)
    ]


def _send_axes(canvas: Canvas, pair: Pair, low: float, high: float) -> None:
    """Send ticks in Hz along two sides, a scale of colours in mm/s, and what the marks are."""
    import rerun as rr

    # Rerun writes a label a little below its place.
    texts: list[tuple[tuple[float, float], str, tuple[int, int, int]]] = [
        ((_POINTS / 2, _POINTS + 3.4), f"motor {pair[0].motor + 1} (Hz)", _TEXT),
        ((1.0, -5.2), f"motor {pair[1].motor + 1} (Hz)", _TEXT),
        ((_POINTS + 5.0, -5.2), "mm/s", _TEXT),
    ]
    for hz in ticks(pair[0].low, pair[0].high, 3):
        texts.append(((_place(pair, hz, pair[1].low)[0], _POINTS + 0.2), f"{hz:g}", _TEXT))
    for hz in ticks(pair[1].low, pair[1].high, 3):
        texts.append(((-2.2, _place(pair, pair[0].low, hz)[1] - 1.5), f"{hz:g}", _TEXT))
    for speed in ticks(low, high, 4):
        height = _POINTS * (1.0 - (speed - low) / (high - low))
        texts.append(((_POINTS + 5.6, height - 1.5), f"{speed:g}", _TEXT))
    places, labels, shades = zip(*texts, strict=True)
    points = rr.Points2D(places, labels=labels, radii=0.0, colors=shades, show_labels=True)
    canvas.log(f"{map_path(pair)}/axes", points)
    right, heights = _POINTS + 2.5, np.linspace(_POINTS - 0.4, 0.4, 129)
    strips = [[(right, a), (right, b)] for a, b in pairwise(heights)]
    bar = rr.LineStrips2D(strips, colors=colours(np.linspace(0.0, 1.0, 128)), radii=0.5)
    canvas.log(f"{map_path(pair)}/scale", bar)
