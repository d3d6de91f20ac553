"""What a run's own trials say of why they scatter: motors that stood still, a robot that lost strength, the floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import LoggedTrial, Review, Verdict
from vvvaltr.controller.core.values import Outcome, Phase, Trial
from vvvaltr.transfer.causes.floor import Drift, learn_drift
from vvvaltr.transfer.causes.pieces import weigh
from vvvaltr.transfer.causes.standing import Standing, describe_standing, is_far_below
from vvvaltr.transfer.causes.strength import Loss, find_loss
from vvvaltr.transfer.causes.turning import find_turning

_TURNS = 0.2  # share of its commanded frequency below which a motor does not turn
_SPUN_UP_S = 1.0  # since the drive began
_COMMANDED_HZ = 2.0  # below which a motor need not start
_RECENT = 60  # trials that are searched for a loss
_SAME_LOSS = 5  # trials by which the start of one loss may shift as more is known
_LEAST_TURN_RAD = 0.1  # without which a run does not tell the floor from the robot
_SHORTFALL = 0.85  # share of its set-point below which a motor falls short
_CURE = "check its wires and its board"
_STANDS_FOR = 0.3  # share of a drive's second half in which it must stand


def fault_standing_motor(trial: Trial) -> Trial:
    """Return the trial as faulted if a motor did not turn in it; else the trial itself.

    The device's measurements say it; where it has none, the shaking that a tracker of 45 Hz or more sees.
    """
    if not trial.outcome.is_valid or (reason := _measured_standing(trial) or _seen_standing(trial)) == "":
        return trial
    return replace(trial, outcome=Outcome.FAULTED, reason=reason)


def _measured_standing(trial: Trial) -> str:
    """Return which motor the device measured at rest, in words; empty for none.

    The second half of the drive counts, after its first second: motors have spun up by then, and one that stopped has
    stopped. A shorter drive is not judged.
    """
    measured_hz = _measured_late(trial)
    if measured_hz is None:
        return ""
    for motor, hz in enumerate(trial.gait.frequency_hz):
        stood = measured_hz[:, motor] < _TURNS * abs(hz)
        if abs(hz) >= _COMMANDED_HZ and stood.mean() > _STANDS_FOR:
            return f"motor {motor + 1} did not turn at {hz:.1f} Hz, its device says; {_CURE}"
    return ""


def _seen_standing(trial: Trial) -> str:
    """Return which motor the tracker did not see shaking, in words; empty for none, and where a device measures."""
    if any(state.measured for state in trial.states):
        return ""
    turned = find_turning(trial.poses, trial.gait.frequency_hz)
    stood = [motor for motor, it in enumerate(turned) if it is False]
    if not stood:
        return ""
    motors = " and ".join(f"motor {motor + 1} at {trial.gait.frequency_hz[motor]:.1f} Hz" for motor in stood)
    return f"{motors} did not turn: the tracker sees no shaking there, but that of other motors; {_CURE}"


def review_speed(gait: Gait, speed_m_s: float, history: Sequence[LoggedTrial]) -> Review:
    """Return what is said of a trial whose gait was driven before: suspect if it is far below those trials."""
    before = speeds_of(gait, history)
    if not is_far_below(speed_m_s, before):
        return Review()
    standing = describe_standing([*before, speed_m_s])
    told = f" it has {standing}" if standing.moving < standing.trials else ""  # no two groups can be told apart
    return Review(is_suspect=True, suspicion=f"far below what the gait did before, did a motor stand still?{told}")


def to_repeat(history: Sequence[LoggedTrial]) -> Gait | None:
    """Return the gait of a suspect trial, to be driven once more at once, unless that has been done."""
    valid = [logged for logged in history if logged.score is not None]
    if not valid or not valid[-1].review.is_suspect:
        return None
    if len(valid) > 1 and valid[-2].review.is_suspect and valid[-2].trial.gait == valid[-1].trial.gait:
        return None
    return valid[-1].trial.gait


def asked_again(history: Sequence[LoggedTrial]) -> Gait | None:
    """Return the gait of the last trial if the operator wants it driven once more."""
    return history[-1].trial.gait if history and history[-1].review.verdict is Verdict.REPEAT else None


def speeds_of(gait: Gait, history: Sequence[LoggedTrial]) -> list[float]:
    """Return the scores of a gait's valid trials."""
    return [logged.score for logged in history if logged.score is not None and logged.trial.gait == gait]


def find_standing_gaits(history: Sequence[LoggedTrial]) -> dict[Gait, Standing]:
    """Return how often each gait moves that stood still in some of its trials and moved in others."""
    speeds_m_s: dict[Gait, list[float]] = {}  # in one pass: a long run has as many gaits as trials
    for logged in history:
        if logged.score is not None:
            speeds_m_s.setdefault(logged.trial.gait, []).append(abs(logged.score))
    told = {gait: describe_standing(speeds) for gait, speeds in speeds_m_s.items() if len(speeds) > 1}
    return {gait: standing for gait, standing in told.items() if standing.moving < standing.trials}


