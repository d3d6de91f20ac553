"""What correcting is worth: the true speed of what a method recommends, corrected for the causes of scatter or not.

``gain``: from the same trials, which the method chose without correcting. ``learning``: each chooses its own trials,
under each scatter; the best gait known is the best of all that were recommended and of those that no run was told of.
Both keep the same rows, so one file serves both.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from scipy.stats import spearmanr

from benchmarks.causes.driving import SETTINGS, drive_level, known_gaits
from benchmarks.causes.rows import Row, Rows
from vvvaltr.controller.core.ask_tell import tell_history
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.loop.causes import find_loss_in
from vvvaltr.controller.loop.learn import learn
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.safety import GuardedRobot, Limits
from vvvaltr.transfer.methods.registry import make_optimizer
from vvvaltr.twin.presets import TWINS

REPEATS = 2
"""Number of drives of a recommended gait on a level floor, whose mean is its true speed: runs differ far more."""


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
    twin: str, scatter: str, method: str, seed: int, corrects: bool, looks: Sequence[int]
) -> Iterator[tuple[Optimizer, list[LoggedTrial]]]:
    """Yield the optimiser and the trials so far of one run, after each number of trials of ``looks``."""
    robot = TWINS[twin].make(seed=seed, scatter=scatter)
    optimizer, trials = make(find_space(twin), method, seed, corrects), list[LoggedTrial]()
    guarded = GuardedRobot(robot, Limits(robot.max_hz))
    for logged in learn(guarded, optimizer, SETTINGS, Budget(max(looks)), trials.append):
        if logged.score is not None and sum(it.score is not None for it in trials) in looks:
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


def follow(twin: str, scatter: str, method: str, seed: int, corrects: bool, looks: Sequence[int]) -> Row:
    """Return what a method recommends of trials that it chose: true speeds in m/s, ranks, and what was told.

    Where it does not correct, ``corrected_m_s`` and ``corrected_rank`` are what correcting makes of the same trials.
    """
    found: Row = {"rank": [], "corrected_rank": [], "suspects": [], "loss": []}
    own, corrected = list[Gait](), list[Gait]()
    for optimizer, trials in search(twin, scatter, method, seed, corrects, looks):
        own.append(optimizer.recommend().gait)
        found["rank"].append(rank(optimizer, twin))
        found["suspects"].append(sum(logged.review.is_suspect for logged in trials))
        found["loss"].append(find_loss_in(trials) is not None)
        if not corrects:
            other = make(find_space(twin), method, seed, corrects=True)
            tell_history(other, trials)
            corrected.append(other.recommend().gait)
            found["corrected_rank"].append(rank(other, twin))
    true_m_s = drive_level(twin, [*own, *corrected], REPEATS, seed + 10_000)
    return {"true_m_s": true_m_s[: len(own)], "corrected_m_s": true_m_s[len(own) :], **found}


def measure_gain(rows: Rows, arguments: Namespace) -> None:
    """Print what correcting gains from the same trials."""
    for scatter in arguments.scatters:
        runs = [_get(rows, arguments, scatter, False, seed) for seed in arguments.seeds]
        where = f"{arguments.twin} {scatter} {arguments.method}"
        for look, trials in enumerate(arguments.looks):
            of = [{name: run[name][look] for name in run if isinstance(run[name], list)} for run in runs]
            speeds = _tell_pair([(1000.0 * run["true_m_s"], 1000.0 * run["corrected_m_s"]) for run in of])
            ranks = _tell_pair([(run["rank"], run["corrected_rank"]) for run in of])
            print(f"{where}, {trials} trials, {len(runs)} runs: {speeds} mm/s; rank correlation {ranks}", flush=True)


def _get(rows: Rows, arguments: Namespace, scatter: str, corrects: bool, seed: int) -> Row:
    names = {"twin": arguments.twin, "scatter": scatter, "method": arguments.method, "seed": seed}
    names |= {"corrects": corrects, "looks": arguments.looks}
    return rows.get({"what": "learning", **names}, partial(follow, **names))


def _tell_pair(pairs: list[tuple[float, float]]) -> str:
    plain, corrected = np.array([pair for pair in pairs if np.isfinite(pair).all()]).T
    gained = corrected - plain
    error = gained.std() / math.sqrt(max(1, len(gained) - 1))
    return f"{plain.mean():.2f} as told, {corrected.mean():.2f} corrected ({gained.mean():+.2f} +- {error:.2f})"


def measure_learning(rows: Rows, arguments: Namespace) -> None:
    """Print true speeds under each scatter, corrected and not, in mm/s, and in % of the best gait known."""
    found: dict[tuple[str, bool], list[Row]] = {}
    for seed in arguments.seeds:
        for scatter in arguments.scatters:
            for corrects in (True, False):
                row = _get(rows, arguments, scatter, corrects, seed)
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
