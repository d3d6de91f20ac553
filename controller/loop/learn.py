"""The loop: ask, run, score, tell."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

from vvvaltr.controller.core.ask_tell import complete, last_fit, tell_history, tell_trial
from vvvaltr.controller.core.errors import NothingToRecommend, UserError
from vvvaltr.controller.core.protocols import AskTell, Observer, Optimizer, Robot
from vvvaltr.controller.core.records import EventKind, LoggedTrial
from vvvaltr.controller.core.values import Gait, Outcome, Phase, Recommendation, Source, Suggestion, Trial
from vvvaltr.controller.loop.causes import StrengthWatch, fault_standing_motor, review_speed, since_reference, to_repeat
from vvvaltr.controller.loop.movement import complete_record
from vvvaltr.controller.loop.observing import Followers, describe_end
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialCrashed, TrialSettings, run_trial

_CONFIDENCE = 0.95  # at which the confirmation ends early

_FAILURES_IN_A_ROW = 3  # after which the operator must look at the robot


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
            raise ValueError(f"confirm {gaits}x{repeats} leaves no trial of {self.trials} for the search")

    @property
    def search_trials(self) -> int:
        """Number of trials that the confirmation leaves for the search."""
        return self.trials - self.confirm[0] * self.confirm[1]


def learn(
    robot: Robot,
    optimizer: AskTell,
    settings: TrialSettings,
    budget: Budget,
    record: Callable[[LoggedTrial], None],
    history: Sequence[LoggedTrial] = (),
    observers: Sequence[Observer] = (),
) -> Iterator[LoggedTrial]:
    """Learn a gait; yields each trial once it is recorded.

    Only valid trials are told to the optimiser. A failed trial is recorded, and its gait is tried again.

    Args:
        robot: with guarded motors.
        optimizer: told nothing so far. It is told ``history`` first, so that a resumed run continues as it would have
            without the break. ``ask`` and ``tell`` suffice: ``ask_tell.complete`` fills in the rest.
        settings: settings of every trial.
        budget: limits of the run.
        record: writes a trial to the log before the next trial begins. Its failure ends the run.
        history: earlier trials of the run.
        observers: told of each trial once it is recorded, and of events; their failure does not end the run.

    Raises:
        KeyboardInterrupt: the operator interrupted a trial; it has been recorded.
        UserError: several trials in a row have failed, so the robot needs its operator.
        TrialCrashed: the program failed during a trial; it has been recorded.
    """
    plan = _Plan(complete(optimizer), budget)
    followers = Followers(observers)
    followers.announce(EventKind.BEGIN, f"{len(history)} trials made, {budget.trials} valid ones wanted")
    try:
        strength = StrengthWatch(history)
        for logged in _make_trials(robot, plan, settings, record, history):
            followers.show(logged)
            if logged.score is not None and (news := strength.look(plan.trials)):
                followers.announce(EventKind.WARNING, news)
            yield logged
    except BaseException as error:
        followers.announce(EventKind.END, describe_end(error))
        raise
    followers.announce(EventKind.END, "complete")


def _make_trials(
    robot: Robot,
    plan: _Plan,
    settings: TrialSettings,
    record: Callable[[LoggedTrial], None],
    history: Sequence[LoggedTrial],
) -> Iterator[LoggedTrial]:
    """Ask, run, score, tell; yields each trial once it is recorded."""
    plan.remember(history)
    failures = 0
    for number in count(len(history) + 1):
        if (suggestion := plan.next()) is None:
            return
        try:
            trial = fault_standing_motor(run_trial(robot, suggestion.gait, settings, number))
        except TrialCrashed as crash:
            logged = complete_record(suggestion, crash.trial)
            record(logged)
            yield logged
            raise
        logged = plan.judge(suggestion, trial)
        record(logged)
        yield logged
        failures = 0 if trial.outcome.is_valid else failures + 1
        _stop_if_hopeless(trial, failures)


class _Plan:
    """Chooses the next gait, in the search and then in the confirmation, and learns from its trial."""

    def __init__(self, optimizer: Optimizer, budget: Budget) -> None:
        self.trials: list[LoggedTrial] = []
        self._optimizer = optimizer
        self._budget = budget
        self._searched = 0
        self._confirmed: list[float] = []
        self._finalists: tuple[Gait, ...] | None = None

    def remember(self, history: Sequence[LoggedTrial]) -> None:
        """Learn from the earlier trials of the run."""
        phases = [logged.suggestion.phase for logged in history]
        searched = phases.index(Phase.CONFIRMATION) if Phase.CONFIRMATION in phases else len(history)
        tell_history(self._optimizer, history[:searched])
        if searched < len(history):
            self._begin_confirmation(_gaits_of(history[searched:]))
            tell_history(self._optimizer, history, already=searched)
        self.trials = list(history)
        for logged in history:
            if logged.score is not None:
                self._count(logged.suggestion, logged.score)

    def next(self) -> Suggestion | None:
        """Return the next suggestion; None at the end of the run."""
        if self._finalists is None and not self._is_search_over():
            if (gait := to_repeat(self.trials)) is not None:
                return Suggestion(gait, "repeats a suspect trial")
            reference = self._budget.reference
            if reference is not None and since_reference(self.trials) >= self._budget.reference_every:
                return Suggestion(reference, "reference", phase=Phase.REFERENCE)
            return self._optimizer.ask()
        finalists = self._begin_confirmation()
        if len(self._confirmed) == len(finalists) * self._budget.confirm[1] or self._is_decided(len(finalists)):
            return None
        gait = finalists[len(self._confirmed) % len(finalists)]
        return Suggestion(gait, "confirmation", self._optimizer.predict([gait])[0], phase=Phase.CONFIRMATION)

    def judge(self, suggestion: Suggestion, trial: Trial) -> LoggedTrial:
        """Return the record of a trial; a valid one is scored and learned from first."""
        if not trial.outcome.is_valid:
            return self._keep(complete_record(suggestion, trial))
        speed_m_s = score(trial, self._budget.score_name)
        review = review_speed(trial.gait, speed_m_s, self.trials)
        logged = replace(complete_record(suggestion, trial, speed_m_s), review=review)
        tell_trial(self._optimizer, logged)
        self._count(suggestion, speed_m_s)
        return self._keep(replace(logged, recommendation=self._recommend(), fit=last_fit(self._optimizer)))

    def _keep(self, logged: LoggedTrial) -> LoggedTrial:
        self.trials.append(logged.without_recordings())  # which are in the log: a long run must not fill the memory
        return logged

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

    def _is_decided(self, finalists: int) -> bool:
        """Return whether the confirmation has found one gait better than the others, after a whole round."""
        rounds, started = divmod(len(self._confirmed), finalists)
        if started or rounds < 2:
            return False
        from vvvaltr.transfer.causes.evidence import find_best

        table = [self._confirmed[index * finalists : (index + 1) * finalists] for index in range(rounds)]
        return find_best(table, _CONFIDENCE) is not None

    def _count(self, suggestion: Suggestion, speed_m_s: float) -> None:
        self._searched += suggestion.phase is Phase.SEARCH
        if suggestion.phase is Phase.CONFIRMATION:
            self._confirmed.append(speed_m_s)

    def _recommend(self) -> Recommendation | None:
        if not self._finalists:
            try:
                return self._optimizer.recommend()
            except NothingToRecommend:
                return None
        candidates = zip(self._finalists, self._optimizer.predict(self._finalists), strict=True)
        return Recommendation(*max(candidates, key=lambda candidate: candidate[1].mean))


def _gaits_of(trials: Sequence[LoggedTrial]) -> tuple[Gait, ...]:
    """Return the different gaits that the valid trials drove, in order."""
    return tuple(dict.fromkeys(logged.trial.gait for logged in trials if logged.score is not None))


def _stop_if_hopeless(trial: Trial, failures: int) -> None:
    if trial.outcome is Outcome.INTERRUPTED:
        raise KeyboardInterrupt(trial.reason)
    if failures >= _FAILURES_IN_A_ROW:
        raise UserError(f"{failures} trials in a row failed; the last one: {trial.outcome}: {trial.reason}")


def make_source(name: str, trials: Iterable[LoggedTrial], score_name: str) -> Source:
    """Return the valid trials of another run as a source, with the score called ``score_name``.

    Raises:
        ValueError: there is no valid trial, or the trials were imported and have no path to compute this score from.
    """
    valid = [
        (logged.trial.gait, _score_again(name, logged, score_name)) for logged in trials if logged.score is not None
    ]
    return Source(name, tuple(gait for gait, _ in valid), tuple(score for _, score in valid))


def _score_again(name: str, logged: LoggedTrial, score_name: str) -> float:
    if logged.trial.poses:
        return score(logged.trial, score_name)
    # Trials measured elsewhere have a net speed and no path.
    if logged.score is None or score_name != "net":
        raise ValueError(f"source {name}: imported trials have a net speed only: leave out --score {score_name}")
    return logged.score
