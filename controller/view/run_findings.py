"""What a run found, as numbers for its report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.ask_tell import tell_history
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Estimate
from vvvaltr.controller.runs.config import RunConfig
from vvvaltr.controller.runs.log import read_run
from vvvaltr.controller.view.learned import reopen_config, reopen_learner, span
from vvvaltr.transfer.bayes.belief import Belief, learn_alone
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.search import places
from vvvaltr.transfer.bayes.trials import Trials

_FEWEST = 4  # trials, below which a model of them says nothing
_MOST = 300  # of the newest trials are predicted: a greater model keeps only some of its trials


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What the model expects of each trial from all others, in m/s, as a median with a central 95 % interval.

    Args:
        trials: the trials.
        observed_m_s: their scores, (trials,).
        median_m_s, low_m_s, high_m_s: what was expected of a single trial, its scatter included, (trials,).
        surprise: observed minus expected, in standard deviations, (trials,).
    """

    trials: tuple[LoggedTrial, ...]
    observed_m_s: Array
    median_m_s: Array
    low_m_s: Array
    high_m_s: Array
    surprise: Array

    @property
    def coverage(self) -> float:
        """Share of the trials within their interval: about 0.95 if the model knows how much it knows."""
        return float(np.mean((self.low_m_s <= self.observed_m_s) & (self.observed_m_s <= self.high_m_s)))

    @property
    def drift(self) -> Estimate | None:
        """Slope of the surprise over the run's trials from first to last, with a 95 % interval; None for few trials."""
        from scipy.special import stdtrit

        count = len(self.surprise)
        if count < 8:
            return None
        share = np.linspace(-0.5, 0.5, count)
        slope = float(share @ (self.surprise - self.surprise.mean()) / (share @ share))
        rest = self.surprise - self.surprise.mean() - slope * share
        half = float(stdtrit(count - 2, 0.975)) * math.sqrt(float(rest @ rest) / (count - 2) / float(share @ share))
        return Estimate(slope, slope - half, slope + half)


@dataclass(frozen=True, slots=True)
class RunFindings:
    """A run and what it found.

    Args:
        path: where it was read.
        run: the run.
        config: what it was asked to do; None where nobody learned in it.
        space: gaits that it searched, or that its trials span; None where they are all one.
        optimizer: told all trials; None for trials that no search made.
        ranked: the recommended gait and other promising ones, with what is believed of their mean speeds.
        left_out: leave-one-out predictions; None for too few trials.
    """

    path: Path
    run: Run
    config: RunConfig | None
    space: GaitSpace | None
    optimizer: Optimizer | None
    ranked: tuple[tuple[Gait, Estimate], ...]
    left_out: LeftOut | None

    @property
    def valid(self) -> tuple[LoggedTrial, ...]:
        """The trials that measured something."""
        return tuple(logged for logged in self.run.trials if logged.score is not None)


def find_in_run(path: Path) -> RunFindings:
    """Read the run in ``path``, a directory or a log, and return what it found.

    Raises:
        UserError: there is no run, or none of its trials measured anything.
    """
    run = read_run(path)
    valid = [logged for logged in run.trials if logged.score is not None]
    if not valid:
        raise UserError(f"{path}: no trial has measured anything, so there is nothing to report yet")
    learner = reopen_learner(path, run)
    spanned = span([logged.trial.gait for logged in valid])
    space = learner.space if learner else spanned if spanned.parameters else None
    ranked: tuple[tuple[Gait, Estimate], ...] = ()
    if learner is not None:
        tell_history(learner.optimizer, run.trials)
        ranked = _rank(learner.optimizer, valid)
    left_out = _leave_each_out(space, valid[-_MOST:]) if space and len(valid) >= _FEWEST else None
    optimizer = learner.optimizer if learner else None
    return RunFindings(path, run, reopen_config(path), space, optimizer, ranked, left_out)


def _rank(optimizer: Optimizer, valid: Sequence[LoggedTrial]) -> tuple[tuple[Gait, Estimate], ...]:
    """Return the recommended gait, then others that are promising and not almost the same, the fastest first."""
    recommendation = valid[-1].recommendation
    first = [] if recommendation is None else [(recommendation.gait, recommendation.estimate)]
    gaits = [gait for gait in optimizer.promising(4) if not first or gait != first[0][0]][: 4 - len(first)]
    others = zip(gaits, optimizer.predict(gaits), strict=True) if gaits else ()
    return (*first, *sorted(others, key=lambda it: it[1].mean, reverse=True))


def _leave_each_out(space: GaitSpace, valid: Sequence[LoggedTrial]) -> LeftOut | None:
    """Predict each trial from the others with a model of this run alone, whose hyperparameters are those of all trials.

    In closed form: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, equation 5.12.
    """
    scores = np.array([logged.score or 0.0 for logged in valid])
    if np.ptp(scores) == 0.0:
        return None
    belief = _believe(space, valid, scores)
    if not isinstance(belief.posterior, GaussianProcess) or len(belief.seen) < len(scores):
        return None
    inverse = belief.posterior.inverse_root
    variance = 1.0 / np.sum(inverse**2, axis=0)
    y = belief.posterior.observations.y
    mean, sd = y - belief.posterior.weights * variance, np.sqrt(variance)
    low, median, high = (belief.scale.scores(mean + factor * sd) for factor in (-1.96, 0.0, 1.96))
    return LeftOut(tuple(valid), scores, median, low, high, (y - mean) / sd)


def _believe(space: GaitSpace, valid: Sequence[LoggedTrial], scores: Array) -> Belief:
    trials = Trials(places(space, [logged.trial.gait for logged in valid]), scores)
    return learn_alone(space, trials, None, stream(0, len(valid), "report"))


def describe_start_drift(trials: Sequence[LoggedTrial]) -> str:
    """Return how the start poses drifted, from the first third of the trials to the last; empty for fewer than six."""
    starts = [it.movement.start for it in trials if it.movement is not None]
    third = len(starts) // 3
    if third < 2:
        return ""
    places_mm = 1000.0 * np.array([start.position_m[:2] for start in starts])
    x_mm, y_mm = places_mm[-third:].mean(axis=0) - places_mm[:third].mean(axis=0)
    headings = np.exp(1j * np.array([start.yaw_rad for start in starts]))
    turn_deg = float(np.degrees(np.angle(headings[-third:].mean() / headings[:third].mean())))
    return (
        f"From the first third to the last the starts drifted by {np.hypot(x_mm, y_mm):.0f} mm (x {x_mm:+.0f}, "
        f"y {y_mm:+.0f}) and {turn_deg:+.0f} degrees."
    )
