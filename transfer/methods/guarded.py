"""Guarded transfer: fast where a source is like the target, and no worse than Plain-BO where it is not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.values import GaitSpace, Source
from vvvaltr.transfer.bayes.acquisition import Posterior
from vvvaltr.transfer.bayes.belief import Belief, Trials
from vvvaltr.transfer.bayes.earlier_run import EarlierRun, best_of_all, learned_from
from vvvaltr.transfer.bayes.gp import GaussianProcess, Observations, Prior, fit
from vvvaltr.transfer.bayes.proposal import Proposal, expected_improvement
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.methods.icm import coupled
from vvvaltr.transfer.methods.optimistic import OPTIMISM, raised
from vvvaltr.transfer.methods.plain_bo import learned_alone
from vvvaltr.transfer.methods.warm import WARM_TRIALS

Array = NDArray[np.float64]

DOUBT = 0.3
"""The probability, before the first trial, that no source says anything about the target."""

CORRELATIONS = {0.6: 0.5, 0.9: 0.4, -0.6: 0.1}
"""How a source that does may be correlated with the target, and how probable that is before the first trial."""

FADING = 8.0
"""Trials in which the optimism of every second one falls to 1/e; it begins with that of ``optimistic``."""

NEGLIGIBLE = 0.02
"""Hypotheses less probable than this are left out of the predictions."""


class Guarded(Search):
    """Bayesian optimisation under several hypotheses of what the sources are worth, each with its probability.

    One hypothesis is that no source says anything about the target; in the others one source, or all alike, are
    correlated with it by a given number, as in ``icm.ICM``. The target's trials decide between them by Bayes' rule, and
    predictions are those of the mixture: a source that is like the target is used from the first trial, one that is not
    is dropped after a few, and the interval is wide while that is open.

    - The first trials are the sources' best gaits: they are good, or they soon tell that the sources are not.
    - The target's hyperparameters are expected to be about those of the sources, which have more trials.
    - The target's scale takes the sources' scores into account, times the factor by which the target is faster: the
      first trials are meant to be good ones all, and tell little of how scores spread.
    - Every second trial is chosen from the target's trials alone, at first with optimism and later as Plain-BO would:
      where all sources are wrong, only trials elsewhere than they say can tell.

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
            return learned_with_doubt(space, runs, trials, last) if len(trials) else None

        def propose(trials: Trials, belief: Belief | None, rng: np.random.Generator) -> Proposal:
            if belief is None or len(trials) < len(warm):
                return Proposal(warm[len(trials)], "best of source")
            if len(trials) % 2:
                optimism = OPTIMISM * math.exp(-len(trials) / FADING)
                belief = raised(learned_alone(space, trials, None, rng), optimism)
            return expected_improvement(belief, rng)

        super().__init__(space, seed, learn, propose)


@dataclass(frozen=True, slots=True)
class Mixture:
    """Posteriors of which one is right, with the probabilities of each: mean and variance of the mixture."""

    posteriors: Sequence[Posterior]
    weights: Array

    def predict(self, x: Array) -> tuple[Array, Array]:
        """See ``Posterior``."""
        means, variances = map(np.array, zip(*(posterior.predict(x) for posterior in self.posteriors), strict=True))
        mean = self.weights @ means
        return mean, self.weights @ (variances + (means - mean) ** 2)

    def predict_with_gradient(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """See ``Posterior``."""
        parts = zip(*(posterior.predict_with_gradient(x) for posterior in self.posteriors), strict=True)
        means, variances, mean_slopes, variance_slopes = map(np.array, parts)
        mean, mean_slope = self.weights @ means, np.tensordot(self.weights, mean_slopes, 1)
        away = means - mean
        slopes = variance_slopes + 2.0 * away[:, :, None] * (mean_slopes - mean_slope)
        return mean, self.weights @ (variances + away**2), mean_slope, np.tensordot(self.weights, slopes, 1)


def learned_with_doubt(space: GaitSpace, runs: Sequence[EarlierRun], trials: Trials, last: Belief | None) -> Belief:
    """Return what one or more trials of the target, and the sources as far as they can be trusted, say together."""
    scale, prior = common_scale(runs, trials), prior_like(runs)
    observations = Observations.alike(trials.x, scale.standardise(trials.scores))
    alone = fit(observations, prior, [prior.mean] if last is None else [prior.mean, last.logs])
    correlations, probable = hypotheses(len(runs))
    processes = [
        GaussianProcess.conditioned(coupled(runs, trials, scale, choice), alone.hyperparameters)
        for choice in correlations
    ]
    weights = probable
    if len(trials) > 1:  # the common scale is made to fit the first, which therefore says nothing
        earlier = sum(len(run.trials) for run in runs)
        evidence = np.array([process.log_evidence(given=earlier) for process in processes])
        weights = probable * np.exp(evidence - evidence.max())
        weights /= weights.sum()
    kept = np.flatnonzero(weights > NEGLIGIBLE)
    posterior = Mixture([processes[i] for i in kept], weights[kept] / weights[kept].sum())
    belief = Belief.of(alone, scale, space)
    trust = {f"source_{i}_trust": float(weights[source != 0.0].sum()) for i, source in enumerate(correlations.T, 1)}
    return replace(belief, posterior=posterior, hyperparameters={**belief.hyperparameters, **trust})


def hypotheses(sources: int) -> tuple[Array, Array]:
    """Return correlations with the target (hypotheses, sources), first all 0, and their prior probabilities."""
    groups = np.eye(sources) if sources == 1 else np.vstack([np.eye(sources), np.ones(sources)])
    choices = [(r * group, share / len(groups)) for group in groups for r, share in CORRELATIONS.items()]
    correlations = np.array([np.zeros(sources), *(choice for choice, _ in choices)])
    return correlations, np.array([DOUBT, *((1.0 - DOUBT) * share for _, share in choices)])


def prior_like(runs: Sequence[EarlierRun]) -> Prior:
    """Return the hyperparameters' prior, drawn half way to those of the sources, and half as wide."""
    usual = Prior.of(runs[0].trials.x.shape[1])
    found = np.mean([run.process.hyperparameters.logs for run in runs], axis=0)
    return Prior(0.5 * (usual.mean + found), 0.5 * usual.sd)


def common_scale(runs: Sequence[EarlierRun], trials: Trials) -> Scale:
    """Return the scale of the target's scores and each source's, times a factor that makes up for its speed.

    The factor is that of the target's scores to what the source predicts for the same gaits.
    """
    size = np.abs(trials.scores).sum()
    scores = [run.trials.scores * (size / (np.abs(run.predicted(trials.x)).sum() or 1.0)) for run in runs]
    return Scale.of(np.concatenate([trials.scores, *scores]))
