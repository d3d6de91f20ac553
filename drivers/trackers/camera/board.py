"""The lens from pictures of a printed ChArUco board: chessboard corners that are known even where others are hidden."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.errors import UserError
from vvvaltr.drivers.trackers.camera.lens import Lens
from vvvaltr.drivers.trackers.camera.tags import Picture

if TYPE_CHECKING:
    import cv2

BOARD_CELL_MM = 0.5
"""Size of a cell of ``board_cells``."""
_SQUARES = (7, 5)
_SQUARE_M, _MARKER_M = 0.030, 0.021  # seven modules of 3 mm
_LEAST_CORNERS = 12  # of 24 in a view
_LEAST_CHANGE = 0.04  # of the picture's width, mean over the corners, between two views
_MOST_ERROR_PX = 1.0
_MOST_FOCAL_DOUBT = 0.01
_LEAST_TILT = 0.12  # standard deviation of the board's normals, along the direction in which they differ least


def board() -> cv2.aruco.CharucoBoard:
    """Return the board, seven by five squares of 30 mm; its markers are of another family than the robot's."""
    import cv2

    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)
    return cv2.aruco.CharucoBoard(_SQUARES, _SQUARE_M, _MARKER_M, markers)


def board_cells() -> Picture:
    """Return the board as a picture of cells of half a millimetre, 0 or 255."""
    cells = (round(1000.0 * _SQUARE_M * side / BOARD_CELL_MM) for side in _SQUARES)
    return np.asarray(board().generateImage((next(cells), next(cells))), np.uint8)


@dataclass(frozen=True, slots=True)
class BoardView:
    """The board's corners in one picture.

    Args:
        points_m: on the board, shape (n, 3).
        pixels: in the picture, shape (n, 2).
        numbers: which corners, shape (n,).
    """

    points_m: Array
    pixels: Array
    numbers: Array


class BoardViews:
    """Collects views of the board that differ from one another."""

    def __init__(self) -> None:
        import cv2

        self._board = board()
        self._detector = cv2.aruco.CharucoDetector(self._board)
        self.views: list[BoardView] = []
        self.size_px = (0, 0)

    def add(self, grey: Picture) -> bool:
        """Look at a picture; returns whether it shows the board as none before did."""
        corners, numbers, _, _ = self._detector.detectBoard(grey)
        if numbers is None or len(numbers) < _LEAST_CORNERS:
            return False
        which = np.ravel(numbers)
        view = BoardView(
            np.asarray(self._board.getChessboardCorners(), np.float64)[which],
            np.asarray(corners, np.float64).reshape(-1, 2),
            which.astype(np.float64),
        )
        self.size_px = (grey.shape[1], grey.shape[0])
        if any(_change_px(view, other) < _LEAST_CHANGE * grey.shape[1] for other in self.views):
            return False
        self.views.append(view)
        return True


@dataclass(frozen=True, slots=True)
class Calibration:
    """A lens, and how well it is known.

    Args:
        lens: the lens.
        error_px: root mean square distance between the corners seen and those that the lens explains.
        focal_doubt: standard deviation of the focal length, as a share of it.
    """

    lens: Lens
    error_px: float
    focal_doubt: float


def calibrated(views: BoardViews) -> Calibration:
    """Return the lens that explains the views.

    Raises:
        UserError: the views cannot tell: says what to do differently.
    """
    import cv2

    points = [view.points_m.astype(np.float32) for view in views.views]
    pixels = [view.pixels.astype(np.float32) for view in views.views]
    error_px, matrix, distortion, turns, _, doubts, _, _ = cv2.calibrateCameraExtended(
        points, pixels, views.size_px, np.eye(3), np.zeros(5)
    )
    (fx, _, cx), (_, fy, cy) = np.asarray(matrix)[:2].tolist()
    focal_doubt = float(np.ravel(doubts)[0]) / fx
    if error_px > _MOST_ERROR_PX:
        raise UserError(
            f"the board's corners are {error_px:.1f} px off (root mean square), {_MOST_ERROR_PX:g} px is the limit; "
            "glue the board onto something flat, hold it still, and light it evenly"
        )
    # Views without a tilt fit any focal length at its own distance, and the fit's own doubt does not tell.
    normals = np.array([cv2.Rodrigues(turn)[0][:2, 2] for turn in turns])
    tilt = float(np.linalg.svd(normals - normals.mean(axis=0), compute_uv=False)[-1]) / math.sqrt(len(normals))
    if tilt < _LEAST_TILT or not focal_doubt < _MOST_FOCAL_DOUBT:
        raise UserError(
            "these views of the board cannot tell the focal length; tilt the board by 30 degrees, to all sides, and "
            "show it in the picture's corners too"
        )
    lens = Lens(*views.size_px, (fx, fy), (cx, cy), tuple(np.ravel(distortion)[:5].tolist()))
    return Calibration(lens, float(error_px), focal_doubt)


def _change_px(one: BoardView, other: BoardView) -> float:
    """Return how far the corners that both views show have moved, on average; infinity without any such."""
    _, here, there = np.intersect1d(one.numbers, other.numbers, return_indices=True)
    if not len(here):
        return float("inf")
    return float(np.hypot(*(one.pixels[here] - other.pixels[there]).T).mean())
