"""What a campaign found, from its results: per experiment and method, against Plain-BO."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count, takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.streams import stream
from vvvaltr.transfer.experiments.campaign import PairUnits, list_transfer_methods, plan_checkpoints, plan_units
from vvvaltr.transfer.experiments.statistics import (
    Comparison,
    Gain,
    Interval,
    compare,
    holm,
    measure_gain,
    trials_to_level,
)
from vvvaltr.transfer.experiments.store import Store
from vvvaltr.transfer.experiments.thesis import Pair, list_pairs
from vvvaltr.transfer.experiments.unit import Result, Step, Unit

NO_DIFFERENCE = Comparison(0.0, Interval(0.0, 0.0), 1.0, 0.0, 1.0)
"""Comparison of Plain-BO with itself."""


@dataclass(frozen=True, slots=True)
class Runs:
    """All runs of a method: one or several (replicates) per repeat.

    Args:
        true_m_s: true mean speed of the recommended gait, (repeats, replicates, checkpoints).
        best_m_s: best observed score so far, as the thesis plots it, (repeats, replicates, trials).
        covered: whether the final interval holds the true mean speed as measured, (repeats, replicates).
        covered_within_error: the same, allowing for the error of that measurement, see ``holds``.
    """

    true_m_s: Array
    best_m_s: Array
    covered: NDArray[np.bool_]
    covered_within_error: NDArray[np.bool_]

    @classmethod
    def of(cls, repeats: Sequence[Sequence[Result]]) -> Runs:
        """Return the runs of all repeats."""
        ends = [[(run.steps[-1], run.truths[-1]) for run in runs] for runs in repeats]
        return cls(
            np.array([[[truth.mean_m_s for truth in run.truths] for run in runs] for runs in repeats]),
            np.array([[np.maximum.accumulate([step.score_m_s for step in run.steps]) for run in runs]
                      for runs in repeats]),
            np.array([[holds(step, truth.mean_m_s) for step, truth in runs] for runs in ends]),
            np.array([[holds(step, truth.mean_m_s, truth.standard_error_m_s) for step, truth in runs]
                      for runs in ends]),
        )  # fmt: skip

    @property
    def mean_true_m_s(self) -> Array:
        """True mean speed of the recommended gait, averaged over all runs, (checkpoints,)."""
        return np.asarray(self.true_m_s.mean(axis=(0, 1)))


def holds(step: Step, true_m_s: float, standard_error_m_s: float = 0.0) -> bool:
    """Return whether the interval of the recommended gait holds the true speed.

    The true speed itself is a measurement with a standard error s. To allow for it, the interval's half width h towards
    the true speed becomes sqrt(h^2 + (1.96 s)^2).

    Args:
        step: recommendation with its 95 % interval.
        true_m_s: true speed as measured.
        standard_error_m_s: standard error s; 0 to take the measurement as exact.
    """
    bound_m_s = step.high_m_s if true_m_s > step.mean_m_s else step.low_m_s
    reach_m_s = math.hypot(bound_m_s - step.mean_m_s, 1.96 * standard_error_m_s)
    return abs(true_m_s - step.mean_m_s) <= reach_m_s


@dataclass(frozen=True, slots=True)
class MethodFindings:
    """The findings on one method in an experiment.

    Args:
        runs: runs of the method.
        against_plain: comparison of the true speed with Plain-BO's, at each checkpoint.
        p_holm: p of each of these comparisons, corrected for the number of methods.
        best_against_plain: comparison of the best observed score at the end, the thesis' measure.
        trials_to_plain_level: trials until ``plain_level_m_s`` is reached, see ``statistics.trials_to_level``.
        over_drive: gain in true speed over ``drive``, at each checkpoint; none where ``drive`` was not run.
    """

    runs: Runs
    against_plain: tuple[Comparison, ...]
    p_holm: tuple[float, ...]
    best_against_plain: Comparison
    trials_to_plain_level: float
    over_drive: tuple[Gain, ...]


@dataclass(frozen=True, slots=True)
class PairFindings:
    """The findings of an experiment.

    Args:
        pair: the experiment.
        repeats: number of complete repeats.
        checkpoints: checkpoints in trials; the last one is the end.
        methods: findings on each method by name; ``plain`` comes first.
        source_runs: runs on the source, one per repeat.
        target_runs: first run of Plain-BO on the target, one per repeat.
    """

    pair: Pair
    repeats: int
    checkpoints: tuple[int, ...]
    methods: Mapping[str, MethodFindings]
    source_runs: tuple[Result, ...]
    target_runs: tuple[Result, ...]

    @property
    def plain(self) -> MethodFindings:
        """The findings on Plain-BO."""
        return self.methods["plain"]

    def checkpoint_names(self) -> tuple[str, ...]:
        """Return the checkpoints as the command line's JSON calls them; the last one is ``end``."""
        return (*map(str, self.checkpoints[:-1]), "end")


def gather_findings(store: Store, chosen: Sequence[Pair] = ()) -> tuple[PairFindings, ...]:
    """Return the findings so far, in order, of every experiment with at least one complete repeat.

    A repeat is complete when the runs of Plain-BO and of every method that has been started are done; at least one has.

    Args:
        store: campaign on disk.
        chosen: experiments to look at; all that have been started if none are given.
    """
    every = list_pairs(store.settings.robot)
    looked_at = chosen or [pair for pair in every if _is_begun(store, pair)] or every
    found = (_gather_pair(store, pair) for pair in looked_at)
    return tuple(it for it in found if it is not None)


