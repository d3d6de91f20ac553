"""One trial from its suggestion to its record, for all who drive trials without an optimiser."""

from __future__ import annotations

from collections.abc import Callable

from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Suggestion
from vvvaltr.controller.loop.causes import fault_standing_motor
from vvvaltr.controller.loop.movement import complete_record
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialCrashed, TrialSettings, run_trial


def make_trial(
    robot: Robot,
    suggestion: Suggestion,
    settings: TrialSettings,
    number: int,
    record: Callable[[LoggedTrial], None],
    score_name: str = "net",
) -> LoggedTrial:
    """Drive the gait of ``suggestion`` once; return the trial, scored if it is valid, once it is recorded.

    Args:
        robot: with guarded motors.
        suggestion: what to drive, and why.
        settings: how the trial is run.
        number: of the trial.
        record: keeps it for good.
        score_name: what a valid trial is scored by.

    Raises:
        TrialCrashed: the program failed during the trial; it has been recorded.
    """
    try:
        trial = fault_standing_motor(run_trial(robot, suggestion.gait, settings, number))
    except TrialCrashed as crash:
        record(complete_record(suggestion, crash.trial))
        raise
    logged = complete_record(suggestion, trial, score(trial, score_name) if trial.outcome.is_valid else None)
    record(logged)
    return logged
