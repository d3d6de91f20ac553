"""The table of a camera in a robot's file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Self

import msgspec
import numpy as np
from msgspec import Meta

from vvvaltr.drivers.table import AgeLimit, Finite, NotNegative, Positive, Table, TrackerTable
from vvvaltr.drivers.trackers.camera.lens import Lens
from vvvaltr.drivers.trackers.camera.sight import RobotTag
from vvvaltr.drivers.trackers.camera.source import FRAMES, Wanted

_LEAST_FLOOR_TAGS = 4
_LEAST_BREADTH = 0.01  # of where the floor tags lie, as a share of its length
TagNumber = Annotated[int, Meta(ge=0, le=586)]
Side = Annotated[int, Meta(ge=64, le=8192)]


class TagTable(Table, frozen=True, kw_only=True):
    """The AprilTag (family 36h11) on the robot.

    Args:
        id: its number.
        size_m: the side of the black square.
        height_m: of the tag above the ground.
        x_m, y_m: the tag's centre in the robot's frame, x forward and y to the left; the robot's centre is tracked.
        yaw_rad: how the tag is turned on the robot; 0 if its right points forward.
    """

    id: TagNumber = 0
    size_m: Positive
    height_m: NotNegative
    x_m: Finite = 0.0
    y_m: Finite = 0.0
    yaw_rad: Finite = 0.0


class FloorTagTable(Table, frozen=True, kw_only=True):
    """A tag on the ground, with the place of its centre."""

    id: TagNumber
    x_m: Finite
    y_m: Finite


class LensTable(Table, frozen=True, kw_only=True):
    """The lens, as ``vvvaltr camera ROBOT calibrate`` writes it; see ``lens.Lens``."""

    width_px: Side
    height_px: Side
    focal_px: tuple[Positive, Positive]
    centre_px: tuple[Finite, Finite]
    distortion: Annotated[tuple[Finite, ...], Meta(max_length=5)] = ()
    error_px: NotNegative = 0.0

    @property
    def lens(self) -> Lens:
        """The lens."""
        return Lens(self.width_px, self.height_px, self.focal_px, self.centre_px, self.distortion)


def lens_table(lens: Lens, error_px: float = 0.0) -> LensTable:
    """Return the table of a lens."""
    size = {"width_px": lens.width_px, "height_px": lens.height_px}
    return LensTable(
        **size, focal_px=lens.focal_px, centre_px=lens.centre_px, distortion=lens.distortion, error_px=error_px
    )


class CameraTable(TrackerTable, frozen=True, kw_only=True, tag="camera"):
    """A camera over the ground.

    Args:
        source: number of the camera, a path below /dev, a film, or a folder of pictures.
        width_px, height_px, rate_hz: what the camera is asked for.
        exposure_s: how long the shutter is open; 0 leaves it to the camera.
        age_limit_s: a pose that is older is no longer the robot's.
        camera_height_m: of the camera above the ground; 0 for unknown.
        pictures: whether one picture a second is kept beside the poses.
        tag: the tag on the robot.
        floor: tags on the ground; four at least, or none.
        lens: None before the camera is calibrated.
    """

    source: int | str = 0
    width_px: Side = 1280
    height_px: Side = 720
    rate_hz: Annotated[float, Meta(ge=1, le=1000)] = 30.0
    exposure_s: Annotated[float, Meta(ge=0, le=1)] = 0.0
    age_limit_s: AgeLimit = 0.2
    camera_height_m: NotNegative = 0.0
    pictures: bool = True
    tag: TagTable
    floor: tuple[FloorTagTable, ...] = ()
    lens: LensTable | None = None

    def __post_init__(self) -> None:
        numbers = [self.tag.id, *(each.id for each in self.floor)]
        if len(set(numbers)) < len(numbers):
            raise ValueError("two tags have the same id: give each tag, the robot's and the floor's, an id of its own")
        if 0 < len(self.floor) < _LEAST_FLOOR_TAGS:
            raise ValueError(f"floor has {len(self.floor)} tags; allowed: none, or four and more")
        if self.floor and _are_in_line(list(self.floor_m.values())):
            raise ValueError("floor has its tags in one line; allowed: tags near the corners of the picture")
        if self.camera_height_m and self.camera_height_m <= self.tag.height_m:
            raise ValueError(f"camera_height_m is {self.camera_height_m:g}; allowed: above tag.height_m")

    def located(self, folder: Path) -> Self:
        """Return the table with its film or folder as it is from here."""
        if isinstance(self.source, int) or self.source.startswith(FRAMES):
            return self
        return msgspec.structs.replace(self, source=str(folder / self.source))

    @property
    def wanted(self) -> Wanted:
        """What the camera is asked for."""
        return Wanted(self.width_px, self.height_px, self.rate_hz, self.exposure_s)

    @property
    def robot_tag(self) -> RobotTag:
        """The tag to look for."""
        return RobotTag(self.tag.id, self.tag.size_m, self.tag.height_m)

    @property
    def floor_m(self) -> dict[int, tuple[float, float]]:
        """Where the floor tags are."""
        return {each.id: (each.x_m, each.y_m) for each in self.floor}


def _are_in_line(places_m: Sequence[tuple[float, float]]) -> bool:
    """Return whether places are so nearly in one line, or in one spot, that no view follows from them."""
    away_m = np.array(places_m) - np.mean(places_m, axis=0)
    length, breadth = np.linalg.svd(away_m, compute_uv=False).tolist()
    return bool(breadth <= _LEAST_BREADTH * length)
