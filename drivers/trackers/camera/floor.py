"""Whether the camera still hangs where it did: a camera that was pushed would pass for a robot that moved."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.drivers.trackers.camera.edges import centre_of
from vvvaltr.drivers.trackers.camera.setup import find_sharp_corners
from vvvaltr.drivers.trackers.camera.tags import Picture, TagFinder
from vvvaltr.drivers.trackers.camera.view import View

_MOVED_M = 0.004  # beside three times what the floor tags are off anyway


class FloorWatch:
    """Looks at the floor tags, one after the other, and compares them with where they were at the start.

    Args:
        view: where the camera hangs.
        places_m: x and y of the centre of each floor tag; empty for none, and then nothing is noticed.
    """

    def __init__(self, view: View, places_m: Mapping[int, tuple[float, float]]) -> None:
        self._view = view
        self._places_m = places_m
        side_px = view.side_px(view.floor_side_m, 0.0)
        longer_px = max(view.lens.width_px, view.lens.height_px)
        self._finders = {number: TagFinder(number, side_px, longer_px) for number in places_m}
        for number, (x_m, y_m) in places_m.items():
            self._finders[number].expect(view.find_pixel(x_m, y_m))
        self._turns = itertools.cycle(places_m)
        self._moved: dict[int, float] = {}

    def check(self, grey: Picture) -> TrackingLost | None:
        """Look at the next floor tag. Returns why poses cannot be trusted; None while all tags seen are in place."""
        if not self._places_m:
            return None
        number = next(self._turns)
        off_m = self._off_m(number, grey)
        if off_m > _MOVED_M + 3.0 * self._view.error_m:
            self._moved[number] = off_m
        elif not math.isnan(off_m):  # one that is covered says nothing
            self._moved.pop(number, None)
        if not self._moved:
            return None
        number, off_m = max(self._moved.items(), key=lambda item: item[1])
        what = f"floor tag {number} is {1000.0 * off_m:.0f} mm off: camera or tag was moved"
        return TrackingLost(what, "put it back, or start again")

    def _off_m(self, number: int, grey: Picture) -> float:
        """Return how far a floor tag is from its place; NaN where it is not seen well."""
        corners = self._finders[number].find(grey)
        rays = None if corners is None else find_sharp_corners(grey, corners, self._view.lens)
        if rays is None:
            return math.nan
        return math.dist(self._view.meet_floor(centre_of(rays)), self._places_m[number])
