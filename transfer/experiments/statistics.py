"""Statistics of repeats with paired seeds: pure functions on arrays of one value per repeat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array

RESAMPLES, PERMUTATIONS = 10_000, 4_000
"""Numbers of random draws: of bootstrap and of chance, and of permutation tests."""


@dataclass(frozen=True, slots=True)
class Interval:
    """A central 95 % interval."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Gain:
    """Excess of a method's mean over a baseline's in percent, with its 95 % interval as in ``Comparison``."""

    gain_percent: float
    interval_percent: Interval | None


@dataclass(frozen=True, slots=True)
class Comparison:
    """A method compared with Plain-BO.

    Args:
        gain_percent: excess of the method's mean over Plain-BO's.
        interval_percent: 95 % interval of the gain, by bootstrap over repeats; None for a single repeat.
        p: two-sided p, see ``signed_rank_p``; not corrected for the number of methods.
        effect: matched-pairs rank-biserial correlation, averaged over Plain-BO's replicates, see ``rank_biserial``.
        chance: probability that Plain-BO against itself gains as much, see ``chance_of_as_much``; 1 for a gain of 0.
    """

    gain_percent: float
    interval_percent: Interval | None
    p: float
    effect: float
    chance: float


def compare(method: Array, plain: Array, random: np.random.Generator) -> Comparison:
    """Compare a method with Plain-BO.

    Args:
        method: values of the method, (repeats,).
        plain: values of Plain-BO, (repeats, replicates).
        random: random stream of the resampling.
    """
    baseline = plain.mean(axis=1)
    gain = gain_percent(method, baseline)
    return Comparison(
        gain,
        gain_interval(method, baseline, random),
        signed_rank_p(method, plain, random),
        float(rank_biserial(method - plain.T).mean()),
        chance_of_as_much(gain, plain, random),
    )


def measure_gain(method: Array, baseline: Array, random: np.random.Generator) -> Gain:
    """Return the gain of a method's values (repeats,) over a baseline's (repeats,), whose repeats are paired."""
    return Gain(gain_percent(method, baseline), gain_interval(method, baseline, random))


def gain_percent(method: Array, baseline: Array) -> float:
    """Return by how many percent the method's mean (repeats,) exceeds the baseline's (repeats,)."""
    return 100.0 * float(method.mean() / baseline.mean() - 1.0)


def gain_interval(method: Array, baseline: Array, random: np.random.Generator) -> Interval | None:
    """Return the 95 % interval of the gain: percentiles over resampled repeats, with pairs kept together."""
    if len(method) < 2:
        return None
    picks = random.integers(len(method), size=(RESAMPLES, len(method)))
    gains = 100.0 * (method[picks].mean(axis=1) / baseline[picks].mean(axis=1) - 1.0)
    low, high = np.percentile(gains, [2.5, 97.5])
    return Interval(float(low), float(high))


def signed_rank_p(method: Array, plain: Array, random: np.random.Generator) -> float:
    """Return the two-sided p of Wilcoxon's signed ranks of the method against all replicates of Plain-BO.

    If the method were no better than Plain-BO, it could change places with any other run of its repeat. p is the share
    of such permutations in which the ranks, summed over the replicates, are at least as one-sided (Fisher's permutation
    test). The usual table of Wilcoxon's test does not apply: one run minus the mean of several is skewed where runs are
    skewed, even without any difference.

    Args:
        method: values of the method, (repeats,).
        plain: values of Plain-BO, (repeats, replicates).
        random: random stream of the permutations.
    """
    runs = np.column_stack([method, plain])
    repeats, size = runs.shape
    others = np.array([np.delete(np.arange(size), player) for player in range(size)])
    players = random.integers(size, size=(PERMUTATIONS, repeats))
    players[0] = 0  # what was observed
    rows = np.arange(repeats)
    differences = runs[rows, players][..., None] - runs[rows[:, None], others[players]]
    one_sided = np.abs(rank_biserial(np.moveaxis(differences, -1, 1)).mean(axis=1))
    return float(np.mean(one_sided >= one_sided[0] - 1e-12))


def rank_biserial(differences: Array) -> Array:
    """Return the share of ranks in favour minus the share against, from -1 to 1, over the last axis.

    This is the effect size of Wilcoxon's test: D. S. Kerby, "The simple difference formula", Comprehensive Psychology 3
    (2014). The rank of a difference of 0 counts for neither side (Pratt 1959).
    """
    from scipy.stats import rankdata

    ranks = np.where(differences == 0.0, 0.0, rankdata(np.abs(differences), axis=-1))
    return np.asarray((np.sign(differences) * ranks).sum(axis=-1) / np.maximum(ranks.sum(axis=-1), 1.0))


def holm(p_values: Sequence[float]) -> list[float]:
    """Return the p-values corrected for their number, after S. Holm, Scandinavian Journal of Statistics 6 (1979)."""
    corrected = [0.0] * len(p_values)
    worst = 0.0
    for rank, index in enumerate(sorted(range(len(p_values)), key=lambda i: p_values[i])):
        worst = max(worst, min(1.0, (len(p_values) - rank) * p_values[index]))
        corrected[index] = worst
    return corrected


def chance_of_as_much(gain: float, plain: Array, random: np.random.Generator) -> float:
    """Return how often Plain-BO against itself gains at least as much as ``gain``, in the same direction.

    In each repeat, one replicate drawn at random plays the method, and the mean of the others is the baseline. This
    scatters a little more than a method against all replicates, so the chance is slightly overestimated.

    Args:
        gain: gain in percent.
        plain: values of Plain-BO, (repeats, replicates), at least two replicates.
        random: random stream that draws the replicates.
    """
    repeats, replicates = plain.shape
    players = random.integers(replicates, size=(RESAMPLES, repeats))
    played = plain[np.arange(repeats), players]
    baseline = (plain.sum(axis=1) - played) / (replicates - 1)
    gains = 100.0 * (played.mean(axis=1) / baseline.mean(axis=1) - 1.0)
    return float(np.mean(gains >= gain if gain > 0.0 else gains <= gain)) if gain else 1.0


def mean_interval(values: Array) -> tuple[Array, Array]:
    """Return the 95 % interval (low, high) of the mean over the first axis, by Student's t; NaN for one repeat."""
    from scipy.stats import t

    if len(values) < 2:
        return np.full(values.shape[1:], np.nan), np.full(values.shape[1:], np.nan)
    half = t.ppf(0.975, len(values) - 1) * values.std(axis=0, ddof=1) / np.sqrt(len(values))
    return values.mean(axis=0) - half, values.mean(axis=0) + half


def trials_to_level(best_so_far: Array, level: float) -> float:
    """Return the median over runs (runs, trials) of the first trial at which the best so far reaches ``level``.

    It is infinite where more than half of the runs never do.
    """
    reached = best_so_far >= level
    first = np.where(reached.any(axis=1), reached.argmax(axis=1) + 1.0, np.inf)
    # The lower of the two middle values: a number and infinity have no mean.
    return float(np.sort(first)[(len(first) - 1) // 2])
