"""Where the robot lies at rest, and how certain that is."""

from __future__ import annotations

from dataclasses import dataclass

from vvvaltr.controller.core.conditions import check_finite


@dataclass(frozen=True, slots=True)
class RestingPose:
    """Where the robot lies before or after a drive, in the world's frame, and how certain that is.

    Args:
        position_m: x, y, z of the robot's centre.
        yaw_rad, pitch_rad, roll_rad: intrinsic z-y'-x'' angles, as in ``Pose``.
        position_sd_m: standard error of x and of y; None where it is not known.
        yaw_sd_rad: standard error of the yaw; None where it is not known.
        face: the side on which the robot lies, counted from 1; 0 where it is not known.

    Raises:
        ValueError: a number is not finite.
    """

    position_m: tuple[float, float, float]
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    position_sd_m: float | None = None
    yaw_sd_rad: float | None = None
    face: int = 0

    def __post_init__(self) -> None:
        check_finite(**dict(zip(("x_m", "y_m", "z_m"), self.position_m, strict=True)))
        check_finite(yaw_rad=self.yaw_rad, pitch_rad=self.pitch_rad, roll_rad=self.roll_rad)
        check_finite(position_sd_m=self.position_sd_m, yaw_sd_rad=self.yaw_sd_rad)
