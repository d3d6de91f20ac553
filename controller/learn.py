"""The loop: ask, run, score, tell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from controller.interface import Optimizer, Robot, UserError
from controller.recording import LoggedTrial
from controller.scoring import score
from controller.trial_runner import TrialCrashed, TrialSettings, run_trial
from controller.types import Outcome, Source, Suggestion, Trial

_PATIENCE = 3  # failed trials in a row after which somebody has to look at the robot


@dataclass(frozen=True, slots=True)
class Budget:
    """How much a run may do: ``trials`` valid ones, each scored by the score named ``score_name``."""

    trials: int
    score_name: str = "net"


def learn(
    robot: Robot,
    optimizer: Optimizer,
    settings: TrialSettings,
    budget: Budget,
    record: Callable[[LoggedTrial], None],
    history: Sequence[LoggedTrial] = (),
) -> Iterator[LoggedTrial]:
    """Learn a gait; yields each trial once it is recorded.

    Only valid trials are observations. A failed one is recorded and its gait tried again.

    Args:
        robot: with guarded motors.
        optimizer: fresh; it is told ``history`` first, so a resumed run goes on as it would have.
        settings: how a trial is run.
        budget: when to end.
        record: keeps a trial for good before the next begins.
        history: the trials that the run already has.

    Raises:
        KeyboardInterrupt: the operator interrupted a trial; it has been recorded.
        UserError: several trials in a row have failed: the robot needs a hand.
        TrialCrashed: the program failed during a trial; it has been recorded.
    """
    trials = list(history)
    for logged in trials:
        if logged.score is not None:
            optimizer.tell(logged.trial.gait, logged.score)
    while sum(logged.score is not None for logged in trials) < budget.trials:
        suggestion = optimizer.ask()
        try:
            trial = run_trial(robot, suggestion.gait, settings, number=len(trials) + 1)
        except TrialCrashed as crash:
            record(LoggedTrial(suggestion, crash.trial, None, None))
            raise
        logged = _judge(optimizer, suggestion, trial, budget.score_name)
        record(logged)
        trials.append(logged)
        yield logged
        _stop_if_hopeless(trials[len(history) :])


def _judge(optimizer: Optimizer, suggestion: Suggestion, trial: Trial, score_name: str) -> LoggedTrial:
    if not trial.outcome.is_valid:
        return LoggedTrial(suggestion, trial, None, None)
    speed_m_s = score(trial, score_name)
    optimizer.tell(trial.gait, speed_m_s)
    return LoggedTrial(suggestion, trial, speed_m_s, optimizer.recommend())


def _stop_if_hopeless(trials: Sequence[LoggedTrial]) -> None:
    last = trials[-1].trial
    if last.outcome is Outcome.INTERRUPTED:
        raise KeyboardInterrupt(last.reason)
    if len(trials) >= _PATIENCE and all(logged.score is None for logged in trials[-_PATIENCE:]):
        raise UserError(f"{_PATIENCE} trials in a row failed, the last one so: {last.outcome}: {last.reason}")


def source_from(name: str, trials: Sequence[LoggedTrial], score_name: str) -> Source:
    """Return the valid trials of another run, scored as this run scores.

    Raises:
        ValueError: it has none.
    """
    valid = [logged.trial for logged in trials if logged.score is not None]
    scores = tuple(score(trial, score_name) for trial in valid)
    return Source(name, tuple(trial.gait for trial in valid), scores)


def summary(trials: Sequence[LoggedTrial]) -> dict[str, Any]:
    """Return what a run found, as plain data: what was seen and what is believed are kept apart."""
    valid = [logged for logged in trials if logged.score is not None]
    best = max(valid, key=lambda logged: logged.score or 0.0, default=None)
    recommendation = valid[-1].recommendation if valid else None
    return {
        "trials": len(trials),
        "outcomes": dict(Counter(logged.trial.outcome.value for logged in trials)),
        "best_observed": best
        and {
            "trial": best.trial.number,
            "gait_hz": list(best.trial.gait.frequency_hz),
            "score_m_s": best.score,
        },
        "recommended": recommendation
        and {
            "gait_hz": list(recommendation.gait.frequency_hz),
            "mean_m_s": recommendation.estimate.mean,
            "low_m_s": recommendation.estimate.low,
            "high_m_s": recommendation.estimate.high,
        },
    }
