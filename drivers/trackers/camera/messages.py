"""What the process that looks through the camera tells the controller: one JSON object a line."""

from __future__ import annotations

import msgspec


class Message(msgspec.Struct, frozen=True, tag=True):
    """A line."""


class Ready(Message, frozen=True):
    """The source is open, and the view known.

    Args:
        width_px, height_px: size of the pictures.
        rate_hz: pictures per second, as the camera says.
        exposure_s: as the camera says; 0 where it does not.
        camera_height_m: above the ground.
        floor_error_m: how far the floor tags are from their places, root mean square; 0 without floor tags.
    """

    width_px: int
    height_px: int
    rate_hz: float
    exposure_s: float
    camera_height_m: float
    floor_error_m: float


class Refused(Message, frozen=True):
    """Nothing was started: why, and the cure."""

    reason: str


class Seen(Message, frozen=True):
    """The robot in a picture that was taken at ``t_s``, as ``time.monotonic()`` counts."""

    t_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    uncertainty_m: float


class Unseen(Message, frozen=True):
    """No trustworthy robot in a picture that was taken at ``t_s``."""

    t_s: float
    reason: str
    cure: str = ""


class Kept(Message, frozen=True):
    """A picture, as JPEG, to be kept beside the poses."""

    t_s: float
    jpeg: bytes


class Ended(Message, frozen=True):
    """There are no more pictures: why."""

    reason: str


News = Ready | Refused | Seen | Unseen | Kept | Ended
