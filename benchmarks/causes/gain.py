"""What correcting is worth: the true speed of what a method recommends, corrected for the causes of scatter or not.

``gain``: from the same trials, which the method chose without correcting. ``learning``: each chooses its own trials,
under each scatter; the best gait known is the best of all that were recommended and of those that no run was told of.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.stats import spearmanr

from benchmarks.causes.driving import SETTINGS, drive_level, known_gaits
from benchmarks.causes.rows import Row, Rows
from vvvaltr.controller.core.ask_tell import tell_history
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Gait, GaitSpace
from vvvaltr.controller.loop.causes import find_loss_in
from vvvaltr.controller.loop.learn import learn
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.safety import GuardedRobot, Limits
from vvvaltr.transfer.methods.registry import make_optimizer
from vvvaltr.twin.presets import TWINS

LOOKS = (20, 40)
REPEATS = 4
"""Number of drives of a recommended gait on a level floor, whose mean is its true speed."""


class AsTold:
    """``Optimizer``: one that is told scores alone, and so corrects nothing."""

    def __init__(self, inner: Optimizer) -> None:
        self.ask, self.tell, self.recommend = inner.ask, inner.tell, inner.recommend
        self.predict, self.promising, self.improvement = inner.predict, inner.promising, inner.improvement


def make(space: GaitSpace, method: str, seed: int, corrects: bool) -> Optimizer:
    """Return a method that corrects for the causes of scatter, or does not."""
    optimizer = make_optimizer(method, space, seed)
    return optimizer if corrects else AsTold(optimizer)


def search(
    twin: str, scatter: str, method: str, seed: int, corrects: bool
) -> Iterator[tuple[Optimizer, list[LoggedTrial]]]:
    """Yield the optimiser and the trials so far of one run, at each of ``LOOKS``."""
    robot = TWINS[twin].make(seed=seed, scatter=scatter)
    optimizer, trials = make(find_space(twin), method, seed, corrects), list[LoggedTrial]()
    guarded = GuardedRobot(robot, Limits(robot.max_hz))
    for logged in learn(guarded, optimizer, SETTINGS, Budget(max(LOOKS)), trials.append):
        if logged.score is not None and sum(it.score is not None for it in trials) in LOOKS:
            yield optimizer, trials


def find_space(twin: str) -> GaitSpace:
    """Return the gaits of a twin, in both senses of rotation."""
    robot = TWINS[twin].make()
    return GaitSpace.over(robot.motors.motor_count, -robot.range_hz[1], robot.range_hz[1])


def rank(optimizer: Optimizer, twin: str) -> float:
    """Return the rank correlation of a model with the true speeds of gaits that it was not told of."""
    gaits, true_m_s = known_gaits(twin)
    expected = [estimate.mean for estimate in optimizer.predict(gaits)]
    return float(spearmanr(expected, true_m_s, nan_policy="omit").statistic)


def compare(twin: str, scatter: str, method: str, seed: int) -> Row:
    """Return what a method makes of the same trials, not corrected and corrected: true speeds in m/s, and ranks."""
    gaits: dict[str, list[Gait]] = {"plain": [], "corrected": []}
    ranks: dict[str, list[float]] = {"plain": [], "corrected": []}
    for optimizer, trials in search(twin, scatter, method, seed, corrects=False):
        corrected = make(find_space(twin), method, seed, corrects=True)
        tell_history(corrected, trials)
        for name, each in (("plain", optimizer), ("corrected", corrected)):
            gaits[name].append(each.recommend().gait)
            ranks[name].append(rank(each, twin))
    true_m_s = {name: drive_level(twin, each, REPEATS, seed + 10_000) for name, each in gaits.items()}
    return {"true_m_s": true_m_s, "rank": ranks}


def follow(twin: str, scatter: str, method: str, seed: int, corrects: bool) -> Row:
    """Return what a method recommends of trials that it chose: true speeds in m/s, ranks, and what was told."""
    found: Row = {"rank": [], "suspects": [], "loss": []}
    gaits = list[Gait]()
    for optimizer, trials in search(twin, scatter, method, seed, corrects):
        gaits.append(optimizer.recommend().gait)
        found["rank"].append(rank(optimizer, twin))
        found["suspects"].append(sum(logged.review.is_suspect for logged in trials))
        found["loss"].append(find_loss_in(trials) is not None)
    return {"true_m_s": drive_level(twin, gaits, REPEATS, seed + 10_000), **found}


def measure_gain(rows: Rows, arguments: Namespace) -> None:
    """Print what correcting gains from the same trials."""
    for scatter in arguments.scatters:
        names = {"what": "gain", "twin": arguments.twin, "scatter": scatter, "method": arguments.method}
        task = partial(compare, arguments.twin, scatter, arguments.method)
        runs = [rows.get({**names, "seed": seed}, partial(task, seed)) for seed in arguments.seeds]
        for look, trials in enumerate(LOOKS):
            told = [
                _tell_pair([[run[what][name][look] for run in runs] for name in ("plain", "corrected")], unit)
                for what, unit in (("true_m_s", 1000.0), ("rank", 1.0))
            ]
            where = f"{arguments.twin} {scatter} {arguments.method}, {trials} trials, {len(runs)} runs"
            print(f"{where}: {told[0]} mm/s; rank correlation {told[1]}", flush=True)


def _tell_pair(pair: list[list[float]], unit: float) -> str:
    plain, corrected = unit * np.array(pair)
    known = np.isfinite(plain) & np.isfinite(corrected)
    plain, corrected = plain[known], corrected[known]
    gained = corrected - plain
    error = gained.std() / math.sqrt(max(1, len(gained) - 1))
    return f"{plain.mean():.2f} as told, {corrected.mean():.2f} corrected ({gained.mean():+.2f} +- {error:.2f})"


def measure_learning(rows: Rows, arguments: Namespace) -> None:
    """Print true speeds under each scatter, corrected and not, in mm/s, and in % of the best gait known."""
    names = {"what": "learning", "twin": arguments.twin, "method": arguments.method}
    found: dict[tuple[str, bool], list[Row]] = {}
    for seed in arguments.seeds:
        for scatter in arguments.scatters:
            for corrects in (True, False):
                task = partial(follow, arguments.twin, scatter, arguments.method, seed, corrects)
                row = rows.get({**names, "scatter": scatter, "corrects": corrects, "seed": seed}, task)
                found.setdefault((scatter, corrects), []).append(row)
    speeds = {key: 1000.0 * np.array([run["true_m_s"] for run in runs]) for key, runs in found.items()}
    known = [1000.0 * np.nanmax(known_gaits(arguments.twin)[1]), *(float(np.nanmax(of)) for of in speeds.values())]
    for (scatter, corrects), of in speeds.items():
        mean, error = np.nanmean(of, axis=0), np.nanstd(of, axis=0) / math.sqrt(max(1, len(of) - 1))
        told = " and ".join(
            f"{m:.2f} +- {e:.2f} ({m / max(known):.0%} of the best)" for m, e in zip(mean, error, strict=True)
        )
        ranks = " and ".join(f"{it:.2f}" for it in np.mean([run["rank"] for run in found[scatter, corrects]], axis=0))
        how = "corrected" if corrects else "as told"
        where = f"{arguments.twin} {scatter} {arguments.method} {how}, {len(of)} runs"
        print(f"{where}: {told} mm/s; rank correlation {ranks}", flush=True)
