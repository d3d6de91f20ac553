"""A picture with what was seen in it: tags, the robot's place and heading, the floor's axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.drivers.trackers.camera.sight import RobotTag, Sighting
from vvvaltr.drivers.trackers.camera.tags import Picture
from vvvaltr.drivers.trackers.camera.view import View

if TYPE_CHECKING:
    from cv2.typing import MatLike

_GREEN, _RED, _BLUE, _YELLOW = (60, 200, 60), (60, 60, 230), (230, 130, 40), (40, 210, 230)  # as OpenCV has them: BGR
_WHITE = (255, 255, 255)
_FINE = 4  # bits of a pixel's fraction
_AXIS_M = 0.1
_LINE_PX = 22


def drawn(grey: Picture, tags: Mapping[int, Array], robot: int, lines: Sequence[str]) -> MatLike:
    """Return a colour picture with the outline and id of each tag, and ``lines`` of text at its top.

    Args:
        grey: the picture.
        tags: the corners of each tag in pixels, shape (4, 2).
        robot: the id of the robot's tag, whose outline is green.
        lines: what else is to be read.
    """
    import cv2

    picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    for number, corners in tags.items():
        colour = _GREEN if number == robot else _YELLOW
        _polyline(picture, corners, colour, is_closed=True)
        x, y = corners.max(axis=0)
        cv2.putText(picture, str(number), (round(x) + 4, round(y)), cv2.FONT_HERSHEY_SIMPLEX, 0.6, colour, 2)
    shaded = _LINE_PX * len(lines) + 8
    picture[:shaded] = picture[:shaded] // 3
    for row, text in enumerate(lines, start=1):
        cv2.putText(picture, text, (10, _LINE_PX * row), cv2.FONT_HERSHEY_SIMPLEX, 0.6, _WHITE, 1, cv2.LINE_AA)
    return picture


def draw_floor(picture: MatLike, view: View, arena_m: tuple[tuple[float, float], tuple[float, float]] | None) -> None:
    """Draw the floor's origin with x in red and y in green, 0.1 m long each, and the arena in blue."""
    axes = np.array([[0.0, 0.0, 0.0], [_AXIS_M, 0.0, 0.0], [0.0, _AXIS_M, 0.0]])
    origin, x_end, y_end = view.pixels(axes)
    _arrow(picture, origin, x_end, _RED)
    _arrow(picture, origin, y_end, _GREEN)
    if arena_m is not None:
        (left, right), (low, high) = arena_m
        # In short pieces, for the lens bends the lines.
        share = np.linspace(0.0, 1.0, 20, endpoint=False)
        ring = np.array([[left, low], [right, low], [right, high], [left, high]])
        edges = [begin + np.outer(share, end - begin) for begin, end in zip(ring, np.roll(ring, -1, 0), strict=True)]
        _polyline(picture, view.pixels(np.pad(np.vstack(edges), ((0, 0), (0, 1)))), _BLUE, is_closed=True)


def draw_robot(picture: MatLike, view: View, tag: RobotTag, place: tuple[float, float, float]) -> None:
    """Draw a cross at the robot's centre and an arrow where it heads, at the tag's height.

    Args:
        picture: to be drawn into.
        view: where the camera hangs.
        tag: the robot's.
        place: x, y in m and yaw in rad.
    """
    import cv2

    x_m, y_m, yaw_rad = place
    ahead = 2.0 * tag.size_m
    ends = [[x_m, y_m, tag.height_m], [x_m + ahead * np.cos(yaw_rad), y_m + ahead * np.sin(yaw_rad), tag.height_m]]
    here, there = view.pixels(np.array(ends))
    _arrow(picture, here, there, _RED)
    cv2.drawMarker(picture, np.round(here).astype(int).tolist(), _RED, cv2.MARKER_CROSS, 14, 2)


def place_text(place: tuple[float, float, float], seen: Sighting) -> str:
    """Return a place in words: mm and degrees."""
    x_m, y_m, yaw_rad = place
    return (
        f"robot at x {1000 * x_m:+.1f} mm, y {1000 * y_m:+.1f} mm, yaw {np.degrees(yaw_rad):+.1f} degrees, "
        f"within {1000 * seen.uncertainty_m:.2f} mm"
    )


def _polyline(picture: MatLike, points: Array, colour: tuple[int, int, int], is_closed: bool) -> None:
    import cv2

    fine = np.round(points * (1 << _FINE)).astype(np.int32)
    cv2.polylines(picture, [fine], is_closed, colour, 2, cv2.LINE_AA, _FINE)


def _arrow(picture: MatLike, begin: Array, end: Array, colour: tuple[int, int, int]) -> None:
    import cv2

    tail, head = (np.round(each).astype(int).tolist() for each in (begin, end))
    cv2.arrowedLine(picture, tail, head, colour, 2, cv2.LINE_AA, 0, 0.15)
