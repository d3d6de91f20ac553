"""Standing trials told by repeats alone: repeats of one gait, some of which stand still, as a laboratory's robot does.

A trial in five stands, with 5 to 10 % of the speed. What counts as far below is varied, which gives the ROC.
"""

from __future__ import annotations

from argparse import Namespace
from functools import partial

import numpy as np

from benchmarks.causes.rows import Row, Rows
from vvvaltr.controller.core.streams import stream
from vvvaltr.transfer.causes.standing import find_standing

SHARES = (0.15, 0.2, 0.3, 0.4, 0.5, 0.6)
"""Speeds, over that of the moving trials, below which a trial is taken for standing; 0.3 is what is used."""


def repeat(cv: float, trials: int, seed: int) -> Row:
    """Return how many standing trials, and how many moving ones, were taken for standing, by share."""
    random = stream(seed, trials, f"standing {cv}")
    stands = random.random(trials) < 0.2
    speeds = np.where(stands, random.uniform(0.05, 0.1, trials), np.abs(random.normal(1.0, cv, trials)))
    called = np.array([find_standing(speeds.tolist(), share) for share in SHARES])
    return {
        "stood": int(stands.sum()), "found": called[:, stands].sum(axis=1).tolist(), "moved": int((~stands).sum()),
        "false": called[:, ~stands].sum(axis=1).tolist(),
    }  # fmt: skip


def measure(rows: Rows, arguments: Namespace) -> None:
    """Print hits and false alarms by the coefficient of variation, the number of repeats, and the share."""
    for cv in (0.1, 0.2, 0.3, 0.4):
        for trials in (5, 10, 20):
            names = {"what": "standing", "cv": cv, "trials": trials}
            runs = [rows.get({**names, "seed": seed}, partial(repeat, cv, trials, seed)) for seed in arguments.seeds]
            stood, moved = sum(run["stood"] for run in runs), sum(run["moved"] for run in runs)
            found, false = (np.sum([run[what] for run in runs], axis=0) for what in ("found", "false"))
            rates = [f"{share:g}: {hits / stood:.1%}, {alarms / moved:.2%}"
                     for share, hits, alarms in zip(SHARES, found, false, strict=True)]  # fmt: skip
            print(f"CV {cv}, {trials} repeats, {stood} stood, {moved} moved; found, false: {'; '.join(rates)}")
