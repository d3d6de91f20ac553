"""Makes a whole ``Optimizer`` of one that only asks and tells, without pretending that it has a model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import TYPE_CHECKING

from vvvaltr.controller.core.errors import NothingToRecommend
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import AskTell, Fitting, Listening, Optimizer
from vvvaltr.controller.core.records import Evidence, Fit, LoggedTrial, Told
from vvvaltr.controller.core.values import Estimate, Recommendation, Suggestion

if TYPE_CHECKING:
    from vvvaltr.controller.core.arrays import Array


_SAME = 1e-6  # in m/s, and as a share: a score is a displacement's to rounding
_GRID = 64  # intraclass correlations between 0 and 1


def complete(optimizer: AskTell) -> Optimizer:
    """Return ``optimizer`` itself if it has all methods of ``Optimizer``, else with the missing ones filled in."""
    return optimizer if isinstance(optimizer, Optimizer) else WithoutModel(optimizer)


def tell_history(optimizer: AskTell, trials: Sequence[LoggedTrial], already: int = 0) -> None:
    """Tell an optimiser the valid trials of a log, at once if it can; the first ``already`` trials were told before."""
    if isinstance(optimizer, Fitting):
        optimizer.recall([told for each in trials if (told := make_told(each)) is not None])
        return
    for each in trials[already:]:
        tell_trial(optimizer, each)


def tell_trial(optimizer: AskTell, logged: LoggedTrial) -> None:
    """Tell an optimiser a valid trial of a log, with all that it shows where the optimiser listens."""
    told = make_told(logged)
    if told is None:
        return
    if isinstance(optimizer, Listening):
        optimizer.tell_trial(told)
    else:
        optimizer.tell(told.gait, told.score)


def make_told(logged: LoggedTrial) -> Told | None:
    """Return what an optimiser is told of a trial: its score, and what made it; None for a failed one."""
    if logged.score is None:
        return None
    return Told(logged.trial.gait, logged.score, logged.fit, _find_evidence(logged, logged.score))


def _find_evidence(logged: LoggedTrial, score: float) -> Evidence:
    """Return what the trial shows beside its score. Which of the scores it has, its own movement tells."""
    applied = logged.applied
    applied_hz = applied.mean_hz if applied is not None and applied.measured else None
    if logged.movement is None or logged.trial.duration_s <= 0.0:
        return Evidence(applied_hz=applied_hz)
    start, end = logged.movement.start, logged.movement.end
    x_m_s, y_m_s = ((after - before) / logged.trial.duration_s
                    for before, after in zip(start.position_m[:2], end.position_m[:2], strict=True))  # fmt: skip
    ahead = (math.cos(start.yaw_rad), math.sin(start.yaw_rad))
    if math.isclose(score, math.hypot(x_m_s, y_m_s), rel_tol=_SAME, abs_tol=_SAME):
        return Evidence((x_m_s, y_m_s), None, logged.pieces, applied_hz)
    if math.isclose(score, ahead[0] * x_m_s + ahead[1] * y_m_s, rel_tol=_SAME, abs_tol=_SAME):
        return Evidence((x_m_s, y_m_s), ahead, logged.pieces, applied_hz)
    return Evidence(pieces=logged.pieces, applied_hz=applied_hz)


def last_fit(optimizer: AskTell) -> Fit | None:
    """Return the optimiser's fit for the log; None where it has none."""
    return optimizer.fit() if isinstance(optimizer, Fitting) else None


