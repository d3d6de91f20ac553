"""Guarded transfer: fast where a source resembles the target, and no worse than Plain-BO where it does not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.bayes.acquisition import Posterior
from vvvaltr.transfer.bayes.belief import Belief, learn_alone
from vvvaltr.transfer.bayes.drive import Drive
from vvvaltr.transfer.bayes.driven import LEVEL_SD, RISE, RISE_SD, Driven, begin_at_rest, couple_beating, observe_drive
from vvvaltr.transfer.bayes.earlier_run import EarlierRun, learn_sources, propose_best
from vvvaltr.transfer.bayes.fitting import Prior, fit
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import Observations
from vvvaltr.transfer.bayes.proposal import Proposal, begin_with, maximise_improvement
from vvvaltr.transfer.bayes.refitting import EVERY_TRIAL, Conditioned, Fitted, follow, goes_on
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.methods.drive import DEAD_ZONE, Hypotheses, learn_driven
from vvvaltr.transfer.methods.icm import couple
from vvvaltr.transfer.methods.method import Method
from vvvaltr.transfer.methods.optimistic import OPTIMISM_SD, raise_prior_mean

DOUBT = 0.3
"""Prior probability that no source says anything about the target."""

CORRELATIONS = {0.6: 0.5, 0.9: 0.4, -0.6: 0.1}
"""Correlations with the target of a source that does, each with its prior probability."""

OPTIMISM_DECAY_TRIALS = 8.0
"""Number of trials over which the optimism of every second trial falls to 1/e; it begins at ``OPTIMISM_SD``."""

LEAST_WEIGHT = 0.02
"""Probability below which a hypothesis is left out of the predictions, which would cost time and change little."""


class Guarded(Search):
    """Bayesian optimisation under several hypotheses of what the sources are worth, each with its probability.

    One hypothesis is that no source says anything about the target, of which nothing is known but what is known of any
    robot: more drive moves more, as in ``drive.DriveBO``. So a source that says no more than that counts for nothing.
    In each of the others one source, or all sources alike, have a given correlation with the target, as in
    ``icm.ICM``. The target's trials decide between the
    hypotheses by Bayes' rule, and predictions are those of the mixture: a source that resembles the target is used from
    the first trial, one that does not is dropped after a few, and intervals are wide while the question is open.

    - The first trials are the sources' best gaits: they are good, or they soon show that the sources are misleading.
    - The target's hyperparameters are expected near those of the sources, which have more trials to tell them.
    - The target's scale takes the sources' scores into account, times the factor by which the target is faster: the
      first trials are all meant to be good ones, so they tell little about the spread of scores.
    - Every second trial is chosen from the target's trials alone, as without a source: where all sources are wrong,
      only trials away from their good gaits can show it. Where no frequency is searched, so that nothing is known of
      the drive, these trials are chosen with optimism at first.

    Args:
        space: gaits to search.
        seed: seed of every random stream.
        sources: earlier runs, at least one.

    Raises:
        ValueError: there is no source, or one has another number of motors than the space.
    """

    def __init__(self, space: GaitSpace, seed: int, sources: Sequence[Source]) -> None:
        runs, drive = learn_sources(space, seed, sources), Drive.of(space)

        def learn(trials: Trials, last: Fitted | None, rng: np.random.Generator) -> Belief:
            return learn_with_doubt(space, drive, runs, trials, last)

        def choose(trials: Trials, belief: Belief, rng: np.random.Generator) -> Proposal:
            if len(trials) % 2:
                belief = believe_target(space, drive, trials, belief, rng)
            return maximise_improvement(belief, rng, len(trials))

        super().__init__(space, seed, learn, begin_with(propose_best(runs), choose))


@dataclass(frozen=True, slots=True)
class Mixture:
    """Mean and variance of a mixture of posteriors, one of which is right.

    Args:
        posteriors: the posteriors.
        weights: probability of each, (posteriors,), with the sum 1.
    """

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

    def predict_mean(self, x: Array) -> Array:
        """See ``Posterior``."""
        return np.asarray(self.weights @ np.array([posterior.predict_mean(x) for posterior in self.posteriors]))

    def predict_mean_with_gradient(self, x: Array) -> tuple[Array, Array]:
        """See ``Posterior``."""
        parts = zip(*(posterior.predict_mean_with_gradient(x) for posterior in self.posteriors), strict=True)
        means, slopes = map(np.array, parts)
        return self.weights @ means, np.tensordot(self.weights, slopes, 1)


def believe_target(space: GaitSpace, drive: Drive, trials: Trials, belief: Belief, rng: np.random.Generator) -> Belief:
    """Return what the target's trials say by themselves, with optimism where nothing is known of the drive.

    While there are few, their hyperparameters are fitted without regard to the sources; later these hardly matter.
    """
    if len(trials) > EVERY_TRIAL:
        assert isinstance(belief.fitted, Conditioned)
        return replace(belief, posterior=Hypotheses.of(drive, belief.fitted.others).posterior())
    if drive.has_meaning:
        return learn_driven(space, drive, trials, None, rng)
    optimism = OPTIMISM_SD * math.exp(-len(trials) / OPTIMISM_DECAY_TRIALS)
    return raise_prior_mean(learn_alone(space, trials, None, rng), optimism)


def learn_with_doubt(
    space: GaitSpace, drive: Drive, runs: Sequence[EarlierRun], trials: Trials, last: Fitted | None
) -> Belief:
    """Return what one or more trials of the target say together with the sources, as far as these can be trusted."""
    scale, prior = choose_common_scale(runs, trials), expect_like(runs)
    correlations, probabilities = list_hypotheses(len(runs))

    def find(observations: Observations, last: Fitted | None) -> GaussianProcess:
        if last is not None and last.is_of(len(trials)):
            return GaussianProcess.condition(observations, last.hyperparameters)
        return fit(observations, prior, [prior.mean] if last is None else [prior.mean, last.hyperparameters.logs])

    zone = 0.0 if last is None else last.learned.get(DEAD_ZONE, 0.0)
    fitted = follow(trials, last, lambda rows: observe_drive(drive, rows, scale, zone), find)
    before = last.others if goes_on(last, fitted) else ()
    alone = Hypotheses.condition(drive, fitted, scale, last, zone)
    if not goes_on(last, fitted):
        zone = alone.zones[alone.best()]
        fitted = replace(fitted, process=alone.processes[alone.best()], learned={DEAD_ZONE: zone})
    known = begin_at_rest(drive, fitted.rows)
    coupled = [couple_drive(drive, runs, known, scale, choice, zone) for choice in correlations[1:]]
    processes = follow_hypotheses(fitted, before[len(alone.processes) :], coupled)
    weights = probabilities
    if len(trials) > 1:  # the common scale is fitted to the first trial, which therefore decides nothing
        rest = len(known) - len(fitted.rows)  # every robot stays where it is at rest: that speaks for no source
        earlier = sum(len(run.trials) for run in runs) + rest
        evidence = np.array([alone.mean_evidence(rest), *(process.log_evidence(earlier) for process in processes)])
        weights = probabilities * np.exp(evidence - evidence.max())
        weights /= weights.sum()
    posterior = mix(drive, alone, processes, zone, weights)
    belief = Belief.of(fitted.process, scale, space, replace(fitted, others=(*alone.processes, *processes)))
    trust = {f"source_{i}_trust": float(weights[source != 0.0].sum()) for i, source in enumerate(correlations.T, 1)}
    names = {**belief.hyperparameters, **trust}
    return replace(belief, posterior=posterior, seen=fitted.rows.x, hyperparameters=names, drive=drive)


def mix(drive: Drive, alone: Hypotheses, coupled: Sequence[GaussianProcess], zone: float, weights: Array) -> Posterior:
    """Return the posterior of no source (its weight is the first) and coupled ones, those that are probable enough."""
    kept = np.flatnonzero(weights[1:] > LEAST_WEIGHT).tolist()
    posteriors: list[Posterior] = []
    shares = []
    if weights[0] > LEAST_WEIGHT or not len(kept):
        posteriors, shares = [alone.posterior()], [weights[0]]
    if len(kept):
        chances = weights[1:][kept]
        shares.append(chances.sum())
        zones = [zone] * len(kept)
        posteriors.append(Driven.of(drive, chances / chances.sum(), zones, [coupled[i] for i in kept]))
    return Mixture(posteriors, np.array(shares) / sum(shares)) if len(shares) > 1 else posteriors[0]


def couple_drive(
    drive: Drive, runs: Sequence[EarlierRun], trials: Trials, scale: Scale, correlations: Array, dead_zone: float
) -> Observations:
    """Return the trials of all tasks as observations of what the drive leaves to explain; see ``icm.couple``.

    Each task has a coefficient of its own for the trend of the drive, and a mean of its own. So a source teaches only
    what differs from gait to gait of like drive.
    """
    together = couple_beating(drive, couple(runs, trials, scale, correlations))
    rise = drive.trend(together.x, np.array([dead_zone]))[0]
    task = np.repeat(np.arange(len(runs) + 1), [*(len(run.trials) for run in runs), len(trials)])
    tasks = [len(runs), *range(len(runs))]  # the target's trend first, where ``Driven`` seeks it
    trend = [np.where(task == i, part, 0.0) for i in tasks for part in (RISE_SD * rise, LEVEL_SD)]
    return replace(together, y=together.y - RISE * rise, trend=np.stack(trend, axis=1))


def follow_hypotheses(
    fitted: Conditioned, last: Sequence[GaussianProcess], coupled: Sequence[Observations]
) -> list[GaussianProcess]:
    """Return the process of each hypothesis: the last one extended, or after a new fit one from the beginning."""
    if last:
        return [process.extend(observations) for process, observations in zip(last, coupled, strict=True)]
    return [GaussianProcess.condition(observations, fitted.hyperparameters) for observations in coupled]


def list_hypotheses(sources: int) -> tuple[Array, Array]:
    """Return the hypotheses, (hypotheses, sources) correlations with the target, first all 0, and their priors."""
    groups = np.eye(sources) if sources == 1 else np.vstack([np.eye(sources), np.ones(sources)])
    choices = [(r * group, share / len(groups)) for group in groups for r, share in CORRELATIONS.items()]
    correlations = np.array([np.zeros(sources), *(choice for choice, _ in choices)])
    return correlations, np.array([DOUBT, *((1.0 - DOUBT) * share for _, share in choices)])


def expect_like(runs: Sequence[EarlierRun]) -> Prior:
    """Return the prior of the hyperparameters, moved half way to those of the sources, and half as wide."""
    usual = Prior.of(runs[0].trials.x.shape[1])
    found = np.mean([run.process.hyperparameters.logs for run in runs], axis=0)
    return Prior(0.5 * (usual.mean + found), 0.5 * usual.sd)


def choose_common_scale(runs: Sequence[EarlierRun], trials: Trials) -> Scale:
    """Return a scale fitted to the scores of the target and of all sources, each source's times a factor for its speed.

    The factor is the ratio of the target's scores to the scores that the source predicts for the same gaits.
    """
    size = np.abs(trials.scores).sum()
    scores = [run.trials.scores * (size / (np.abs(run.predict(trials.x)).sum() or 1.0)) for run in runs]
    return Scale.of(np.concatenate([trials.scores, *scores]))


METHOD = Method(
    "guarded",
    "weighs what the sources are worth trial by trial: fast where they resemble this task, safe where they do not",
    uses_sources=True,
    make=Guarded,
)
