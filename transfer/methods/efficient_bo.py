"""Efficient-BO: Bayesian optimisation that treats an earlier run's trials as noisy trials of the present task.

The thesis' method, after Joy, Rana, Gupta and Venkatesh, "Flexible transfer learning framework for Bayesian
optimisation", PAKDD 2016.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.bayes.belief import Belief, refit
from vvvaltr.transfer.bayes.earlier_run import EarlierRun, learn_sources
from vvvaltr.transfer.bayes.kernel import Observations
from vvvaltr.transfer.bayes.proposal import begin_with
from vvvaltr.transfer.bayes.refitting import Fitted, follow
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.search import FITTING, Search
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.methods.method import Method

ALPHA_0 = BETA_0 = 1e-3
"""Shape and scale of the prior of a source's noise variance; so small, they leave it almost to the data."""


class EfficientBO(Search):
    """Efficient-BO as published: the sources' trials enter the target's Gaussian process, with noise of their own.

    A source's score counts as a noisy score of the *target*: y_i = f(g_i) + e_i with e_i ~ N(0, sigma_S^2). With p
    trials of the target told so far,

        sigma_S^2 ~ InvGamma(alpha_0 + p / 2, beta_0 + sum_i (y_i - yhat_i)^2 / 2),

    where y_i is the target's i-th score and yhat_i the prediction for its gait by a process fitted to the source alone.
    The target's process has the noise variances diag(sigma_S^2 on the source's trials, sigma_T^2 on the target's),
    updated at every trial. sigma_S^2 is set to the *mode* of its distribution: with alpha_0 = beta_0 = 1e-3 the mean
    does not exist for p < 2, and a draw at p = 0 is beyond floating point. The mode at p = 0 is 1e-3: the source is
    trusted like the target itself until the target contradicts it.

    The thesis' text and its pseudo-code differ. This class follows the text, which agrees with the paper; the
    pseudo-code predicts yhat with the *target's* process, adds sigma_S^2 to the kernel of the *source's* process,
    maximises the improvement given the target's trials only, and begins with a random gait on the target.

    The scores of source and target are compared as they are: nothing compensates for a source that is faster or slower
    by a factor. *One* affine map brings all of them together to mean 0 and variance 1, and alpha_0 and beta_0 are in
    that unit, so that metres or millimetres make no difference.

    A source's gait outside the target's bounds is an observation like any other, and informs about gaits near it that
    are within bounds. Each of several sources has a process and a variance of its own.

    Args:
        space: gaits to search.
        seed: seed of every random stream.
        sources: earlier runs, at least one.

    Raises:
        ValueError: there is no source, or one has another number of motors than the space.
    """

    def __init__(self, space: GaitSpace, seed: int, sources: Sequence[Source]) -> None:
        learn = partial(learn_together, space, learn_sources(space, seed, sources, Scale.linear))
        belief = learn(Trials.none(space), None, stream(seed, 0, FITTING))
        super().__init__(space, seed, learn, begin_with([]), belief)


def source_variance(differences: Array) -> float:
    """Return the mode of sigma_S^2 for differences (p,) of the target's scores to the source's predictions."""
    alpha = ALPHA_0 + len(differences) / 2
    beta = BETA_0 + float(differences @ differences) / 2
    return beta / (alpha + 1.0)


def learn_together(
    space: GaitSpace, runs: Sequence[EarlierRun], trials: Trials, last: Fitted | None, rng: np.random.Generator
) -> Belief:
    """Return what the trials of the target, none or more, and of the sources say together, in one process."""
    scale = Scale.linear(np.concatenate([*(run.trials.scores for run in runs), trials.scores]))
    variances = [source_variance((trials.scores - run.predict(trials.x)) / scale.unit()) for run in runs]
    observe = partial(pool, runs, scale, variances)
    fitted = follow(trials, last, observe, partial(refit, trials=len(trials), rng=rng))
    belief = Belief.of(fitted.process, scale, space, fitted)
    deviations = {f"source_{i}_noise_sd": scale.unit() * math.sqrt(v) for i, v in enumerate(variances, start=1)}
    return replace(belief, hyperparameters={**belief.hyperparameters, **deviations})


def pool(runs: Sequence[EarlierRun], scale: Scale, variances: Sequence[float], trials: Trials) -> Observations:
    """Return the trials of all tasks as observations of one function, each source with its noise variance."""
    tasks = [*(run.trials for run in runs), trials]
    lengths, shares = [len(task) for task in tasks], np.concatenate([task.shares for task in tasks])
    return Observations(
        x=np.concatenate([task.x for task in tasks]),
        y=scale.standardise(np.concatenate([task.scores for task in tasks])),
        given=shares * np.repeat([*variances, 0.0], lengths),
        share=shares * np.repeat([0.0] * len(runs) + [1.0], lengths),
    )


METHOD = Method(
    "efficient",
    "Efficient-BO as published: an earlier run's trials count as noisy trials of this one",
    uses_sources=True,
    make=EfficientBO,
)