class WithoutModel:
    """An optimiser that asks and tells, completed by what repeats of its gaits say.

    The scores are taken for a one-way random-effects model, score = mean + gait + noise, with normal effects, the
    reference prior for mean and noise, and a uniform prior for the intraclass correlation, the share of variance that
    the gaits explain (Box, Tiao: Bayesian Inference in Statistical Analysis, 1973, chapter 7). So a gait's mean is
    drawn towards the mean of all gaits the more, the noisier and the fewer its trials are. No gait is recommended
    before one has been repeated: until then nothing tells a good gait from a lucky trial.
    """

    def __init__(self, inner: AskTell) -> None:
        self._inner = inner
        self._scores: dict[Gait, list[float]] = {}

    def ask(self) -> Suggestion:
        """Return the gait to try next."""
        return self._inner.ask()

    def tell(self, gait: Gait, score: float) -> None:
        """Learn from one valid trial. Raises ValueError if the score is not finite."""
        if not math.isfinite(score):
            raise ValueError(f"the score is {score}, which is not a finite number")
        self._scores.setdefault(gait, []).append(score)
        self._inner.tell(gait, score)

    def recommend(self) -> Recommendation:
        """Return the tried gait with the greatest predicted score.

        Raises:
            NothingToRecommend: no gait has been repeated yet.
        """
        if all(len(scores) == 1 for scores in self._scores.values()):
            raise NothingToRecommend("no gait has been repeated, and this optimiser has no model: use --confirm KxR")
        best = self.promising(1)[0]
        return Recommendation(best, self.predict([best])[0])

    def predict(self, gaits: Sequence[Gait]) -> tuple[Estimate, ...]:
        """Return the gaits' true scores as far as repeats tell them. An untried gait is like any other gait.

        Raises:
            ValueError: nothing has been told.
        """
        if not self._scores:
            raise ValueError("nothing has been told: there is nothing to predict from")
        effects = _effects(list(self._scores.values()))
        return tuple(effects.estimate(self._scores.get(gait, [])) for gait in gaits)

    def promising(self, count: int) -> tuple[Gait, ...]:
        """Return the ``count`` tried gaits of greatest predicted score, those of greater mean first among equals."""
        estimates = self.predict(tuple(self._scores))
        merits = {
            gait: (estimate.mean, fmean(scores))
            for (gait, scores), estimate in zip(self._scores.items(), estimates, strict=True)
        }
        return tuple(sorted(merits, key=merits.__getitem__, reverse=True)[:count])

    def improvement(self) -> float:
        """Return infinity: without a model nothing says that the search may end."""
        return math.inf


@dataclass(frozen=True, slots=True)
class _Effects:
    """The fitted model, over a grid of the ratio between the variances of gaits and of noise.

    Args:
        ratio: variance between gaits over that of the noise, shape (grid,).
        share: posterior probability of each ratio.
        mean: mean of all gaits, for each ratio.
        precision: of that mean, over the precision of one trial.
        noise: variance of the noise.
        quantile: of Student's t, for a central 95 % interval.
    """

    ratio: Array
    share: Array
    mean: Array
    precision: Array
    noise: Array
    quantile: float

    def estimate(self, scores: Sequence[float]) -> Estimate:
        """Return the true score of a gait with these trials, or of one without any."""
        trials = len(scores)
        doubt = 1.0 / (1.0 + trials * self.ratio)  # how far the gait's mean is drawn to the mean of all
        means = doubt * self.mean + (1.0 - doubt) * (fmean(scores) if scores else 0.0)
        variances = self.noise * (self.ratio * doubt + doubt**2 / self.precision)
        mean = float(self.share @ means)
        spread = self.quantile * math.sqrt(self.share @ (variances + (means - mean) ** 2))
        return Estimate(mean, mean - spread, mean + spread)


def _effects(groups: Sequence[Sequence[float]]) -> _Effects:
    """Fit the model to the scores of each gait."""
    import numpy as np  # here, so that the command line's help need not wait for it
    from scipy.special import stdtrit

    correlation = (np.arange(_GRID) + 0.5) / _GRID
    ratio = correlation / (1.0 - correlation)
    sizes, means = np.array([len(group) for group in groups]), np.array([fmean(group) for group in groups])
    within = sum((score - fmean(group)) ** 2 for group in groups for score in group)
    freedom = int(sizes.sum()) - 1
    growth = 1.0 + ratio[:, None] * sizes
    weights = sizes / growth
    precision = weights.sum(axis=1)
    mean = weights @ means / precision
    square = np.maximum(within + (weights * (means - mean[:, None]) ** 2).sum(axis=1), np.finfo(float).tiny)
    log_share = -0.5 * (np.log(growth).sum(axis=1) + np.log(precision) + freedom * np.log(square))
    share = np.exp(log_share - log_share.max())
    if freedom == 0:  # of a single trial's scatter nothing is known
        return _Effects(ratio, share / share.sum(), mean, precision, np.full(_GRID, math.inf), 1.0)
    quantile = float(stdtrit(freedom, 0.975))
    return _Effects(ratio, share / share.sum(), mean, precision, square / freedom, quantile)