def _is_begun(store: Store, pair: Pair) -> bool:
    """Return whether a run has learned from the pair's source: all other runs may belong to another pair as well."""
    return any(
        unit.source and store.has(unit)
        for unit in plan_units(pair, store.settings, 1, list_transfer_methods()).methods.values()
    )


def _gather_pair(store: Store, pair: Pair) -> PairFindings | None:
    first = plan_units(pair, store.settings, 1, list_transfer_methods())
    methods = [name for name, unit in first.methods.items() if store.has(unit)]
    complete = _list_complete_repeats(store, pair, methods)
    if not methods or not complete:
        return None
    afters = plan_checkpoints(pair, store.settings)

    def result(unit: Unit) -> Result:
        return store.load(unit).until(afters)

    plain = [[result(unit) for unit in units.plain] for units in complete]
    runs = {"plain": Runs.of(plain)} | {
        name: Runs.of([[result(units.methods[name])] for units in complete]) for name in methods
    }
    return PairFindings(
        pair,
        len(complete),
        afters,
        _compare_methods(runs, stream(store.settings.seed, 0, f"statistics of {pair.key}")),
        tuple(result(units.source) for units in complete),
        tuple(replicates[0] for replicates in plain),
    )


def _list_complete_repeats(store: Store, pair: Pair, methods: Sequence[str]) -> list[PairUnits]:
    def is_complete(units: PairUnits) -> bool:
        return all(map(store.has, (units.source, *units.plain, *units.methods.values())))

    return list(takewhile(is_complete, (plan_units(pair, store.settings, repeat, methods) for repeat in count(1))))


def _compare_methods(runs: Mapping[str, Runs], random: np.random.Generator) -> dict[str, MethodFindings]:
    plain = runs["plain"]
    level = plain_level_m_s(plain)
    columns = range(plain.true_m_s.shape[2])
    rivals = [name for name in runs if name != "plain"]

    def against_plain(name: str, values: Array, plain_values: Array) -> Comparison:
        return compare(values[:, 0], plain_values, random) if name in rivals else NO_DIFFERENCE

    true = {
        name: tuple(against_plain(name, it.true_m_s[:, :, i], plain.true_m_s[:, :, i]) for i in columns)
        for name, it in runs.items()
    }
    over_drive = _gains_over_drive(runs, random)
    corrected = [dict(zip(rivals, holm([true[name][i].p for name in rivals]), strict=True)) for i in columns]
    return {
        name: MethodFindings(
            it,
            true[name],
            tuple(of_methods.get(name, 1.0) for of_methods in corrected),
            against_plain(name, it.best_m_s[:, :, -1], plain.best_m_s[:, :, -1]),
            trials_to_level(it.best_m_s.reshape(-1, it.best_m_s.shape[2]), level),
            over_drive.get(name, ()),
        )
        for name, it in runs.items()
    }


def _gains_over_drive(runs: Mapping[str, Runs], random: np.random.Generator) -> dict[str, tuple[Gain, ...]]:
    """Return the gains of all other methods: what a source gives beyond knowing that more drive moves more."""
    if "drive" not in runs:
        return {}
    true = {name: it.true_m_s.mean(axis=1).T for name, it in runs.items()}
    drive = true.pop("drive")
    return {
        name: tuple(measure_gain(ours, theirs, random) for ours, theirs in zip(values, drive, strict=True))
        for name, values in true.items()
    }


def plain_level_m_s(plain: Runs) -> float:
    """Return the level that Plain-BO ends at: the final best observed score of its median run."""
    return float(np.median(plain.best_m_s[:, :, -1]))


def as_json(found: Sequence[PairFindings]) -> dict[str, Any]:
    """Return the findings as plain data, keyed by experiment. A level that is never reached is None."""
    return {
        it.pair.key: {
            "methods": {name: _method_json(it, method) for name, method in it.methods.items()},
            "repeats": it.repeats,
        }
        for it in found
    }


def _method_json(pair: PairFindings, found: MethodFindings) -> dict[str, Any]:
    names, end = pair.checkpoint_names(), found.against_plain[-1]
    return {
        "true_m_s": dict(zip(names, found.runs.mean_true_m_s.tolist(), strict=True)),
        "final_best_m_s": float(found.runs.best_m_s[:, :, -1].mean()),
        "gain_over_plain_percent": end.gain_percent,
        "trials_to_plain_level": int(found.trials_to_plain_level)
        if math.isfinite(found.trials_to_plain_level)
        else None,
        "p": found.p_holm[-1],
        "effect": end.effect,
        "interval_coverage_percent": 100.0 * float(found.runs.covered.mean()),
        "interval_coverage_within_error_percent": 100.0 * float(found.runs.covered_within_error.mean()),
        "over_drive": {
            name: {
                "gain_percent": it.gain_percent,
                "interval_percent": _bounds(it.interval_percent),
            }
            for name, it in zip(names, found.over_drive, strict=bool(found.over_drive))
        },
        "against_plain": {
            name: {
                "gain_percent": it.gain_percent,
                "interval_percent": _bounds(it.interval_percent),
                "p": p,
                "effect": it.effect,
                "chance_plain_shows_as_much": it.chance,
            }
            for name, it, p in zip(names, found.against_plain, found.p_holm, strict=True)
        },
    }


def _bounds(interval: Interval | None) -> list[float] | None:
    return None if interval is None else [interval.low, interval.high]
