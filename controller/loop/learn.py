"""The loop: ask, run, score, tell."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from functools import partial
from itertools import count

from vvvaltr.controller.core.ask_tell import complete
from vvvaltr.controller.core.attending import Wish
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.protocols import AskTell, Observer, Robot
from vvvaltr.controller.core.records import EventKind, LoggedTrial, Verdict
from vvvaltr.controller.core.values import Outcome, Source, Suggestion
from vvvaltr.controller.loop.attendance import Attendance
from vvvaltr.controller.loop.causes import ShortfallWatch, StrengthWatch, fault_standing_motor
from vvvaltr.controller.loop.memory import Memory
from vvvaltr.controller.loop.movement import complete_record
from vvvaltr.controller.loop.observing import Followers, describe_end
from vvvaltr.controller.loop.plan import Budget, Plan
from vvvaltr.controller.loop.putting_back import Placement
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialCrashed, TrialSettings, run_trial

_FAILURES_IN_A_ROW = 3  # after which the operator must look at the robot


def learn(
    robot: Robot,
    optimizer: AskTell,
    settings: TrialSettings,
    budget: Budget,
    record: Callable[[LoggedTrial], None],
    history: Sequence[LoggedTrial] = (),
    observers: Sequence[Observer] = (),
    attendance: Attendance | None = None,
) -> Generator[LoggedTrial, None, None]:
    """Learn a gait; yields each trial once it is recorded.

    Only valid trials are told to the optimiser. A failed trial is recorded, and its gait is tried again.

    Args:
        robot: with guarded motors.
        optimizer: told nothing so far. It is told ``history`` first, so that a resumed run continues as it would have
            without the break. ``ask`` and ``tell`` suffice: ``ask_tell.complete`` fills in the rest.
        settings: settings of every trial.
        budget: limits of the run.
        record: writes a trial to the log before the next trial begins. Its failure ends the run.
        history: earlier trials of the run. The new ones are added to a ``Memory`` that is given here.
        observers: told of each trial once it is recorded, and of events; their failure does not end the run.
        attendance: sees to it that each trial can begin, and asks the operator; None where nobody is there.

    Raises:
        KeyboardInterrupt: the operator interrupted a trial; it has been recorded.
        UserError: the robot needs its operator, who is not there: several trials in a row have failed, a motor falls
            short of its set-points, or the robot has to be put back.
        TrialCrashed: the program failed during a trial; it has been recorded.
    """
    memory = history if isinstance(history, Memory) else Memory(history)
    plan = Plan(complete(optimizer), budget, memory)

    def keep(logged: LoggedTrial) -> None:
        record(logged)
        memory.append(logged)

    followers = Followers(observers)
    attendance = attendance or Attendance(robot, Placement())
    attendance.announce = partial(followers.announce, EventKind.WAITING)
    followers.announce(EventKind.BEGIN, f"{len(memory)} trials made, {budget.trials} valid ones wanted")
    try:
        strength = StrengthWatch(memory)
        for logged in _make_trials(attendance, plan, settings, keep, len(memory) + 1):
            followers.show(logged)
            if logged.score is not None and (news := strength.look(memory)):
                followers.announce(EventKind.WARNING, news)
                attendance.pause(news)
            yield logged
    except BaseException as error:
        followers.announce(EventKind.END, describe_end(error))
        raise
    followers.announce(EventKind.END, "ended early by the operator" if attendance.is_ending else "complete")


def _make_trials(
    attendance: Attendance,
    plan: Plan,
    settings: TrialSettings,
    keep: Callable[[LoggedTrial], None],
    first: int,
) -> Iterator[LoggedTrial]:
    """Ask, run, score, tell; yields each trial once it is recorded."""
    plan.remember()
    troubles = _Troubles(attendance)
    for number in count(first):
        if (suggestion := plan.next()) is None:
            return
        match attendance.prepare(number, plan.can_skip):
            case Wish.END:
                return
            case Wish.SKIP:
                logged = plan.skip(suggestion, number)
            case _:
                logged = yield from _make_trial(attendance, plan, suggestion, settings, keep, number)
        keep(logged)
        yield logged
        troubles.look(logged)


def _make_trial(
    attendance: Attendance,
    plan: Plan,
    suggestion: Suggestion,
    settings: TrialSettings,
    keep: Callable[[LoggedTrial], None],
    number: int,
) -> Generator[LoggedTrial, None, LoggedTrial]:
    """Return a trial, judged by the operator, scored and learned from.

    Yields one in which the program failed, and one from which an interrupt kept the optimiser from learning: a resumed
    run learns from it.
    """
    attendance.begin(number)
    try:
        trial = fault_standing_motor(run_trial(attendance.robot, suggestion.gait, settings, number))
    except TrialCrashed as crash:
        logged = complete_record(suggestion, crash.trial)
        keep(logged)
        yield logged
        raise
    trial, remarks = attendance.review(trial, plan.describe(trial))
    logged = plan.judge(suggestion, trial, remarks)
    try:
        return plan.learn_from(logged)
    except KeyboardInterrupt:
        keep(logged)
        yield logged
        raise


class _Troubles:
    """Ends the run, or pauses it where an operator can help, when it makes no sense to go on."""

    def __init__(self, attendance: Attendance) -> None:
        self._attendance = attendance
        self._failures = 0
        self._shortfall = ShortfallWatch()

    def look(self, logged: LoggedTrial) -> None:
        """Look at one more trial. Raises KeyboardInterrupt, or UserError with the reason."""
        self._attendance.raise_interrupt()
        trial = logged.trial
        if trial.outcome is Outcome.INTERRUPTED:
            if self._attendance.has_stopped or logged.review.verdict is Verdict.SKIP:
                return
            raise KeyboardInterrupt(trial.reason)
        self._failures = 0 if trial.outcome.is_valid else self._failures + 1
        if self._failures >= _FAILURES_IN_A_ROW:
            self._pause(f"{self._failures} trials in a row failed; the last one: {trial.ending}")
            self._failures = 0
        if news := self._shortfall.look(trial):
            self._pause(f"{news}; charge the battery, look at the motor")

    def _pause(self, reason: str) -> None:
        if not self._attendance.pause(reason):
            raise UserError(reason)


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
