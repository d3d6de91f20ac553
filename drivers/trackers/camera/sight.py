"""From a picture to the robot's place: the tag's corners on the plane on which it moves, and how square they are."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.drivers.trackers.camera.edges import corners_from, side_points
from vvvaltr.drivers.trackers.camera.tags import Picture, TagFinder
from vvvaltr.drivers.trackers.camera.view import View

_WIDEST = 1.25  # apparent over true size of the tag: it is higher than the robot's file says, or the size is wrong
_NARROWEST = 0.8  # lower, smaller, or tilted by 37 degrees
_LEAST_SQUARE = 0.06  # of a side: corners that are further off are not the tag's
# The corners in the tag's own axes (x to its right, y up), as complex numbers, clockwise from the upper left.
_SQUARE = np.array([-0.5 + 0.5j, 0.5 + 0.5j, 0.5 - 0.5j, -0.5 - 0.5j])


@dataclass(frozen=True, slots=True)
class RobotTag:
    """The tag on the robot.

    Args:
        id: its number in the family 36h11.
        size_m: the length of a side of its black square.
        height_m: how high above the ground it is.
    """

    id: int
    size_m: float
    height_m: float


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where the tag is.

    Args:
        x_m, y_m: its centre.
        yaw_rad: how it is turned; 0 where its right points along +x.
        uncertainty_m: how far its corners are from those of a square of its size, root mean square.
        corners_px: its corners in the picture, shape (4, 2).
    """

    x_m: float
    y_m: float
    yaw_rad: float
    uncertainty_m: float
    corners_px: Array


class Unseen(TrackingLost):
    """The tag is not in the picture, or not to be trusted: says why, and the cure."""


class Sight:
    """Reads the robot's place from one picture after another.

    Args:
        view: where the camera hangs.
        tag: what it looks for.
    """

    def __init__(self, view: View, tag: RobotTag) -> None:
        self.view = view
        self.tag = tag
        longer_px = max(view.lens.width_px, view.lens.height_px)
        self._finder = TagFinder(tag.id, view.side_px(tag.size_m, tag.height_m), longer_px)

    def read(self, grey: Picture) -> Sighting:
        """Return where the tag is. Raises Unseen."""
        rough = self._finder.find(grey)
        if rough is None:
            raise Unseen(f"the camera does not see tag {self.tag.id}", "put it into the picture, and light it evenly")
        points = side_points(grey, rough)
        if points is None:
            raise Unseen(f"tag {self.tag.id} leaves the picture", "put the robot nearer to the middle")
        plane = self.view.on_plane(points.reshape(-1, 2), self.tag.height_m).reshape(points.shape)
        corners = corners_from(plane)
        if corners is None:
            cure = "clear the camera's view, and focus it; a shorter tracker.exposure_s blurs less"
            raise Unseen(f"the edges of tag {self.tag.id} are covered or blurred", cure)
        return self._sighting(corners, rough)

    def _sighting(self, corners_m: Array, corners_px: Array) -> Sighting:
        size_m = self.tag.size_m
        places = corners_m[:, 0] + 1j * corners_m[:, 1]
        centre = complex(places.mean())
        # The least-squares similarity between the square and the corners (Procrustes): its argument is the yaw.
        turn = complex(np.vdot(_SQUARE, places - centre)) / (2.0 * size_m)
        if not _NARROWEST < abs(turn) < _WIDEST:
            raise Unseen(
                f"tag {self.tag.id} looks {1000 * size_m * abs(turn):.1f} mm wide, and should be {1000 * size_m:g} mm",
                "correct tag.size_m, tag.height_m or the camera's height",
            )
        off = np.abs(places - centre - size_m * turn * _SQUARE)
        if (worst_m := float(off.max())) > _LEAST_SQUARE * size_m:
            what = f"tag {self.tag.id} is not square: a corner is {1000 * worst_m:.1f} mm off"
            raise Unseen(what, "uncover it, or lay it flat")
        off = np.abs(places - centre - size_m * turn / abs(turn) * _SQUARE)
        return Sighting(centre.real, centre.imag, cmath.phase(turn), math.sqrt(float(np.mean(off**2))), corners_px)
