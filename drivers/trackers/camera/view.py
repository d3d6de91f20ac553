"""Where the camera hangs, and so which place on the ground a pixel shows: the known-plane method.

The ground is z = 0. A pixel is a ray, which meets the plane on which the tag moves, at its known height, in one point.
The size of a small tag tells its distance far worse than that, so it only checks what was found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.drivers.trackers.camera.edges import centre_of
from vvvaltr.drivers.trackers.camera.lens import Lens

_LOOKING_DOWN = np.diag([1.0, -1.0, -1.0])  # right in the picture is +x, up is +y


@dataclass(frozen=True, slots=True)
class View:
    """A camera over the ground.

    Args:
        lens: its lens.
        rotation: from the world's axes to the camera's (x right, y down, z along the view), shape (3, 3).
        position_m: of the camera, shape (3,).
        error_m: how far the floor tags are from where they should be, root mean square; 0 without floor tags.
        floor_side_m: how long their sides are, the median; 0 without floor tags.
    """

    lens: Lens
    rotation: Array = field(default_factory=lambda: _LOOKING_DOWN.copy())
    position_m: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    error_m: float = 0.0
    floor_side_m: float = 0.0

    def on_plane(self, pixels: Array, height_m: float) -> Array:
        """Return which points at ``height_m`` above the ground ``pixels``, shape (n, 2), show: x and y, (n, 2)."""
        rays = self.lens.rays(pixels)
        directions = np.column_stack([rays, np.ones(len(rays))]) @ self.rotation
        reach = (height_m - self.position_m[2]) / directions[:, 2]
        return np.asarray(self.position_m[:2] + directions[:, :2] * reach[:, None])

    def meet_floor(self, ray: Array) -> tuple[float, float]:
        """Return x and y of where a straight ray, shape (2,), meets the ground."""
        ((x_m, y_m),) = self.on_plane(self.lens.pixels(np.array([[*ray, 1.0]])), 0.0).tolist()
        return x_m, y_m

    def find_pixel(self, x_m: float, y_m: float) -> Array:
        """Return where a point of the ground is seen, shape (2,)."""
        return np.asarray(self.pixels(np.array([[x_m, y_m, 0.0]]))[0])

    def pixels(self, points_m: Array) -> Array:
        """Return where points of the world, shape (n, 3), are seen: (n, 2)."""
        return self.lens.pixels((points_m - self.position_m) @ self.rotation.T)

    def side_px(self, size_m: float, height_m: float) -> float:
        """Return how long a side of ``size_m`` is in the picture's middle, at ``height_m`` above the ground."""
        return self.lens.focal_px[0] * size_m / max(1e-6, float(self.position_m[2]) - height_m)


def looking_down(lens: Lens, camera_height_m: float) -> View:
    """Return the view of a camera that looks straight down; the origin lies under it."""
    return View(lens, position_m=np.array([0.0, 0.0, camera_height_m]))


def height_from_size(corners: Sequence[Array], size_m: float, height_m: float) -> float:
    """Return how high a camera that looks straight down hangs, from how large it sees a tag of known size and height.

    Args:
        corners: the tag's corners as rays, (4, 2), in some pictures.
        size_m: the length of a side of the tag.
        height_m: the height of the tag over the ground.
    """
    sides = [np.linalg.norm(rays - np.roll(rays, 1, axis=0), axis=1) for rays in corners]
    return height_m + size_m / float(np.median(sides))


def over_floor_tags(lens: Lens, seen: Mapping[int, Array], places_m: Mapping[int, tuple[float, float]]) -> View:
    """Return the view in which floor tags are where they are known to be.

    Args:
        lens: its lens.
        seen: the corners of each tag as rays, (4, 2).
        places_m: x and y of the centre of each tag; four at least, not in one line.

    Raises:
        ValueError: no camera over the ground sees the tags so.
    """
    import cv2

    places = np.array([(*places_m[number], 0.0) for number in places_m])
    rays = np.array([centre_of(seen[number]) for number in places_m])
    found, turn, shift = cv2.solvePnP(places, rays, np.eye(3), np.zeros(5), flags=cv2.SOLVEPNP_ITERATIVE)
    rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
    view = View(lens, rotation, np.asarray(-rotation.T @ shift.ravel(), dtype=np.float64))
    if not found or not np.isfinite(view.position_m).all() or view.position_m[2] <= 0.0:
        raise ValueError("the floor tags are not where tracker.floor says: measure their places again")
    off_m = view.on_plane(lens.pixels(np.column_stack([rays, np.ones(len(rays))])), 0.0) - places[:, :2]
    error_m = math.sqrt(float(np.mean(np.sum(off_m**2, axis=1))))
    return View(lens, rotation, view.position_m, error_m, _side_m(view, seen))


def _side_m(view: View, seen: Mapping[int, Array]) -> float:
    """Return the median side of tags on the ground, whose corners are given as rays."""
    corners = [view.on_plane(view.lens.pixels(np.column_stack([rays, np.ones(4)])), 0.0) for rays in seen.values()]
    return float(np.median([np.linalg.norm(each - np.roll(each, 1, axis=0), axis=1) for each in corners]))
