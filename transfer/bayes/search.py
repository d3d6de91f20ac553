"""Ask and tell around a model: what all methods share.

A method is two functions: one learns from the trials, one proposes a place. Both are given everything they depend on,
so an optimiser that is told the trials of a log continues exactly like the one that ran them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait, GaitSpace, Quantity
from vvvaltr.controller.core.records import Fit, Told
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Estimate, Recommendation, Suggestion
from vvvaltr.transfer.bayes.acquisition import SCAN_PLACES, PosteriorMean, maximise
from vvvaltr.transfer.bayes.belief import Belief, describe_fit, read_fit
from vvvaltr.transfer.bayes.proposal import Proposal, Propose
from vvvaltr.transfer.bayes.refitting import Fitted
from vvvaltr.transfer.bayes.spread import spread_out
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.causes.correction import CAUSES, Corrector

FITTING = "hyperparameters"
"""Purpose of the random stream that ``Learn`` is given."""

_ALIKE = 0.1  # share of each range within which a gait is like a skipped one
_INSTEAD_PLACES = 512

Learn = Callable[[Trials, Fitted | None, np.random.Generator], Belief]
"""Returns what is believed after one or more trials, given the last fit of hyperparameters, and a random stream.

A fit of these very trials is taken as it is: see ``refitting.follow``."""


class Search:
    """An ``Optimizer`` made of a way to learn and a way to propose.

    Learning takes place in ``tell``, so that nothing depends on how often ``ask`` is called. Random streams depend on
    the seed and the number of trials told alone.

    Args:
        space: gaits to search.
        seed: seed of every random stream.
        learn: way to learn.
        propose: way to propose.
        belief: what is believed before the first trial; None for nothing.
    """

    def __init__(
        self,
        space: GaitSpace,
        seed: int,
        learn: Learn,
        propose: Propose,
        belief: Belief | None = None,
    ) -> None:
        self._space, self._seed, self._learn, self._propose = space, seed, learn, propose
        self._trials, self._belief, self._at_first = Trials.none(space), belief, belief
        self._history: list[Told] = []
        self._corrector = Corrector(_span_hz(space))
        self._found: Mapping[str, float] = {}  # of the causes of scatter, by name
        self._skipped: list[Array] = []
        self._proposal: Proposal | None = None  # made once between two trials, since it costs most

    def ask(self) -> Suggestion:
        """Return the gait to try next. It stays the same until a trial is told."""
        proposal = self._next()
        gait = self._space.from_unit(proposal.x)
        if self._belief is None:
            return Suggestion(gait, proposal.origin)
        expected = self._belief.estimates(proposal.x[None, :])[0]
        return Suggestion(gait, proposal.origin, expected, {**self._belief.hyperparameters, **self._found})

    def tell(self, gait: Gait, score: float) -> None:
        """Learn from one valid trial. The gait need not be the one suggested, nor within the bounds.

        Args:
            gait: gait of the trial.
            score: score of the trial, in the unit that all trials of the run share.

        Raises:
            ValueError: the score is not finite, or the gait has another number of motors than the space.
        """
        self.tell_trial(Told(gait, score))

    def tell_trial(self, told: Told) -> None:
        """Learn from one valid trial and from what it shows beside its score.

        Where it comes with evidence, what has been told so far is corrected for the causes of scatter that all trials
        together tell: estimates are then of a level floor, and of the strength that the robot has today.

        Raises:
            ValueError: as of ``tell``.
        """
        trials = self._see([*self._history, told])
        self._history += _without_fits([told])
        self._trials, last = trials, self._belief.fitted if self._belief else None
        self._belief, self._proposal = self._learn(trials, last, self._stream(FITTING)), None

    def skip(self, gait: Gait) -> None:
        """Propose neither this gait nor one like it from now on. It holds for the whole run, whatever is told later."""
        self._skipped.append(self._space.to_unit(gait))
        self._proposal = None

    def fit(self) -> Fit | None:
        """Return the fit of the hyperparameters after the last trial; None before the first and where there is none."""
        if self._belief is None or self._belief.fitted is None or not len(self._trials):
            return None
        fitted = self._belief.fitted
        return Fit({**describe_fit(self._space, fitted), **self._found}, fitted.is_of(len(self._trials)))

    def recall(self, history: Sequence[Told]) -> None:
        """Be told a whole history at once in place of all that was told before.

        The last new fit of the history is taken over, and what follows it is learned without the fits in between: the
        bits are those of an optimiser that was told trial by trial. Trials behind the last fit, and the trials of a
        history without a usable fit, are told one by one.

        Raises:
            ValueError: as of ``tell``.
        """
        if _without_fits(history[: len(self._history)]) != self._history:  # else what was found of these trials holds
            self._corrector = Corrector(_span_hz(self._space))
        self._trials, self._belief, self._proposal = Trials.none(self._space), self._at_first, None
        self._history, self._found = [], {}
        logged = max((i for i, told in enumerate(history, start=1) if told.fit), default=0)
        known = self._restore(history[:logged]) if logged else 0
        for told in history[known:]:
            self.tell_trial(told)

    def _restore(self, history: Sequence[Told]) -> int:
        """Learn from a history that ends with a fit; return how many trials of it were learned from: all, or none."""
        newest = max((i for i, each in enumerate(history, start=1) if each.fit and each.fit.is_new), default=0)
        first = self._see(history[:newest])
        told = first if newest == len(history) else self._see(history)
        fit = history[newest - 1].fit if newest else None
        try:
            numbers = {name: it for name, it in fit.hyperparameters.items() if name not in CAUSES} if fit else {}
            last = read_fit(self._space, numbers, newest)
            belief = self._learn(first, last, self._stream(FITTING, newest))
            if newest < len(told):
                belief = self._learn(told, belief.fitted, self._stream(FITTING, len(told)))
        except (ValueError, KeyError, np.linalg.LinAlgError):  # another method's, or spoilt: it is fitted again
            return 0
        self._trials, self._belief = told, belief
        self._history = _without_fits(history)
        return len(history)

    def _see(self, history: Sequence[Told]) -> Trials:
        """Return trials as the model is to see them. Raises ValueError as ``tell`` does."""
        for told in history:
            if not math.isfinite(told.score):
                raise ValueError(f"score {told.score} of gait {told.gait} is not finite: tell only valid trials")
        x = places(self._space, [told.gait for told in history])
        if not any(told.evidence for told in history):
            return Trials(x, np.array([told.score for told in history], dtype=float))
        corrected = self._corrector.correct(history)
        self._found = corrected.names
        return Trials(places(self._space, corrected.gaits), corrected.scores)

    def recommend(self) -> Recommendation:
        """Return the gait with the greatest posterior mean, and the 95 % interval of its true mean score.

        Raises:
            ValueError: nothing has been told yet.
        """
        x, belief = self._best(), self._told()
        return Recommendation(self._space.from_unit(x), belief.estimates(x[None, :])[0])

    def predict(self, gaits: Sequence[Gait]) -> tuple[Estimate, ...]:
        """Return posterior means of the gaits' true mean scores with 95 % intervals, without the noise of a trial.

        Raises:
            ValueError: nothing has been told yet, or a gait has another number of motors.
        """
        return self._told().estimates(places(self._space, gaits))

    def promising(self, count: int) -> tuple[Gait, ...]:
        """Return up to ``count`` gaits with the greatest posterior means, well apart, the recommended gait first.

        Raises:
            ValueError: nothing has been told yet.
        """
        others = np.concatenate(
            [self._told().seen, self._stream("promising").random((SCAN_PLACES, self._space.dimension))]
        )
        x = np.vstack([self._best(), np.clip(others, 0.0, 1.0)])
        chosen = spread_out(x, np.append(np.inf, self._told().posterior.predict(x[1:])[0]), count)
        return tuple(map(self._space.from_unit, chosen))

    def improvement(self) -> float:
        """Return the expected gain of the next suggestion over the best known gait, in the unit of the score.

        Infinite while suggestions are not chosen for an expected gain.
        """
        return self._next().improvement

    def _next(self) -> Proposal:
        if self._proposal is None:
            proposal = self._propose(self._trials, self._belief, self._stream("proposal"))
            self._proposal = self._instead(proposal) if self._is_skipped(proposal.x) else proposal
        return self._proposal

    def _instead(self, proposal: Proposal) -> Proposal:
        """Return the most promising of some places that are unlike the skipped ones; the proposal if there is none."""
        drawn = self._stream("instead").random((_INSTEAD_PLACES, self._space.dimension))
        x = np.array([place for place in drawn if not self._is_skipped(place)])
        if not len(x):
            return proposal
        best = 0 if self._belief is None else int(np.argmax(self._belief.posterior.predict_mean(x)))
        return Proposal(x[best], "in place of a skipped gait", proposal.improvement)

    def _is_skipped(self, x: Array) -> bool:
        return any(np.abs(x - skipped).max() < _ALIKE for skipped in self._skipped)

    def _best(self) -> Array:
        """Return the place (d,) of the greatest posterior mean; after one trial its own, as nothing else is known."""
        belief = self._told()
        if len(belief.seen) == 1:
            return np.asarray(np.clip(belief.seen[0], 0.0, 1.0))
        rng = self._stream("recommendation")
        return maximise(PosteriorMean(belief.posterior), belief.promising(), rng, belief.draw)

    def _told(self) -> Belief:
        if self._belief is None or not len(self._trials):
            raise ValueError("there is no trial to predict from yet: tell one first")
        return self._belief

    def _stream(self, purpose: str, trials: int | None = None) -> np.random.Generator:
        return stream(self._seed, len(self._trials) if trials is None else trials, purpose)


def _without_fits(history: Sequence[Told]) -> list[Told]:
    """Return what was told without the fits, which are in the log, and would fill the memory of a long run."""
    return [replace(told, fit=None) for told in history]


def _span_hz(space: GaitSpace) -> float:
    """Return the width of the widest range of frequencies; 1 where none is searched."""
    of = [it.high - it.low for it in space.parameters if it.quantity is Quantity.FREQUENCY]
    return max(of, default=1.0)


def places(space: GaitSpace, gaits: Sequence[Gait]) -> Array:
    """Return the gaits' places (m, d) in the unit cube, outside it where a gait is out of bounds.

    Raises:
        ValueError: a gait has another number of motors than the space.
    """
    for gait in gaits:
        if gait.motor_count != space.motor_count:
            raise ValueError(f"gait {gait} is for {gait.motor_count} motors, the robot has {space.motor_count}")
    return space.to_units(gaits)
