"""One gait, several times: how fast it is, and how sure that is."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Estimate, Outcome, Phase, Suggestion
from vvvaltr.controller.loop.one_trial import make_trial
from vvvaltr.controller.loop.trial_runner import TrialSettings

ORIGIN = "asked for"
"""Origin of the suggestions that a person made."""

_FAILURES_IN_A_ROW = 3  # after which somebody has to look at the robot


def repeat_trial(
    robot: Robot,
    gait: Gait,
    settings: TrialSettings,
    repeats: int,
    score_name: str,
    record: Callable[[LoggedTrial], None],
) -> Iterator[LoggedTrial]:
    """Drive ``gait`` several times; yields each trial once it is recorded.

    The trials end early after an interrupt, and after three failures in a row.

    Args:
        robot: with guarded motors.
        gait: what to drive.
        settings: how a trial is run.
        repeats: number of trials; a trial that failed counts, and has no score.
        score_name: what the trials are scored by.
        record: keeps a trial for good before the next begins.

    Raises:
        TrialCrashed: the program failed during a trial; it has been recorded.
    """
    failures, suggestion = 0, Suggestion(gait, ORIGIN, phase=Phase.ASKED)
    for number in range(1, repeats + 1):
        logged = make_trial(robot, suggestion, settings, number, record, score_name)
        yield logged
        outcome = logged.trial.outcome
        failures = 0 if outcome.is_valid else failures + 1
        if outcome is Outcome.INTERRUPTED or failures == _FAILURES_IN_A_ROW:
            return


def mean_with_interval(scores: Sequence[float]) -> Estimate | None:
    """Return the mean of two scores or more with its 95 % interval (Student's t); None for fewer."""
    from scipy.special import stdtrit  # here, because its import takes longer than most trials

    if len(scores) < 2:
        return None
    mean = math.fsum(scores) / len(scores)
    variance = math.fsum((it - mean) ** 2 for it in scores) / (len(scores) - 1)
    half = float(stdtrit(len(scores) - 1, 0.975)) * math.sqrt(variance / len(scores))
    return Estimate(mean, mean - half, mean + half)
