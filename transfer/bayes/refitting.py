"""When hyperparameters are fitted anew, and how a process goes on in between."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeGuard

from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import Hyperparameters, Observations
from vvvaltr.transfer.bayes.thinning import thin
from vvvaltr.transfer.bayes.trials import Trials

EVERY_TRIAL = 60
"""Number of trials up to which each of them leads to a new fit."""

GROWTH = 0.1
"""Afterwards, the growth of the observations that leads to one."""

RECENT, SURPRISE = 10, 29.59
"""Or a surprise: the last 10 trials' squared standardised errors have a sum above the 99.9 % quantile of chi-squared
with 10 degrees of freedom. Their log predictive density is then below what 999 of 1000 such trials have."""

MOST_OBSERVATIONS = 400
"""Number of observations that a longer history is thinned to at each fit."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """Hyperparameters, and when they were fitted.

    Args:
        hyperparameters: the hyperparameters of kernel and noise.
        trials: number of trials told when they were fitted.
        learned: what else was fitted, by name.
    """

    hyperparameters: Hyperparameters
    trials: int
    learned: Mapping[str, float]

    def is_of(self, trials: int) -> bool:
        """Whether the fit was made after the last of so many trials."""
        return self.trials == trials


@dataclass(frozen=True, slots=True)
class Conditioned(Fitted):
    """A fit and what was conditioned on the trials since.

    Args:
        rows: what the trials told have become: thinned at the fit, and every later one.
        told: number of trials told.
        process: process of the rows.
        others: further processes that a method keeps for the rows.
    """

    rows: Trials
    told: int
    process: GaussianProcess
    others: tuple[GaussianProcess, ...] = ()

    def then(self, trials: Trials) -> Trials:
        """Return the rows of the fit and the trials since, with the scores that these trials, all of the run, have now.

        The scores of rows that were thinned stay those of the fit.
        """
        fitted = self.rows.part(slice(len(self.rows) - (self.told - self.trials)))
        is_whole = len(fitted) == self.trials
        return trials if is_whole else fitted.then(trials.part(slice(self.trials, None)))


Observe = Callable[[Trials], Observations]
"""Returns trials as observations to condition on."""

Find = Callable[[Observations, Fitted | None], GaussianProcess]
"""Returns the process of observations with hyperparameters fitted to them, given the last fit."""


def follow(trials: Trials, last: Fitted | None, observe: Observe, find: Find) -> Conditioned:
    """Return what trials say: under the last hyperparameters, or where there is reason, under newly fitted ones.

    Trials whose places or noise are others than at the last fit are a reason. It depends on the trials and the last fit
    alone, not on how often it was called since. So an optimiser that is told
    a log at once, with the last fit, continues with the same bits.
    """
    if isinstance(last, Conditioned) and len(trials) > EVERY_TRIAL:
        rows = last.then(trials)
        if rows.begin_with(last.rows):
            longer = replace(last, rows=rows, told=len(trials), process=last.process.extend(observe(rows)))
            if not needs_fit(longer):
                return longer
    rows = thin(trials, MOST_OBSERVATIONS)
    process = find(observe(rows), last)
    learned = {} if last is None else last.learned
    return Conditioned(process.hyperparameters, len(trials), learned, rows, len(trials), process)


def goes_on(last: Fitted | None, now: Conditioned) -> TypeGuard[Conditioned]:
    """Whether the last fit still holds ``now``: its processes can then be extended."""
    return isinstance(last, Conditioned) and not now.is_of(now.told)


def needs_fit(now: Conditioned) -> bool:
    """Whether there is reason for a new fit: many trials since the last one, or recent ones that surprise."""
    since = now.told - now.trials
    if since >= GROWTH * len(now.rows):
        return True
    errors = now.process.standardised_errors(RECENT)
    return since >= RECENT and float(errors @ errors) > SURPRISE
