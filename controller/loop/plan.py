"""What a run drives next: the search, repeats, the reference gait, and then the confirmation."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from vvvaltr.controller.core.ask_tell import last_fit, tell_history, tell_trial
from vvvaltr.controller.core.errors import NothingToRecommend
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Optimizer, Skipping
from vvvaltr.controller.core.records import LoggedTrial, Review, Verdict
from vvvaltr.controller.core.values import Outcome, Phase, Recommendation, Suggestion, Trial
from vvvaltr.controller.loop.attendance import Remarks
from vvvaltr.controller.loop.causes import asked_again, review_speed, since_reference, to_repeat
from vvvaltr.controller.loop.movement import complete_record
from vvvaltr.controller.loop.scoring import as_speed, score

_CONFIDENCE = 0.95  # at which the confirmation ends early


@dataclass(frozen=True, slots=True)
class Budget:
    """Limits of a run.

    Args:
        trials: number of valid trials, confirmation included.
        score_name: name of the score.
        confirm: number of promising gaits to repeat at the end, and greatest number of repeats of each: they are driven
            in turns, and no more once one of them is better than the others with a confidence of 95 %.
        reference: a gait that is driven again and again, to see whether the robot has changed; None for none. Its
            trials come on top of ``trials``.
        reference_every: number of trials of the search between two of its trials.
        stop_below: the search ends early when the next trial is expected to gain less than this, in the score's unit.

    Raises:
        ValueError: the confirmation leaves no trial for the search.
    """

    trials: int
    score_name: str = "net"
    confirm: tuple[int, int] = (0, 0)
    stop_below: float = 0.0
    reference: Gait | None = None
    reference_every: int = 5

    def __post_init__(self) -> None:
        if self.search_trials < 1:
            gaits, repeats = self.confirm
            raise ValueError(
                f"confirm {gaits}x{repeats} leaves no trial of {self.trials} for the search: make more trials"
            )

    @property
    def search_trials(self) -> int:
        """Number of trials that the confirmation leaves for the search."""
        return self.trials - self.confirm[0] * self.confirm[1]


class Plan:
    """Chooses the next gait, in the search and then in the confirmation, and learns from its trial.

    Args:
        optimizer: told nothing so far.
        budget: limits of the run.
        trials: of the run, in order; whoever makes the plan adds each new one once it is on record.
    """

    def __init__(self, optimizer: Optimizer, budget: Budget, trials: Sequence[LoggedTrial]) -> None:
        self._trials = trials
        self.can_skip = False  # the last suggestion
        self._optimizer = optimizer
        self._budget = budget
        self._searched = 0
        self._confirmed: dict[Gait, list[float]] = {}
        self._finalists: tuple[Gait, ...] | None = None

    def remember(self) -> None:
        """Learn from the trials that the run has made before."""
        history = self._trials
        phases = [logged.suggestion.phase for logged in history]
        searched = phases.index(Phase.CONFIRMATION) if Phase.CONFIRMATION in phases else len(history)
        for logged in history:
            if logged.review.verdict is Verdict.SKIP and isinstance(self._optimizer, Skipping):
                self._optimizer.skip(logged.trial.gait)
        tell_history(self._optimizer, history[:searched])
        if searched < len(history):
            self._begin_confirmation(_gaits_of(history[searched:]))
            tell_history(self._optimizer, history, already=searched)
        for logged in history:
            self._count(logged)

    def next(self) -> Suggestion | None:
        """Return the next suggestion; None at the end of the run."""
        self.can_skip = False
        if (gait := asked_again(self._trials)) is not None:
            # One of the reference comes on top of the trials; one in the confirmation takes the next turn of its gait.
            return Suggestion(gait, "repeated for the operator", phase=self._trials[-1].suggestion.phase)
        if self._finalists is None and not self._is_search_over():
            if (gait := to_repeat(self._trials)) is not None:
                return Suggestion(gait, "repeats a suspect trial")
            reference = self._budget.reference
            if reference is not None and since_reference(self._trials) >= self._budget.reference_every:
                return Suggestion(reference, "reference", phase=Phase.REFERENCE)
            self.can_skip = isinstance(self._optimizer, Skipping)
            return self._optimizer.ask()
        finalists = self._begin_confirmation()
        repeats = [len(self._confirmed.get(gait, ())) for gait in finalists]
        fewest = min(repeats, default=0)
        is_decided = 0 < fewest == max(repeats) and self._is_decided(finalists)
        if not finalists or fewest >= self._budget.confirm[1] or is_decided:
            return None
        gait = finalists[repeats.index(fewest)]
        return Suggestion(gait, "confirmation", self._optimizer.predict([gait])[0], phase=Phase.CONFIRMATION)

    def describe(self, trial: Trial) -> str:
        """Return a trial in a few words, for the operator."""
        if not trial.outcome.is_valid:
            return trial.outcome.words
        return f"{1000.0 * score(trial, self._budget.score_name):.1f} mm/s"

    def judge(self, suggestion: Suggestion, trial: Trial, remarks: Remarks) -> LoggedTrial:
        """Return the record of a trial, scored if it is valid and not discarded; nothing is learned from it yet."""
        said = Review(remarks.notes, remarks.verdict, remarks.reason)
        if not trial.outcome.is_valid or remarks.verdict is Verdict.DISCARD:
            return replace(complete_record(suggestion, trial), review=said)
        speed_m_s = score(trial, self._budget.score_name)
        doubt = review_speed(trial.gait, speed_m_s, self._trials)
        review = replace(said, is_suspect=doubt.is_suspect, suspicion=doubt.suspicion)
        return replace(complete_record(suggestion, trial, speed_m_s), review=review)

    def learn_from(self, logged: LoggedTrial) -> LoggedTrial:
        """Learn from a trial that has a score; return its record with what is believed after it."""
        if logged.score is None:
            return logged
        tell_trial(self._optimizer, logged)
        self._count(logged)
        return replace(logged, recommendation=self._recommend(), fit=last_fit(self._optimizer))

    def skip(self, suggestion: Suggestion, number: int) -> LoggedTrial:
        """Return the record of a gait that the operator does not want to be driven."""
        assert isinstance(self._optimizer, Skipping)
        self._optimizer.skip(suggestion.gait)
        reason = "skipped by the operator"
        trial = Trial(number, suggestion.gait, Outcome.INTERRUPTED, reason, time.time(), duration_s=0.0)
        return LoggedTrial(suggestion, trial, None, None, review=Review(verdict=Verdict.SKIP))

    def _is_search_over(self) -> bool:
        if self._searched >= self._budget.search_trials:
            return True
        has_begun, stop_below = self._searched > 0, self._budget.stop_below
        return has_begun and stop_below > 0.0 and self._optimizer.improvement() < stop_below

    def _begin_confirmation(self, begun: Sequence[Gait] = ()) -> tuple[Gait, ...]:
        """Return the gaits to confirm. They are chosen once: their repeats must not change the choice.

        ``begun`` are those whose confirmation has begun in an earlier session, in order; they stay, whatever has been
        changed in the optimiser since.
        """
        if self._finalists is None:
            count = self._budget.confirm[0]
            chosen = self._optimizer.promising(count) if count > len(begun) else ()
            self._finalists = (*begun, *(gait for gait in chosen if gait not in begun))[:count]
        return self._finalists

    def _is_decided(self, finalists: Sequence[Gait]) -> bool:
        """Return whether the confirmation has found one gait better than the others, after whole rounds."""
        from vvvaltr.transfer.causes.evidence import find_best

        return find_best(list(zip(*map(self._confirmed.__getitem__, finalists), strict=True)), _CONFIDENCE) is not None

    def _count(self, logged: LoggedTrial) -> None:
        if logged.score is None:
            return
        self._searched += logged.suggestion.phase is Phase.SEARCH
        if logged.suggestion.phase is Phase.CONFIRMATION:
            self._confirmed.setdefault(logged.trial.gait, []).append(logged.score)

    def _recommend(self) -> Recommendation | None:
        if not self._finalists:
            try:
                best = self._optimizer.recommend()
            except NothingToRecommend:
                return None
        else:
            candidates = zip(self._finalists, self._optimizer.predict(self._finalists), strict=True)
            best = Recommendation(*max(candidates, key=lambda candidate: candidate[1].mean))
        return replace(best, estimate=as_speed(best.estimate, self._budget.score_name))


def _gaits_of(trials: Sequence[LoggedTrial]) -> tuple[Gait, ...]:
    """Return the different gaits that the valid trials drove, in order."""
    return tuple(dict.fromkeys(logged.trial.gait for logged in trials if logged.score is not None))
