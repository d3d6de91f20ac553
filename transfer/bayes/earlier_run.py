"""What an earlier run, the source of a transfer, says by itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.bayes.belief import refit
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.proposal import Proposal, list_proposals
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.search import places
from vvvaltr.transfer.bayes.spread import spread_out
from vvvaltr.transfer.bayes.thinning import thin
from vvvaltr.transfer.bayes.trials import Trials

WARM_TRIALS = 3
"""Number of the sources' best gaits that a warm start tries first."""

SOURCE_OBSERVATIONS, LEAST_OBSERVATIONS = 120, 60
"""Number of observations that all sources together are thinned to; a single source of several keeps the second."""


@dataclass(frozen=True, slots=True)
class EarlierRun:
    """A source that has been learned from.

    Args:
        trials: the source's trials, thinned, at their places in the target's unit cube.
        process: Gaussian process fitted to these trials alone, of standardised scores.
        scale: scale that the scores are standardised by.
    """

    trials: Trials
    process: GaussianProcess
    scale: Scale

    @classmethod
    def learn(
        cls,
        space: GaitSpace,
        seed: int,
        source: Source,
        scale_of: Callable[[Array], Scale] = Scale.of,
        most: int = SOURCE_OBSERVATIONS,
    ) -> EarlierRun:
        """Fit a process to a source by itself.

        Args:
            space: gaits to search on the target.
            seed: seed of every random stream.
            source: the earlier run.
            scale_of: chooses the scale of the source's scores (n,).
            most: number of observations that a longer source is thinned to.

        Raises:
            ValueError: the source has another number of motors than the space.
        """
        told = Trials(places(space, source.gaits), np.array(source.scores))
        trials, scale = thin(told, most), scale_of(told.scores)
        rng = stream(seed, 0, f"hyperparameters of {source.name}")
        return cls(trials, refit(trials.observe(scale), None, 0, rng), scale)

    def predict(self, x: Array) -> Array:
        """Return the scores (m,) that the source alone predicts at places (m, d)."""
        return self.scale.scores(self.process.predict_mean(x))

    def best(self, count: int) -> Array:
        """Return the best of the places tried, (k, d), k <= count: by posterior mean, the greatest first, well apart.

        A gait outside the target's bounds is moved to the nearest gait within them, and judged there.
        """
        inside = np.clip(self.trials.x, 0.0, 1.0)
        return spread_out(inside, self.process.predict_mean(inside), count)


def learn_sources(
    space: GaitSpace, seed: int, sources: Sequence[Source], scale_of: Callable[[Array], Scale] = Scale.of
) -> list[EarlierRun]:
    """Fit a process to each source by itself; see ``EarlierRun.learn``.

    Raises:
        ValueError: there is no source, or one has another number of motors than the space.
    """
    if not sources:
        raise ValueError("this method learns from an earlier run: give it a source")
    most = max(SOURCE_OBSERVATIONS // len(sources), LEAST_OBSERVATIONS)
    return [EarlierRun.learn(space, seed, source, scale_of, most) for source in sources]


def propose_best(runs: Sequence[EarlierRun]) -> list[Proposal]:
    """Return the first proposals of a warm start: the sources' best gaits, at most ``WARM_TRIALS`` of them."""
    return list_proposals(best_of_all(runs, WARM_TRIALS), "best of source")


def best_of_all(runs: Sequence[EarlierRun], count: int) -> Array:
    """Return up to ``count`` places (k, d), well apart: the best of each run in turn, then the second best of each."""
    of_runs = [run.best(count) for run in runs]
    in_turn = np.array([best[i] for i in range(count) for best in of_runs if i < len(best)])
    return spread_out(in_turn, -np.arange(float(len(in_turn))), count)
