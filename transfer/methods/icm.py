"""ICM: one Gaussian process of all tasks, with a learned correlation of each source to the target.

The intrinsic coregionalisation model of Bonilla, Chai and Williams, "Multi-task Gaussian process prediction", NIPS
2007; for Bayesian optimisation Swersky, Snoek and Adams, "Multi-task Bayesian optimization", NIPS 2013.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.bayes.belief import Belief, refit
from vvvaltr.transfer.bayes.earlier_run import EarlierRun, learn_sources, propose_best
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import Observations
from vvvaltr.transfer.bayes.proposal import begin_with
from vvvaltr.transfer.bayes.refitting import Conditioned, Fitted, follow
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.methods.method import Method

CORRELATIONS = np.tanh(np.linspace(-2.0, 2.0, 17))
"""Correlations that a source may have with the target, closer together near -1 and 1, where a little matters more."""


class ICM(Search):
    """A Gaussian process over gait and task: cov(f_s(x), f_t(x')) = B_st k(x, x').

    Each task is standardised by itself, so B is a matrix of correlations. It has one parameter r for each source, its
    correlation with the target; two sources resemble each other only as far as both resemble the target:
    B_st = r_s r_t for s != t, with r = 1 for the target. At every fit each r is set to its most probable value of 17
    between -0.96 and 0.96, given the other hyperparameters. A score can only be standardised beside others, so the
    first trials are the sources' best gaits.

    Args:
        space: gaits to search.
        seed: seed of every random stream.
        sources: earlier runs, at least one.

    Raises:
        ValueError: there is no source, or one has another number of motors than the space.
    """

    def __init__(self, space: GaitSpace, seed: int, sources: Sequence[Source]) -> None:
        runs = learn_sources(space, seed, sources)
        super().__init__(space, seed, partial(learn_jointly, space, runs), begin_with(propose_best(runs)))


def learn_jointly(
    space: GaitSpace, runs: Sequence[EarlierRun], trials: Trials, last: Fitted | None, rng: np.random.Generator
) -> Belief:
    """Return what one or more trials of the target and the sources' trials say together, in one process."""
    scale = Scale.of(trials.scores)
    names = [f"source_{i}_correlation" for i in range(1, len(runs) + 1)]
    correlations = np.array([0.0 if last is None else last.learned[name] for name in names])
    fitted = follow(
        trials,
        last,
        lambda rows: couple(runs, rows, scale, correlations),
        partial(refit, trials=len(trials), rng=rng),
    )
    if fitted.is_of(len(trials)) and not (last and last.is_of(len(trials))):
        correlations, process = correlate(runs, scale, fitted, correlations)
        fitted = replace(fitted, process=process, learned=dict(zip(names, correlations.tolist(), strict=True)))
    belief = Belief.of(fitted.process, scale, space, fitted)
    return replace(belief, seen=fitted.rows.x, hyperparameters={**belief.hyperparameters, **fitted.learned})


def correlate(
    runs: Sequence[EarlierRun], scale: Scale, fitted: Conditioned, correlations: Array
) -> tuple[Array, GaussianProcess]:
    """Return the correlation (sources,) of each source set to its most probable value, one by one, and the process."""
    process = fitted.process
    for i in range(len(runs)):
        choices = [np.where(np.arange(len(runs)) == i, r, correlations) for r in CORRELATIONS]
        processes = [
            GaussianProcess.condition(couple(runs, fitted.rows, scale, choice), fitted.hyperparameters)
            for choice in choices
        ]
        best = int(np.argmax([process.log_evidence() for process in processes]))
        correlations, process = choices[best], processes[best]
    return correlations, process


def couple(runs: Sequence[EarlierRun], trials: Trials, scale: Scale, correlations: Array) -> Observations:
    """Return the trials of all tasks as observations of one process, each task standardised by itself.

    Args:
        runs: the sources.
        trials: trials of the target.
        scale: scale of the target's scores.
        correlations: correlation (sources,) of each source with the target.
    """
    tasks = [*(run.trials for run in runs), trials]
    scales = [*(run.scale for run in runs), scale]
    task = np.repeat(np.arange(len(tasks)), [len(trials) for trials in tasks])
    loading = np.append(correlations, 1.0)[task]
    return Observations(
        x=np.concatenate([task.x for task in tasks]),
        y=np.concatenate([scale.standardise(task.scores) for task, scale in zip(tasks, scales, strict=True)]),
        given=np.zeros(len(task)),
        share=np.concatenate([task.shares for task in tasks]),
        coupling=np.where(task[:, None] == task, 1.0, np.outer(loading, loading)),
        loading=loading,
    )


METHOD = Method(
    "icm",
    "one process of all tasks, with a learned correlation of each source (multi-task Gaussian process)",
    uses_sources=True,
    make=ICM,
)
