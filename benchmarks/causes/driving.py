"""Drives of the twins that several parts share: how they are made, and how fast a gait truly is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.twin.presets import TWINS
from vvvaltr.twin.scatter import parse_scatter

SETTINGS = TrialSettings(duration_s=5.0)


def drive_level(twin: str, gaits: Sequence[Gait], repeats: int, seed: int) -> list[float]:
    """Return the true speed of each gait in m/s: on a level floor, from fresh starts, all motors at full strength.

    The small errors of the start are those of ``hurried``, whatever the scatter of the run.
    """
    preset = TWINS[twin]
    robot = preset.make(seed=seed, scatter=parse_scatter("hurried", preset.frequency_scatter).level())
    speeds: dict[Gait, float] = {}
    for gait in dict.fromkeys(gaits):
        trials = [run_trial(robot, gait, SETTINGS, number) for number in range(1, repeats + 1)]
        valid = [score(trial) for trial in trials if trial.outcome.is_valid]
        speeds[gait] = float(np.mean(valid)) if valid else math.nan
    return [speeds[gait] for gait in gaits]


@cache
def known_gaits(twin: str) -> tuple[list[Gait], list[float]]:
    """Return gaits that no run is told of, and their true speeds: what a model's ranking is judged by."""
    high_hz = TWINS[twin].make().range_hz[1]
    random = stream(0, 0, "known gaits")
    gaits = [Gait(tuple(random.uniform(-high_hz, high_hz, 3))) for _ in range(30)]
    return gaits, drive_level(twin, gaits, 1, seed=9_999)
