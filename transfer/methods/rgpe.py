"""RGPE: an ensemble of processes, weighted by how well each ranks the target's trials.

After Feurer, Letham, Hutter and Bakshy, "Practical transfer learning for Bayesian optimization", 2018 (arXiv
1802.02219).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.bayes.acquisition import Posterior
from vvvaltr.transfer.bayes.belief import Belief, learn_alone
from vvvaltr.transfer.bayes.earlier_run import EarlierRun, learn_sources, propose_best
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.proposal import begin_with
from vvvaltr.transfer.bayes.refitting import Fitted
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.methods.method import Method

RANKING_DRAWS = 256
"""Random draws of each posterior whose rankings are compared."""

RANKED = 100
"""Most observations that are ranked: of more than these, so many at even intervals."""


class RGPE(Search):
    """The ranking-weighted ensemble: mean sum_i w_i m_i, variance sum_i w_i^2 s_i^2, of all tasks' processes.

    Each task is standardised by itself: only the order of the scores is compared. The weight of a process is the
    probability that it makes the fewest mistakes in ranking the target's trials. The target's own process predicts each
    of these from the others. A source whose median number of mistakes exceeds the 95th percentile of the target's is
    left out. There is nothing to rank before the first trials, which are the sources' best gaits.

    In the paper, the draws of a source's process are joint over the trials; here they are independent.

    Args:
        space: gaits to search.
        seed: seed of every random stream.
        sources: earlier runs, at least one.

    Raises:
        ValueError: there is no source, or one has another number of motors than the space.
    """

    def __init__(self, space: GaitSpace, seed: int, sources: Sequence[Source]) -> None:
        runs = learn_sources(space, seed, sources)
        super().__init__(space, seed, partial(learn_as_ensemble, space, runs), begin_with(propose_best(runs)))


@dataclass(frozen=True, slots=True)
class Ensemble:
    """A weighted sum of independent posteriors.

    Args:
        posteriors: the posteriors.
        weights: weight of each, (posteriors,).
    """

    posteriors: Sequence[Posterior]
    weights: Array

    def predict(self, x: Array) -> tuple[Array, Array]:
        """See ``Posterior``."""
        means, variances = zip(*(posterior.predict(x) for posterior in self.posteriors), strict=True)
        return self.weights @ np.array(means), self.weights**2 @ np.array(variances)

    def predict_with_gradient(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """See ``Posterior``."""
        parts = zip(*(posterior.predict_with_gradient(x) for posterior in self.posteriors), strict=True)
        mean, variance, mean_gradient, variance_gradient = map(np.array, parts)
        once, twice = self.weights, self.weights**2
        return (
            once @ mean,
            twice @ variance,
            np.tensordot(once, mean_gradient, 1),
            np.tensordot(twice, variance_gradient, 1),
        )

    def predict_mean(self, x: Array) -> Array:
        """See ``Posterior``."""
        return np.asarray(self.weights @ np.array([posterior.predict_mean(x) for posterior in self.posteriors]))

    def predict_mean_with_gradient(self, x: Array) -> tuple[Array, Array]:
        """See ``Posterior``."""
        parts = zip(*(posterior.predict_mean_with_gradient(x) for posterior in self.posteriors), strict=True)
        mean, gradient = map(np.array, parts)
        return self.weights @ mean, np.tensordot(self.weights, gradient, 1)


def learn_as_ensemble(
    space: GaitSpace, runs: Sequence[EarlierRun], trials: Trials, last: Fitted | None, rng: np.random.Generator
) -> Belief:
    """Return what the processes of the sources and of one or more trials of the target say together, by weight."""
    belief = learn_alone(space, trials, last, rng)
    alone = belief.posterior
    assert isinstance(alone, GaussianProcess)
    weights = ensemble_weights([run.process for run in runs], alone, rng)
    processes = [*(run.process for run in runs), alone]
    kept = [(process, weight) for process, weight in zip(processes, weights, strict=True) if weight > 0.0]
    posterior = Ensemble([process for process, _ in kept], np.array([weight for _, weight in kept]))
    names = {f"source_{i}_weight": float(weight) for i, weight in enumerate(weights[:-1], start=1)}
    return replace(belief, posterior=posterior, hyperparameters={**belief.hyperparameters, **names})


def ensemble_weights(sources: Sequence[GaussianProcess], target: GaussianProcess, rng: np.random.Generator) -> Array:
    """Return the weights (sources + 1,) of the sources' processes and, last, of the target's. They sum to 1."""
    ranked = np.unique(np.linspace(0, len(target.weights) - 1, RANKED).round().astype(int))
    x, y = target.observations.x[ranked], target.observations.y[ranked]
    if len(y) < 3:  # predicted from the others, two trials leave nothing to rank
        return np.append(np.full(len(sources), 1.0), 0.0) / len(sources)
    of_target = tuple(numbers[ranked] for numbers in leave_one_out(target))
    predictions = [*(source.predict(x) for source in sources), of_target]
    noise = [*[0.0] * len(sources), target.observations.share[ranked] * target.hyperparameters.noise_variance]
    mistakes = np.array(
        [
            count_ranking_mistakes(
                rng.normal(mean, np.sqrt(np.maximum(variance - known, 0.0)), (RANKING_DRAWS, len(y))), y
            )
            for (mean, variance), known in zip(predictions, noise, strict=True)
        ]
    ).astype(float)
    mistakes[:-1][np.median(mistakes[:-1], axis=1) > np.percentile(mistakes[-1], 95)] = np.inf
    # In a tie the target wins, else the first source.
    order = np.roll(np.arange(len(predictions)), 1)
    winners = order[np.argmin(mistakes[order], axis=0)]
    return np.bincount(winners, minlength=len(predictions)) / RANKING_DRAWS


def leave_one_out(process: GaussianProcess) -> tuple[Array, Array]:
    """Return mean (n,) and variance (n,), noise included, of every observation given all others.

    Rasmussen and Williams 2006, equation 5.12.
    """
    precision = (process.inverse_root**2).sum(axis=0)
    return process.observations.y - process.weights / precision, 1.0 / precision


def count_ranking_mistakes(draws: Array, y: Array) -> Array:
    """Return, for each of the draws (s, n) of n scores, the number (s,) of pairs it orders differently from y (n,)."""
    return np.asarray(((draws[:, :, None] < draws[:, None, :]) ^ (y[:, None] < y)).sum(axis=(1, 2)))


METHOD = Method(
    "rgpe",
    "ensemble of all tasks' processes, weighted by how they rank this task's trials (Feurer et al. 2018)",
    uses_sources=True,
    make=RGPE,
)
