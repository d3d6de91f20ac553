"""Efficient-BO: Bayesian optimisation that takes an earlier run's trials for noisy trials of the present task.

The thesis' method, after Joy, Rana, Gupta and Venkatesh, "Flexible transfer learning framework for Bayesian
optimisation", PAKDD 2016.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.values import GaitSpace, Source
from vvvaltr.transfer.bayes.belief import Belief, Trials, refitted
from vvvaltr.transfer.bayes.earlier_run import EarlierRun, learned_from
from vvvaltr.transfer.bayes.gp import Observations
from vvvaltr.transfer.bayes.proposal import Proposal, expected_improvement
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.search import Search

Array = NDArray[np.float64]

ALPHA_0 = BETA_0 = 1e-3
"""Shape and scale of the prior of a source's variance: next to no opinion."""


class EfficientBO(Search):
    """Efficient-BO as published: the sources' trials are in the target's Gaussian process, with noise of their own.

    A source's score is taken for a noisy score of the *target*: y_i = f(g_i) + e_i with e_i ~ N(0, sigma_S^2). With p
    trials of the target told so far,

        sigma_S^2 ~ InvGamma(alpha_0 + p / 2, beta_0 + sum_i (y_i - yhat_i)^2 / 2),

    where y_i is the target's i-th score and yhat_i the prediction for its gait by a process fitted to the source alone.
    The target's process has the noise variances diag(sigma_S^2 on the source's trials, sigma_T^2 on the target's),
    renewed at every trial. For sigma_S^2 stands the *mode* of its distribution: with alpha_0 = beta_0 = 1e-3 the mean
    does not exist for p < 2, and a draw at p = 0 is beyond floating point. The mode at p = 0 is 1e-3: the source is
    trusted like the target itself, until the target says otherwise.

    The thesis' text and its pseudo-code differ. The text is followed, which agrees with the paper; the pseudo-code
    predicts yhat with the *target's* process, adds sigma_S^2 to the kernel of the *source's* process, maximises the
    improvement given the target's trials only, and begins with a random gait on the target.

    The scores of source and target are compared as they are: nothing makes up for a source that is faster or slower by
    a factor. All of them together are brought to mean 0 and variance 1 by *one* affine map, and alpha_0 and beta_0 are
    in that unit, so that metres or millimetres make no difference.

    A source's gait that is outside of the target's bounds is an observation like the others, and tells of the gaits
    inside that are near it. Several sources have a process and a variance each.

    Args:
        space: the gaits to search.
        seed: of all that is random.
        sources: one or more earlier runs.

    Raises:
        ValueError: there is no source, or one has another number of motors.
    """

    def __init__(self, space: GaitSpace, seed: int, sources: Sequence[Source]) -> None:
        runs = learned_from(space, seed, sources, Scale.linear)

        def learn(trials: Trials, last: Belief | None, rng: np.random.Generator) -> Belief:
            return learned_together(space, runs, trials, last, rng)

        def propose(trials: Trials, belief: Belief | None, rng: np.random.Generator) -> Proposal:
            assert belief is not None  # learn returns one even before the first trial
            return expected_improvement(belief, rng)

        super().__init__(space, seed, learn, propose)


def source_variance(differences: Array) -> float:
    """Return the mode of sigma_S^2, given the differences (p,) of the target's scores to the source's predictions."""
    alpha = ALPHA_0 + len(differences) / 2
    beta = BETA_0 + float(differences @ differences) / 2
    return beta / (alpha + 1.0)


def learned_together(
    space: GaitSpace, runs: Sequence[EarlierRun], trials: Trials, last: Belief | None, rng: np.random.Generator
) -> Belief:
    """Return what the target's trials and the sources' say together."""
    tasks = [*(run.trials for run in runs), trials]
    scores = np.concatenate([task.scores for task in tasks])
    scale = Scale.linear(scores)
    variances = [source_variance((trials.scores - run.predicted(trials.x)) / scale.unit()) for run in runs]
    observations = Observations(
        x=np.concatenate([task.x for task in tasks]),
        y=scale.standardise(scores),
        given=np.repeat([*variances, 0.0], [len(task) for task in tasks]),
        share=np.repeat([0.0] * len(runs) + [1.0], [len(task) for task in tasks]),
    )
    belief = Belief.of(refitted(observations, last, len(trials), rng), scale, space)
    deviations = {f"source_{i}_noise_sd": scale.unit() * math.sqrt(v) for i, v in enumerate(variances, start=1)}
    return replace(belief, hyperparameters={**belief.hyperparameters, **deviations})
