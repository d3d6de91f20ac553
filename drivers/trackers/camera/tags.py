"""Finds AprilTags 36h11 in pictures: one tag again and again near where it was last, or all that there are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array

if TYPE_CHECKING:
    import cv2

Picture = NDArray[np.uint8]

_THRESHOLD_PX = 13  # window of the adaptive threshold: one size is enough for edges as sharp as a camera's
_WIDE_THRESHOLD_PX = 23  # for a blurred tag
_SHARPEN, _SHARPEN_PX = 4.0, (1.0, 3.0)  # for blur of 2 to 3 px: found 73 to 100 % of the time, before 8 to 93 %
_LEAST_SIDE = 0.45  # of the side that is expected: a size that is wrong in the robot's file can still be told
_WINDOW = 4.5  # sides of the tag
_LEAST_WINDOW_PX = 96


def dictionary() -> cv2.aruco.Dictionary:
    """Return the family of tags."""
    import cv2

    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)


def all_tags(grey: Picture, least_side_px: float = 20.0) -> dict[int, Array]:
    """Return the corners, shape (4, 2), clockwise from the upper left, of each tag in a picture."""
    return _found(_detector(max(grey.shape), least_side_px, _WIDE_THRESHOLD_PX), grey)


class TagFinder:
    """Follows one tag.

    Args:
        tag: its id.
        side_px: how long a side of it is in the pictures, roughly.
        picture_px: the longer side of the pictures.
    """

    def __init__(self, tag: int, side_px: float, picture_px: int) -> None:
        self._tag = tag
        self._half_px = max(_LEAST_WINDOW_PX, round(_WINDOW * side_px)) // 2
        least_px = _LEAST_SIDE * side_px
        self._near = _detector(2 * self._half_px, least_px, _THRESHOLD_PX)
        self._nearly = _detector(2 * self._half_px, least_px, _WIDE_THRESHOLD_PX)
        self._anywhere = _detector(picture_px, least_px, _THRESHOLD_PX)
        self._centre: Array | None = None
        self._misses = 0

    def expect(self, centre_px: Array) -> None:
        """Look first around a pixel, shape (2,)."""
        self._centre = centre_px

    def find(self, grey: Picture) -> Array | None:
        """Return the tag's corners, good to a pixel, shape (4, 2), clockwise from its upper left; None if unseen."""
        corners = self.find_near(grey)
        if corners is None:
            # Of the pictures that are searched as a whole, every second one is sharpened before.
            whole = sharpened(grey) if self._misses % 2 else grey
            corners = _found(self._anywhere, whole).get(self._tag)
        if corners is not None:
            self._centre = corners.mean(axis=0)
        self._misses = self._misses + 1 if corners is None else 0
        return corners

    def find_near(self, grey: Picture) -> Array | None:
        """Return the tag's corners, as ``find`` does, if the tag is near where it was last, or is expected."""
        if self._centre is None:
            return None
        left, top = (max(0, round(float(middle)) - self._half_px) for middle in self._centre)
        window = grey[top : top + 2 * self._half_px, left : left + 2 * self._half_px]
        found = _found(self._near, window).get(self._tag)
        if found is None:
            found = _found(self._nearly, sharpened(window)).get(self._tag)
        return None if found is None else np.asarray(found + np.array([left, top]))


def sharpened(grey: Picture) -> Picture:
    """Return a picture in which modules stand out that blur or noise drowned: what is finer or coarser is weaker."""
    import cv2

    fine, coarse = (cv2.GaussianBlur(grey, (0, 0), scale_px) for scale_px in _SHARPEN_PX)
    return np.asarray(cv2.addWeighted(fine, 1.0 + _SHARPEN, coarse, -_SHARPEN, 0.0), np.uint8)


def _found(detector: cv2.aruco.ArucoDetector, grey: Picture) -> dict[int, Array]:
    quads, numbers, _ = detector.detectMarkers(grey)
    if numbers is None:
        return {}
    return {
        int(number): np.asarray(quad, dtype=np.float64).reshape(4, 2)
        for number, quad in zip(np.ravel(numbers), quads, strict=True)
    }


def _detector(picture_px: int, least_side_px: float, widest_px: int) -> cv2.aruco.ArucoDetector:
    import cv2

    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_CONTOUR
    settings.adaptiveThreshWinSizeMin = _THRESHOLD_PX
    settings.adaptiveThreshWinSizeMax = widest_px
    settings.adaptiveThreshWinSizeStep = _WIDE_THRESHOLD_PX - _THRESHOLD_PX
    settings.minMarkerPerimeterRate = 4.0 * least_side_px / picture_px
    return cv2.aruco.ArucoDetector(dictionary(), settings)
