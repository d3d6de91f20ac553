"""The robot of a run, opened again for further trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.opening import Rig, is_left, open_rig
from vvvaltr.controller.runs.config import RunConfig

_JUMP_M = 0.1  # between two trials: no robot moves so far at rest
_BROKEN_OFF = (Outcome.INTERRUPTED, Outcome.CRASHED)
_FORMER_HEADING_LIMIT_RAD = 1.0  # of runs on twins that do not name theirs


def _heading_limit_rad(config: RunConfig, rig: Rig) -> float | None:
    """Return the greatest change of heading of a run's trials."""
    if config.heading_limit_rad is not None:
        return config.heading_limit_rad
    return _FORMER_HEADING_LIMIT_RAD if config.robot.is_twin else rig.settings.heading_limit_rad


def settings_of(config: RunConfig, rig: Rig) -> TrialSettings:
    """Return how the run's trials are run."""
    return replace(rig.settings, duration_s=config.duration_s, heading_limit_rad=_heading_limit_rad(config, rig))


def reopen_rig(config: RunConfig, trials: Sequence[LoggedTrial]) -> Rig:
    """Open the robot of a run for further trials.

    A twin that is left where it stopped drives again what it drove since it was put down: its posture, which no tracker
    sees, is then the same bit for bit. Where a drive cannot be repeated, as one that was interrupted, the twin is put
    down upright where the log saw it last.
    """
    tail = _since_put_down(trials)
    if is_left(config.robot) and not any(logged.trial.outcome in _BROKEN_OFF for logged in tail):
        rig = open_rig(config.robot, config.seed)
        settings, ended = settings_of(config, rig), None
        for logged in tail:
            ended = run_trial(rig.robot, logged.trial.gait, settings, logged.trial.number).end
        if not tail or ended == tail[-1].trial.end:
            return rig
        rig.robot.close()
    return open_rig(config.robot, config.seed, _last_place(trials))


def _since_put_down(trials: Sequence[LoggedTrial]) -> Sequence[LoggedTrial]:
    """Return the trials since the robot was last put down, as far as the log is sure of it: it jumped."""
    for later in range(len(trials) - 1, 0, -1):
        before, after = trials[later - 1].movement, trials[later].movement
        if before and after and math.dist(before.end.position_m, after.start.position_m) > _JUMP_M:
            return trials[later:]
    return trials


def _last_place(trials: Sequence[LoggedTrial]) -> RestingPose | None:
    """Return where the robot came to rest, as far as it was seen."""
    return next((it.movement.end for it in reversed(trials) if it.movement is not None), None)
