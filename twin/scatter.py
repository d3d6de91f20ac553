"""What differs between repeats of one gait on a twin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from vvvaltr.twin.engine import Start


@dataclass(frozen=True, slots=True)
class Scatter:
    """What differs from trial to trial: standard deviations of normal distributions with mean 0.

    Args:
        place_m: deviation of the start's x and of its y.
        heading_rad: deviation of the start's yaw; the planar twin has none.
        tilt_rad: deviation of the start's pitch.
        frequency: deviation of the logarithm of each motor's actual over its commanded frequency, fixed within a trial
            (battery, load). The actual frequency still stays within the motor's limit.
        position_m: deviation of each coordinate that the tracker reads.
        angle_rad: deviation of each angle that the tracker reads.
    """

    place_m: float = 0.005
    heading_rad: float = 0.05
    tilt_rad: float = 0.02
    frequency: float = 0.10
    position_m: float = 0.0002
    angle_rad: float = 0.002

    @classmethod
    def none(cls) -> Self:
        """Return no scatter: all trials of a gait are the same."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def draw_start(self, random: np.random.Generator) -> Start:
        """Draw how the robot is put down."""
        return Start(*(random.normal(0.0, [self.place_m, self.place_m, self.heading_rad, self.tilt_rad]).tolist()))
