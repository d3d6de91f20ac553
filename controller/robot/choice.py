"""Which robot, and in which condition: what `--robot` and its neighbours choose, and `run.toml` keeps."""

from __future__ import annotations

from typing import Any

import msgspec

_OPTIONS = {
    "name": "--robot",
    "gravity_m_s2": "--gravity",
    "tracker_noise_m": "--tracker-noise",
    "heading_limit_rad": "--heading-limit",
    "sources": "--source",
    "duration_s": "--duration",
    "range_hz": "--range",
    "reference_hz": "--reference",
    "reference_every": "--reference",
    "stop_below_m_s": "--stop-when",
}


class RobotChoice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The robot and, for a twin, its condition.

    Args:
        name: ``planar`` or ``spatial``, or the path of the robot's file.
        body: the twin's body.
        law: the force law of its motors, ``eccentric`` or ``constant``.
        world: the ground, as on the command line: ``flat``, ``hills:height_m=0.006``.
        gravity_m_s2: gravity.
        friction: friction coefficient of the ground.
        damage: what is broken, as on the command line: ``snap:4,18``.
        scatter: what differs from trial to trial, as on the command line: ``careful``; None in a run of version 0.1,
            whose scatter is ``frequency``.
        tracker_noise_m: standard deviation of each coordinate that the tracker reads; None for the usual one.
        file: the contents of the robot's file; None for a twin.
    """

    name: str = "planar"
    body: str | None = None
    law: str | None = None
    world: str | None = None
    gravity_m_s2: float | None = None
    friction: float | None = None
    damage: tuple[str, ...] | None = None
    scatter: str | None = None
    tracker_noise_m: float | None = None
    file: dict[str, Any] | None = None

    @property
    def is_twin(self) -> bool:
        """Whether the robot is a simulated one."""
        return self.file is None


def option(key: str) -> str:
    """Return the command line's option for a key of RunConfig or RobotChoice."""
    return _OPTIONS.get(key, f"--{key}")
