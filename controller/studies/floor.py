"""The floor's drift, measured with a few trials of one gait at different headings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from vvvaltr.controller.core.errors import UserError, one_line_errors
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Outcome, Phase, Suggestion
from vvvaltr.controller.loop.causes import find_drift_in, have_turned
from vvvaltr.controller.loop.one_trial import make_trial
from vvvaltr.controller.loop.safety import GuardedRobot, Limits
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.controller.robot.choice import RobotChoice
from vvvaltr.controller.robot.opening import Rig, make_twin
from vvvaltr.transfer.causes.floor import Drift
from vvvaltr.twin.engine import Start
from vvvaltr.twin.robot import TwinRobot

_FAILURES_IN_A_ROW = 3  # after which somebody has to look at the robot


class TurnedTwin:
    """``Robot``: a twin that is put down at a chosen heading for each trial, whatever its scatter says."""

    def __init__(self, twin: TwinRobot) -> None:
        self.motors, self.tracker, self.clock = twin.motors, twin.tracker, twin.clock
        self.structure = twin.structure
        self.heading_rad = 0.0
        self._twin = twin

    def place(self, trial: int) -> None:
        """Put the twin down in the middle, at its heading."""
        self._twin.put_down(Start(yaw_rad=self.heading_rad))
        self._twin.carry_on(trial)

    def carry_on(self, trial: int) -> None:
        """Begin a trial where the twin is."""
        self._twin.carry_on(trial)

    def close(self) -> None:
        """Stop the motors. Idempotent."""
        self._twin.close()


def open_turned_twin(choice: RobotChoice, seed: int) -> tuple[Rig, TurnedTwin]:
    """Open a twin to be put down at chosen headings. Raises UserError where the choice is impossible."""
    with one_line_errors():
        twin = make_twin(choice, seed)
    turned = TurnedTwin(twin)
    return Rig(GuardedRobot(turned, Limits(twin.max_hz)), TrialSettings(), twin.range_hz), turned


def survey_floor(
    robot: Robot,
    gait: Gait,
    settings: TrialSettings,
    trials: int,
    turn: Callable[[int, float], None],
    record: Callable[[LoggedTrial], None],
) -> Iterator[LoggedTrial]:
    """Drive ``gait`` at headings all around; yields each trial once it is recorded.

    Args:
        robot: with guarded motors.
        gait: what to drive.
        settings: how a trial is run.
        trials: number of valid trials to make.
        turn: called with the trial's number and its heading in rad, to put the robot down like that.
        record: keeps a trial for good before the next begins.

    Raises:
        KeyboardInterrupt: the operator interrupted a trial; it has been recorded.
        UserError: several trials in a row have failed: the robot needs a hand.
        TrialCrashed: the program failed during a trial; it has been recorded.
    """
    suggestion = Suggestion(gait, "floor", phase=Phase.ASKED)
    done = failures = number = 0
    while done < trials:
        number += 1
        turn(number, math.tau * done / trials)
        logged = make_trial(robot, suggestion, settings, number, record)
        yield logged
        trial = logged.trial
        if trial.outcome is Outcome.INTERRUPTED:
            raise KeyboardInterrupt(trial.reason)
        done, failures = (done + 1, 0) if trial.outcome.is_valid else (done, failures + 1)
        if failures == _FAILURES_IN_A_ROW:
            raise UserError(f"{failures} trials in a row failed; the last one: {trial.ending}")


def find_drift(trials: Sequence[LoggedTrial]) -> Drift:
    """Return the floor's drift from all valid trials of a run.

    Raises:
        UserError: no trial has the poses that it takes.
    """
    valid = [logged.trial for logged in trials if logged.trial.outcome.is_valid]
    if not any(trial.poses for trial in valid):
        raise UserError("no valid trial has poses, so nothing tells the floor: imported trials have lengths alone")
    if not have_turned(valid):
        raise UserError(
            "the robot never headed elsewhere, or its poses have no heading, so nothing tells the floor from the "
            "robot: turn it between the trials; vvvaltr track shows headings"
        )
    drift = find_drift_in(trials)
    if drift is None:
        raise UserError("the trials are too short, or the robot did not move: give --duration 5 or a faster --gait")
    return drift


def describe_drift(drift: Drift, trials: int) -> dict[str, Any]:
    """Return the drift as plain data."""
    return {
        "drift_m_s": drift.velocity_m_s.tolist(),
        "sd_m_s": drift.deviation_m_s,
        "speed_m_s": drift.speed_m_s,
        "azimuth_rad": drift.azimuth_rad,
        "probability": drift.is_inclined,
        "is_inclined": drift.is_told,
        "trials": trials,
    }
