"""What a trial was made under, beside the gait: the causes of scatter that can be written down."""

from __future__ import annotations

import math
from dataclasses import dataclass

GREATEST_SPEED_M_S = 5.0
"""Greatest speed that is taken for a measurement, wherever it comes from: fifty times that of the fastest gaits."""


def check_finite(**numbers: float | None) -> None:
    """Raise ValueError, naming the field, if a number is not finite; None stands for a number that is not known."""
    for name, number in numbers.items():
        if number is not None and not math.isfinite(number):
            raise ValueError(f"{name} is {number}, which is not a finite number")


def check_speed(speed_m_s: float, where: str) -> None:
    """Raise ValueError, naming ``where`` it was found, for a speed that no such robot can have; NaN is none."""
    if not abs(speed_m_s) <= GREATEST_SPEED_M_S:
        raise ValueError(
            f"{where}: a speed of {speed_m_s:.3g} m/s is not plausible (limit {GREATEST_SPEED_M_S:g} m/s); "
            "check the unit of the positions"
        )


@dataclass(frozen=True, slots=True)
class Conditions:
    """Readings taken during one trial. None means that nobody measured it.

    Args:
        session_s: time since the robot was switched on or its session began, at the start of the trial.
        battery_v: voltage of the battery at the start of the trial.
        battery_changed: whether the battery was changed or charged since the trial before.
        dropped_poses: poses that were left out because the robot cannot have been there.
        tracker_offset_s: the tracker's clock minus the robot's.
        tracker_jitter_s: standard deviation of the poses' age on arrival.

    Raises:
        ValueError: a number is not finite, or the count is negative.
    """

    session_s: float | None = None
    battery_v: float | None = None
    battery_changed: bool = False
    dropped_poses: int = 0
    tracker_offset_s: float | None = None
    tracker_jitter_s: float | None = None

    def __post_init__(self) -> None:
        check_finite(
            session_s=self.session_s,
            battery_v=self.battery_v,
            tracker_offset_s=self.tracker_offset_s,
            tracker_jitter_s=self.tracker_jitter_s,
        )
        if self.dropped_poses < 0:
            raise ValueError(f"dropped_poses is {self.dropped_poses}; allowed: 0 or more")