def find_loss_in(history: Sequence[LoggedTrial]) -> tuple[Loss, int] | None:
    """Return the loss of strength that a run's trials tell, and the number of the first trial with it."""
    valid = [logged for logged in history if logged.score is not None][-_RECENT:]
    if len(valid) < 4:
        return None
    loss = _find_loss(*zip(*((it.trial.gait.frequency_hz, abs(it.score or 0.0)) for it in valid), strict=True))
    return None if loss is None or not loss.is_told else (loss, valid[loss.since].trial.number)


@lru_cache(4)  # loop and summary ask for the same trials
def _find_loss(frequency_hz: tuple[tuple[float, ...], ...], speeds_m_s: tuple[float, ...]) -> Loss | None:
    places = np.array(frequency_hz)
    return find_loss(places / max(float(np.ptp(places)), 1e-9), speeds_m_s)


def have_turned(trials: Sequence[Trial]) -> bool:
    """Return whether the robot had different headings, so that its trials tell its own drift from the floor's."""
    yaws_rad = [pose.yaw_rad for trial in trials for pose in trial.poses if pose.is_finite]
    turned_rad = [math.remainder(yaw_rad - yaws_rad[0], math.tau) for yaw_rad in yaws_rad]
    return bool(turned_rad) and max(turned_rad) - min(turned_rad) >= _LEAST_TURN_RAD


def find_drift_in(history: Sequence[LoggedTrial]) -> Drift | None:
    """Return the floor's drift from a run's valid trials; None where their poses do not tell it."""
    known = [logged for logged in history if logged.pieces]
    gaits = [logged.trial.gait for logged in known]
    return learn_drift(gaits, [logged.pieces for logged in known], [weigh(gait.frequency_hz) for gait in gaits])


def since_reference(history: Sequence[LoggedTrial]) -> int:
    """Return how many valid trials of the search followed the last one of the reference gait, or the start."""
    count = 0
    for logged in reversed(history):
        if logged.suggestion.phase is Phase.REFERENCE and logged.score is not None:
            break
        count += logged.suggestion.phase is Phase.SEARCH and logged.score is not None
    return count


class StrengthWatch:
    """Tells a loss of strength once, when it has become certain."""

    def __init__(self, history: Sequence[LoggedTrial]) -> None:
        found = find_loss_in(history)
        self._told_since = found[1] if found else 0

    def look(self, history: Sequence[LoggedTrial]) -> str:
        """Return what to tell after the last trial; empty for nothing new."""
        found = find_loss_in(history)
        if found is None or found[1] <= self._told_since + _SAME_LOSS:
            return ""
        loss, self._told_since = found
        return describe_loss(loss, self._told_since)


def describe_loss(loss: Loss, since: int) -> str:
    """Return a loss in words; ``since`` is the number of the first trial with it."""
    return (
        f"from trial {since} on the robot moves {loss.factor:.2f} times as far as before "
        f"({100.0 * loss.probability:.0f} % certain): battery, springs, floor?"
    )


class ShortfallWatch:
    """Sees motors that turn more slowly than they are told, trial after trial: the battery fades, or one is jammed."""

    def __init__(self) -> None:
        self._before = 0

    def look(self, trial: Trial) -> str:
        """Return what is wrong after a trial; empty for nothing, and where no sensor measures the motors."""
        motor, share = _worst_motor(trial)
        was, self._before = self._before, motor if share < _SHORTFALL else 0
        if not self._before or self._before != was:
            return ""
        self._before = 0
        return f"battery or stall: motor {motor} turned at {share:.0%} of its set-point in two trials"


def _worst_motor(trial: Trial) -> tuple[int, float]:
    """Return the motor that fell behind its set-point most, counted from 1, and its share of the set-point."""
    measured_hz = _measured_late(trial)
    if measured_hz is None or not trial.outcome.is_valid:
        return 0, 1.0
    mean_hz = np.median(measured_hz, axis=0)
    shares = [
        abs(float(mean_hz[motor] / hz)) if abs(hz) >= _COMMANDED_HZ else 1.0
        for motor, hz in enumerate(trial.gait.frequency_hz)
    ]
    share, motor = min((share, motor) for motor, share in enumerate(shares, start=1))
    return motor, share


def _measured_late(trial: Trial) -> Array | None:
    """Return the magnitudes (times, motors) that sensors measured in the second half of a drive, spun up by then.

    None where nothing was measured.
    """
    states = [state for state in trial.states if state.t_s > max(_SPUN_UP_S, 0.5 * trial.duration_s)]
    if not states or not all(state.measured for state in states):
        return None
    return np.abs([state.frequency_hz for state in states])
