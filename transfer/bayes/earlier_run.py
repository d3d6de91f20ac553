"""What an earlier run says by itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import GaitSpace, Source
from vvvaltr.transfer.bayes.belief import Trials, refitted
from vvvaltr.transfer.bayes.gp import GaussianProcess, Observations
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.search import places
from vvvaltr.transfer.bayes.spread import spread_out

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class EarlierRun:
    """A source's trials, and the process that was fitted to them alone, with its scale."""

    trials: Trials
    process: GaussianProcess
    scale: Scale

    @classmethod
    def learned(
        cls, space: GaitSpace, seed: int, source: Source, scaled: Callable[[Array], Scale] = Scale.of
    ) -> EarlierRun:
        """Return what a source says by itself, its scores on the scale that ``scaled`` finds for them.

        Raises:
            ValueError: it has another number of motors than the space.
        """
        trials = Trials(places(space, source.gaits), np.array(source.scores))
        scale = scaled(trials.scores)
        observations = Observations.alike(trials.x, scale.standardise(trials.scores))
        rng = stream(seed, 0, f"hyperparameters of {source.name}")
        return cls(trials, refitted(observations, None, 0, rng), scale)

    def predicted(self, x: Array) -> Array:
        """Return the scores (m,) that the source alone predicts at places (m, d)."""
        return self.scale.scores(self.process.predict(x)[0])

    def best(self, count: int) -> Array:
        """Return the tried places (k, d), k <= count, of the greatest posterior mean, the greatest first, well apart.

        A gait out of the target's bounds is drawn to the nearest in them, and judged there.
        """
        inside = np.clip(self.trials.x, 0.0, 1.0)
        return spread_out(inside, self.process.predict(inside)[0], count)


def learned_from(
    space: GaitSpace, seed: int, sources: Sequence[Source], scaled: Callable[[Array], Scale] = Scale.of
) -> list[EarlierRun]:
    """Return what each source says by itself, its scores on the scale that ``scaled`` finds for them.

    Raises:
        ValueError: there is none, or one has another number of motors than the space.
    """
    if not sources:
        raise ValueError("this method learns from an earlier run: give it a source")
    return [EarlierRun.learned(space, seed, source, scaled) for source in sources]


def best_of_all(runs: Sequence[EarlierRun], count: int) -> Array:
    """Return up to ``count`` places (k, d), well apart: the best of each run in turn, then the second best of each."""
    of_runs = [run.best(count) for run in runs]
    in_turn = np.array([best[i] for i in range(count) for best in of_runs if i < len(best)])
    return spread_out(in_turn, -np.arange(float(len(in_turn))), count)
