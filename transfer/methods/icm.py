"""ICM: one Gaussian process of all tasks, with a learned correlation of each source to the target.

The intrinsic coregionalisation model of Bonilla, Chai and Williams, "Multi-task Gaussian process prediction", NIPS
2007; for Bayesian optimisation Swersky, Snoek and Adams, "Multi-task Bayesian optimization", NIPS 2013.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.values import GaitSpace, Source
from vvvaltr.transfer.bayes.belief import Belief, Trials, refitted
from vvvaltr.transfer.bayes.earlier_run import EarlierRun, best_of_all, learned_from
from vvvaltr.transfer.bayes.gp import GaussianProcess, Observations
from vvvaltr.transfer.bayes.proposal import Proposal, expected_improvement
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.methods.warm import WARM_TRIALS

Array = NDArray[np.float64]

CORRELATIONS = np.tanh(np.linspace(-2.0, 2.0, 17))
"""What a source's correlation may be: finer where a little makes a difference."""


class ICM(Search):
    """A Gaussian process over gait and task: cov(f_s(x), f_t(x')) = B_st k(x, x').

    Each task is standardised by itself, so B is a matrix of correlations. It has one number r per source, its
    correlation with the target, and sources are alike in what they have in common with the target:
    B_st = r_s r_t for s != t, with r = 1 for the target. At every trial each r is set to its most probable value among
    17 from -0.96 to 0.96, under the other hyperparameters. As a score needs others to be standardised by, the first
    trials are the sources' best gaits.

    Args:
        space: the gaits to search.
        seed: of all that is random.
        sources: one or more earlier runs.

    Raises:
        ValueError: there is no source, or one has another number of motors.
    """

    def __init__(self, space: GaitSpace, seed: int, sources: Sequence[Source]) -> None:
        runs = learned_from(space, seed, sources)
        warm = best_of_all(runs, WARM_TRIALS)

        def learn(trials: Trials, last: Belief | None, rng: np.random.Generator) -> Belief | None:
            return learned_jointly(space, runs, trials, last, rng) if len(trials) else None

        def propose(trials: Trials, belief: Belief | None, rng: np.random.Generator) -> Proposal:
            if belief is None or len(trials) < len(warm):
                return Proposal(warm[len(trials)], "best of source")
            return expected_improvement(belief, rng)

        super().__init__(space, seed, learn, propose)


def learned_jointly(
    space: GaitSpace, runs: Sequence[EarlierRun], trials: Trials, last: Belief | None, rng: np.random.Generator
) -> Belief:
    """Return what the target's trials and the sources' say together."""
    scale = Scale.of(trials.scores)
    names = [f"source_{i}_correlation" for i in range(1, len(runs) + 1)]
    correlations = np.array([0.0 if last is None else last.hyperparameters[name] for name in names])
    fitted = refitted(coupled(runs, trials, scale, correlations), last, len(trials), rng).hyperparameters
    for i in range(len(runs)):
        choices = [np.where(np.arange(len(runs)) == i, r, correlations) for r in CORRELATIONS]
        processes = [GaussianProcess.conditioned(coupled(runs, trials, scale, choice), fitted) for choice in choices]
        best = int(np.argmax([process.log_evidence() for process in processes]))
        correlations, process = choices[best], processes[best]
    belief = replace(Belief.of(process, scale, space), seen=trials.x)
    learned = dict(zip(names, correlations.tolist(), strict=True))
    return replace(belief, hyperparameters={**belief.hyperparameters, **learned})


def coupled(runs: Sequence[EarlierRun], trials: Trials, scale: Scale, correlations: Array) -> Observations:
    """Return all tasks' trials, each standardised by itself, under given correlations (sources,) with the target."""
    tasks = [*(run.trials for run in runs), trials]
    scales = [*(run.scale for run in runs), scale]
    task = np.repeat(np.arange(len(tasks)), [len(trials) for trials in tasks])
    loading = np.append(correlations, 1.0)[task]
    return Observations(
        x=np.concatenate([task.x for task in tasks]),
        y=np.concatenate([scale.standardise(task.scores) for task, scale in zip(tasks, scales, strict=True)]),
        given=np.zeros(len(task)),
        share=np.ones(len(task)),
        coupling=np.where(task[:, None] == task, 1.0, np.outer(loading, loading)),
        loading=loading,
    )
