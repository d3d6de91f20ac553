"""A run as a table: one row a trial, one named column a number or text. docs/log.md lists the columns."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Estimate

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vvvaltr.controller.core.records import LoggedTrial
    from vvvaltr.controller.core.resting import RestingPose


@dataclass(frozen=True, slots=True)
class _Column:
    """A column: its name, numpy's code of its type (``U`` for text of any length), and its value for a trial."""

    name: str
    kind: str
    value: Callable[[LoggedTrial], Any]


def make_table(trials: Sequence[LoggedTrial]) -> NDArray[np.void]:
    """Return the trials as a structured array, shape (trials,). What is not known is NaN, 0, False or empty text."""
    import numpy as np  # here, so that the command line's help need not wait for it

    motors = max((logged.trial.gait.motor_count for logged in trials), default=0)
    columns = _columns(motors)
    cells = {column.name: [column.value(logged) for logged in trials] for column in columns}
    types = [(column.name, _type(column.kind, cells[column.name])) for column in columns]
    table = np.empty(len(trials), types)
    for name, values in cells.items():
        table[name] = values
    return table


def _type(kind: str, values: Iterable[Any]) -> str:
    if kind != "U":
        return kind
    return f"U{max((len(value) for value in values), default=1) or 1}"


def _columns(motors: int) -> list[_Column]:
    return [
        _Column("number", "i8", lambda it: it.trial.number),
        _Column("outcome", "U", lambda it: it.trial.outcome.value),
        _Column("reason", "U", lambda it: it.trial.reason),
        _Column("phase", "U", lambda it: it.suggestion.phase.value),
        _Column("origin", "U", lambda it: it.suggestion.origin),
        *_gait_columns("motor_{}", motors, lambda it: it.trial.gait),
        *(_Column(f"applied_{m + 1}_hz", "f8", partial(_applied_hz, motor=m)) for m in range(motors)),
        _Column("applied_measured", "?", lambda it: it.applied is not None and it.applied.measured),
        _Column("score_m_s", "f8", lambda it: _known(it.score)),
        *(_Column(key, "f8", partial(_displacement, key=key)) for key in ("forward_m", "left_m", "turn_rad")),
        _Column("is_within_error", "?", lambda it: it.movement is not None and it.movement.is_within_error),
        *_rest_columns("start", lambda it: it.movement.start if it.movement else None),
        *_rest_columns("end", lambda it: it.movement.end if it.movement else None),
        _Column("duration_s", "f8", lambda it: it.trial.duration_s),
        _Column("started_unix_s", "f8", lambda it: it.trial.started_unix_s),
        _Column("session_s", "f8", lambda it: _known(it.trial.conditions.session_s)),
        _Column("battery_v", "f8", lambda it: _known(it.trial.conditions.battery_v)),
        _Column("battery_changed", "?", lambda it: it.trial.conditions.battery_changed),
        _Column("dropped_poses", "i8", lambda it: it.trial.conditions.dropped_poses),
        _Column("tracker_offset_s", "f8", lambda it: _known(it.trial.conditions.tracker_offset_s)),
        _Column("tracker_jitter_s", "f8", lambda it: _known(it.trial.conditions.tracker_jitter_s)),
        *_estimate_columns("expected", lambda it: it.suggestion.expected),
        *_gait_columns("recommended_{}", motors, lambda it: it.recommendation.gait if it.recommendation else None),
        *_estimate_columns("recommended", lambda it: it.recommendation.estimate if it.recommendation else None),
        _Column("verdict", "U", lambda it: it.review.verdict.value if it.review.verdict else ""),
        _Column("verdict_reason", "U", lambda it: it.review.verdict_reason),
        _Column("notes", "U", lambda it: it.review.notes),
        _Column("is_suspect", "?", lambda it: it.review.is_suspect),
        _Column("suspicion", "U", lambda it: it.review.suspicion),
    ]


def _gait_columns(prefix: str, motors: int, gait: Callable[[LoggedTrial], Gait | None]) -> Iterable[_Column]:
    """Return the frequencies of all motors, then their phases, then their amplitudes."""
    for field, unit in (("frequency_hz", "_hz"), ("phase_rad", "_phase_rad"), ("amplitude", "_amplitude")):
        for motor in range(motors):
            value = partial(_of_motor, gait=gait, field=field, motor=motor)
            yield _Column(prefix.format(motor + 1) + unit, "f8", value)


def _of_motor(logged: LoggedTrial, gait: Callable[[LoggedTrial], Gait | None], field: str, motor: int) -> float:
    found = gait(logged)
    return _entry(() if found is None else getattr(found, field), motor)


def _applied_hz(logged: LoggedTrial, motor: int) -> float:
    return _entry(() if logged.applied is None else logged.applied.mean_hz, motor)


def _displacement(logged: LoggedTrial, key: str) -> float:
    return math.nan if logged.movement is None else _known(getattr(logged.movement.displacement, key))


def _rest_columns(prefix: str, rest: Callable[[LoggedTrial], RestingPose | None]) -> Iterable[_Column]:
    for axis, key in enumerate(("x_m", "y_m")):
        yield _Column(f"{prefix}_{key}", "f8", partial(_axis_of, rest=rest, axis=axis))
    for key in ("yaw_rad", "position_sd_m", "yaw_sd_rad"):
        yield _Column(f"{prefix}_{key}", "f8", partial(_field_of, part=rest, field=key))
    yield _Column(f"{prefix}_face", "i8", lambda it: found.face if (found := rest(it)) else 0)


def _axis_of(logged: LoggedTrial, rest: Callable[[LoggedTrial], RestingPose | None], axis: int) -> float:
    found = rest(logged)
    return math.nan if found is None else found.position_m[axis]


def _estimate_columns(prefix: str, estimate: Callable[[LoggedTrial], Estimate | None]) -> Iterable[_Column]:
    for key in ("mean", "low", "high"):
        yield _Column(f"{prefix}_{key}_m_s", "f8", partial(_field_of, part=estimate, field=key))


def _field_of(logged: LoggedTrial, part: Callable[[LoggedTrial], object | None], field: str) -> float:
    found = part(logged)
    return math.nan if found is None else _known(getattr(found, field))


def _entry(values: Sequence[float], motor: int) -> float:
    return values[motor] if motor < len(values) else math.nan


def _known(number: float | None) -> float:
    return math.nan if number is None else number
