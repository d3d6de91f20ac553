"""Where the four sides of a tag lie, to a few hundredths of a pixel.

The detector's corners are good to a quarter of a pixel. Across each side the brightness rises from black to white; the
centroid of that rise, taken at many places of a side, gives a line, and two lines a corner. Blur moves none of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array

_PLACES = 32  # on each side
_SPAN = np.linspace(0.06, 0.94, _PLACES)  # of a side; near its ends the other side's blur is seen
_STEP_PX = 0.5
_REACH = 0.095  # across a side, as a share of it: the black frame is an eighth of it wide
_OUTWARD_PX = 1.0  # the detector's contour runs on black pixels
_ROUNDS = 3  # of fitting lines without what was far off the last ones
_LEAST_ANGLE = 0.1  # between two sides, as a sine
_TRIM = 2.5  # residuals above so many medians are another thing's edge


def side_points(grey: NDArray[np.uint8], corners: Array) -> Array | None:
    """Return points on the four sides of a tag.

    Args:
        grey: the picture.
        corners: the tag's corners, shape (4, 2), clockwise, good to a pixel or two.

    Returns:
        Points in pixels, shape (4, places, 2), NaN where no edge is seen; None where the tag's edges leave the picture.
    """
    import cv2

    ends = np.roll(corners, -1, axis=0)
    along = ends - corners
    length = np.hypot(along[:, 0], along[:, 1])
    # Clockwise in a picture whose y points down: the outside is on the left.
    normals = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
    reach_px = min(max(_REACH * float(length.mean()), 2.0), 6.0)
    across = np.arange(-reach_px, reach_px + 0.01, _STEP_PX)
    feet = corners[:, None] + along[:, None] * _SPAN[:, None] + _OUTWARD_PX * normals[:, None]
    places = (feet[:, :, None] + normals[:, None, None] * across[:, None]).astype(np.float32)
    height, width = grey.shape
    if places.min() < 0 or places[..., 0].max() > width - 1 or places[..., 1].max() > height - 1:
        return None
    flat = places.reshape(-1, len(across), 2)
    profiles = cv2.remap(grey, flat[..., 0], flat[..., 1], cv2.INTER_LINEAR).astype(np.float64)
    offsets = _centroids(np.diff(profiles), across[:-1] + _STEP_PX / 2).reshape(4, _PLACES)
    return np.asarray(feet + normals[:, None] * offsets[..., None])


def _centroids(rises: Array, across: Array) -> Array:
    """Return where each profile rises, shape (n,); NaN where it rises by less than half of what most do."""
    rises = np.maximum(rises, 0.0)
    heights = rises.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        # The largest rise is the edge; what rises less than a quarter of it is noise.
        rises = np.where(rises > 0.25 * rises.max(axis=1, keepdims=True), rises, 0.0)
        centroids = (rises @ across) / rises.sum(axis=1)
    return np.where(heights > 0.5 * np.median(heights), centroids, np.nan)


def corners_from(points: Array) -> Array | None:
    """Return the corners, shape (4, 2), between lines through the points of four sides; None without enough points.

    Args:
        points: on each side, shape (4, places, 2), NaN where there is none; in any plane in which sides are straight.
    """
    is_near = np.isfinite(points[..., 0])
    points = np.where(is_near[..., None], points, 0.0)
    for _ in range(_ROUNDS):
        counts = is_near.sum(axis=1)
        if counts.min() < _PLACES // 2:
            return None
        normals, distances = _lines(points, is_near)
        residuals = np.abs(np.einsum("sni,si->sn", points, normals) - distances[:, None])
        medians = np.sort(np.where(is_near, residuals, np.inf), axis=1)[np.arange(4), counts // 2]
        is_near &= residuals <= np.maximum(_TRIM * medians, 1e-9)[:, None]
    pairs = np.stack([np.roll(normals, 1, axis=0), normals], axis=1)
    if np.abs(np.linalg.det(pairs)).min() < _LEAST_ANGLE:
        return None
    return np.asarray(np.linalg.solve(pairs, np.stack([np.roll(distances, 1), distances], axis=1)[..., None])[..., 0])


def _lines(points: Array, weights: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the normals, shape (4, 2), and distances, (4,), of the least-squares lines of four sides."""
    shares = weights / weights.sum(axis=1, keepdims=True)
    middles = np.einsum("sn,sni->si", shares, points)
    x, y = np.moveaxis(points - middles[:, None], -1, 0)
    # The direction of the longer axis of the points' covariance.
    angles = 0.5 * np.arctan2(2.0 * (shares * x * y).sum(axis=1), (shares * (x * x - y * y)).sum(axis=1))
    normals = np.column_stack([-np.sin(angles), np.cos(angles)])
    return normals, (normals * middles).sum(axis=1)


def centre_of(corners: Array) -> Array:
    """Return where the diagonals of four corners, shape (4, 2), meet: the centre of a square in perspective."""
    first, second = corners[2] - corners[0], corners[3] - corners[1]
    share = np.linalg.solve(np.column_stack([first, -second]), corners[1] - corners[0])[0]
    return np.asarray(corners[0] + share * first)
