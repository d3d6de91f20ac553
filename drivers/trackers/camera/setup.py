"""From the first pictures to the view: where the camera hangs, by floor tags, by its height, or by the tag's size."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.errors import UserError
from vvvaltr.drivers.trackers.camera.edges import corners_from, side_points
from vvvaltr.drivers.trackers.camera.lens import Lens
from vvvaltr.drivers.trackers.camera.sight import RobotTag
from vvvaltr.drivers.trackers.camera.tags import Picture, all_tags
from vvvaltr.drivers.trackers.camera.view import View, height_from_size, looking_down, over_floor_tags

LOOKS = 20
"""Pictures in which every tag is seen, of which the median is taken."""
_MOST_LOOKS = 90
_LEAST_SIDE_PX = 16.0
_HEIGHT_DOUBT = 0.1  # share by which two ways to know the camera's height may differ
_FLOOR_DOUBT_M = 0.01

NextPicture = Callable[[], Picture]


def find_view(
    lens: Lens,
    tag: RobotTag,
    places_m: Mapping[int, tuple[float, float]],
    camera_height_m: float,
    next_picture: NextPicture,
) -> View:
    """Return where the camera hangs.

    Args:
        lens: its lens.
        tag: the one on the robot.
        places_m: x and y of the centre of each floor tag; empty for none.
        camera_height_m: of the camera above the ground, as measured; 0 for unknown.
        next_picture: returns one picture after another.

    Raises:
        UserError: tags are not seen, or what was measured cannot be: says what to correct.
    """
    if places_m:
        view = _by_floor_tags(lens, places_m, next_picture)
        _check_height(float(view.position_m[2]), camera_height_m, "the floor tags", "their places or tracker.lens")
        return view
    if camera_height_m > 0.0:
        return looking_down(lens, camera_height_m)
    seen = _looks(lens, [tag.id], next_picture)[tag.id]
    return looking_down(lens, height_from_size(seen, tag.size_m, tag.height_m))


def find_sharp_corners(grey: Picture, corners: Array, lens: Lens) -> Array | None:
    """Return a tag's corners as rays, from its edges, shape (4, 2); None where they are not seen well."""
    points = side_points(grey, corners)
    if points is None:
        return None
    return corners_from(lens.rays(points.reshape(-1, 2)).reshape(points.shape))


def _by_floor_tags(lens: Lens, places_m: Mapping[int, tuple[float, float]], next_picture: NextPicture) -> View:
    seen = _looks(lens, list(places_m), next_picture)
    try:
        view = over_floor_tags(lens, {number: np.median(seen[number], axis=0) for number in seen}, places_m)
    except ValueError as error:
        raise UserError(str(error)) from None
    if view.error_m > _FLOOR_DOUBT_M:
        raise UserError(
            f"the floor tags are {1000 * view.error_m:.0f} mm off where tracker.floor says (root mean square); "
            "measure their places again, and check that no two are exchanged"
        )
    return view


def _looks(lens: Lens, numbers: Sequence[int], next_picture: NextPicture) -> dict[int, list[Array]]:
    """Return the corners of each tag as rays, in ``LOOKS`` pictures. Raises UserError if one is not seen so often."""
    seen: dict[int, list[Array]] = {number: [] for number in numbers}
    for _ in range(_MOST_LOOKS):
        grey = next_picture()
        tags = all_tags(grey, _LEAST_SIDE_PX)
        for number in set(numbers) & set(tags):
            if (corners := find_sharp_corners(grey, tags[number], lens)) is not None:
                seen[number].append(corners)
        if all(len(looks) >= LOOKS for looks in seen.values()):
            return seen
    hidden = [str(number) for number in numbers if len(seen[number]) < LOOKS]
    also = f" (it sees {', '.join(map(str, sorted(tags)))})" if tags else ""
    raise UserError(
        f"the camera does not see tag {' and tag '.join(hidden)}{also}; put the whole tag with its white margin into "
        "the picture, in even light: vvvaltr camera ROBOT show draws what it sees"
    )


def _check_height(found_m: float, measured_m: float, by: str, correct: str) -> None:
    if measured_m > 0.0 and abs(found_m / measured_m - 1.0) > _HEIGHT_DOUBT:
        raise UserError(
            f"{by} put the camera {found_m:.2f} m above the ground, and tracker.camera_height_m says {measured_m:g} m; "
            f"correct that, or {correct}"
        )
