"""`vvvaltr import`: trials measured elsewhere become a run that others can learn from."""

from __future__ import annotations

import json
import math
import time
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import number
from vvvaltr.controller.cli.telling import counted
from vvvaltr.controller.core.conditions import GREATEST_SPEED_M_S
from vvvaltr.controller.core.errors import NotUnderstood, UserError

if TYPE_CHECKING:
    from vvvaltr.controller.core.records import LoggedTrial, Movement
    from vvvaltr.controller.runs.foreign_table import ForeignTable, Row

_HZ: Mapping[str, float] = MappingProxyType({"hz": 1.0, "rpm": 1.0 / 60.0, "rad/s": 1.0 / math.tau})
_RAD: Mapping[str, float] = MappingProxyType({"rad": 1.0, "deg": math.pi / 180.0})
_METRES: Mapping[str, float] = MappingProxyType({"mm": 1e-3, "m": 1.0})
_M_S: Mapping[str, float] = MappingProxyType({"mm/s": 1e-3, "m/s": 1.0})
_GREATEST_HZ = 10_000.0  # beyond this it is a mistake, in the table or in the unit
_KEEP, _DROP = "keep", "drop"


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "csv", type=Path, metavar="CSV", help="table with a line of column names, then one line per trial"
    )
    parser.add_argument(
        "--gait", required=True, metavar="COLUMN,...", help="columns of the frequencies, one per motor, in order"
    )
    parser.add_argument(
        "--unit",
        required=True,
        choices=tuple(_HZ),
        metavar="UNIT",
        help=f"unit of these columns: {', '.join(_HZ)}; the sign is the direction of rotation",
    )
    measured = parser.add_mutually_exclusive_group(required=True)
    measured.add_argument(
        "--score", metavar="COLUMN,...", help="column of the net displacement or speed; several are repeats of a gait"
    )
    measured.add_argument(
        "--movement",
        metavar="DX,DY[,YAW]",
        help="columns of the displacement forward and to the left, in the frame that the robot has at its start, and "
        "of its turn",
    )
    parser.add_argument(
        "--score-unit",
        required=True,
        choices=(*_METRES, *_M_S),
        metavar="UNIT",
        help=f"unit of these columns: {', '.join((*_METRES, *_M_S))}; displacements only with --movement",
    )
    parser.add_argument(
        "--yaw-unit",
        choices=tuple(_RAD),
        metavar="UNIT",
        help="unit of the turn: rad or deg; needed with the column YAW",
    )
    parser.add_argument(
        "--zero",
        choices=(_KEEP, _DROP),
        metavar="WHAT",
        help="what a score of exactly 0 is: keep it, for the robot stood still; or drop it, for nothing was measured; "
        "needed where there is one",
    )
    parser.add_argument("--duration", dest="duration_s", type=number(above=0), metavar="S",
                        help="duration of each trial, in s; needed if the score is a displacement")  # fmt: skip
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="new directory for the run")


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.loop.summary import summarise

    if arguments.out.exists():
        raise UserError(f"--out {arguments.out} exists: choose another name, or move it away")
    trials = list(_trials(arguments))
    if not trials:
        raise NotUnderstood(f"{arguments.csv} has no trial: it needs a line of numbers below the column names")
    result = {"run": str(arguments.out), **summarise(trials)}
    try:
        _write_run(arguments.out, trials, json.dumps(result, indent=2) + "\n")
    except OSError as error:
        raise UserError(
            f"--out {arguments.out} cannot be made: {error.strerror}; choose another --out, or make room"
        ) from None
    best = result["best_observed"]
    return Answer(
        f"{counted(len(trials), 'trial')}, the fastest {1000.0 * best['score_m_s']:.1f} mm/s\n"
        f"learn from them: vvvaltr learn --source {arguments.out}",
        result,
    )


def _write_run(path: Path, trials: Sequence[LoggedTrial], found: str) -> None:
    """Make the run's directory. Raises OSError, and then nothing is in its place."""
    from vvvaltr.controller.core.disk import new_folder, write_whole
    from vvvaltr.controller.runs.log import LOG_NAME, RunLog, describe_maker

    with new_folder(path) as fresh:
        RunLog.create(fresh / LOG_NAME, structure=None, about=describe_maker("imported"), trials=trials).close()
        write_whole(fresh / "summary.json", found)


@dataclass(frozen=True, slots=True)
class _Measured:
    """What one trial of the table measured."""

    speed_m_s: float
    movement: Movement | None = None


_Measure: TypeAlias = "Callable[[ForeignTable, Row, str], Iterator[_Measured]]"


def _trials(arguments: Namespace) -> Iterator[LoggedTrial]:
    from vvvaltr.controller.core.gaits import Gait
    from vvvaltr.controller.core.records import LoggedTrial
    from vvvaltr.controller.core.values import Outcome, Suggestion, Trial
    from vvvaltr.controller.runs.foreign_table import read_foreign_table

    hz = _HZ[arguments.unit]
    motors = _names(arguments.gait)
    measure = _of_movements(arguments) if arguments.movement else _of_scores(arguments)
    columns = [*motors, *_names(arguments.movement or arguments.score)]
    if twice := [name for name, count in Counter(columns).items() if count > 1]:
        raise NotUnderstood(f"column {twice[0]!r} is named twice: each motor and each score has its own")
    table = read_foreign_table(arguments.csv, columns)
    now_unix_s, number = time.time(), 0
    for row in table.rows:
        where = f"{arguments.csv}, line {row.line}"
        pairs = ((column, table.number(row, place)) for place, column in enumerate(motors))
        gait = Gait(tuple(_converted(where, column, value, hz, "Hz", _GREATEST_HZ) for column, value in pairs))
        for measured in measure(table, row, where):
            number += 1
            trial = Trial(number, gait, Outcome.COMPLETED, "", now_unix_s, arguments.duration_s or 0.0)
            suggestion = Suggestion(gait, "imported")
            yield LoggedTrial(suggestion, trial, measured.speed_m_s, None, movement=measured.movement)


def _names(columns: str) -> list[str]:
    return [column.strip() for column in columns.split(",")]


def _of_scores(arguments: Namespace) -> _Measure:
    """Return what reads the scores of a row: each cell of the scores' columns is a trial."""
    m_s, names, motors = _speed_factor(arguments), _names(arguments.score), len(_names(arguments.gait))

    def measure(table: ForeignTable, row: Row, where: str) -> Iterator[_Measured]:
        for place, name in enumerate(names, start=motors):
            if len(names) > 1 and not row.cells[place]:
                continue  # fewer repeats than other gaits had
            value = table.number(row, place)
            if value < 0.0:
                raise NotUnderstood(f"{where}: {name} is {value:g}; allowed: 0 or more")
            if _is_kept(value, name, where, arguments.zero):
                yield _Measured(_converted(where, name, value, m_s, "m/s", GREATEST_SPEED_M_S))

    return measure


def _of_movements(arguments: Namespace) -> _Measure:
    """Return what reads the movement of a row."""
    names, motors = _names(arguments.movement), len(_names(arguments.gait))
    if not 2 <= len(names) <= 3:
        raise NotUnderstood(f"--movement {arguments.movement}: name two columns, DX,DY, or three, DX,DY,YAW")
    if arguments.score_unit not in _METRES:
        raise NotUnderstood(f"--score-unit {arguments.score_unit}: a movement is a displacement, in mm or m")
    if (len(names) == 3) != (arguments.yaw_unit is not None):
        raise NotUnderstood("--yaw-unit says whether the third column of --movement is in rad or deg: give both")
    m_s, metres = _speed_factor(arguments), _METRES[arguments.score_unit]
    rad = _RAD[arguments.yaw_unit or "rad"]

    def measure(table: ForeignTable, row: Row, where: str) -> Iterator[_Measured]:
        dx, dy, *turn = (table.number(row, motors + place) for place in range(len(names)))
        way = math.hypot(dx, dy)
        if _is_kept(way, f"{names[0]} and {names[1]}", where, arguments.zero):
            speed_m_s = _converted(where, names[0], way, m_s, "m/s", GREATEST_SPEED_M_S)
            yield _Measured(speed_m_s, _movement(metres * dx, metres * dy, rad * sum(turn)))

    return measure


def _movement(forward_m: float, left_m: float, turn_rad: float) -> Movement:
    """Return a movement in the frame of its start."""
    from vvvaltr.controller.core.records import Displacement, Movement
    from vvvaltr.controller.core.resting import RestingPose

    start, end = RestingPose((0.0, 0.0, 0.0)), RestingPose((forward_m, left_m, 0.0), turn_rad)
    return Movement(start, end, Displacement(forward_m, left_m, turn_rad))


def _is_kept(value: float, name: str, where: str, zero: str | None) -> bool:
    """Return whether a measurement counts. Raises NotUnderstood for a 0 of which nobody has said what it means."""
    if value == 0.0 and zero is None:
        raise NotUnderstood(
            f"{where}: {name} is exactly 0: give --zero keep if the robot stood still, or --zero drop if nothing was "
            "measured"
        )
    return value != 0.0 or zero == _KEEP


def _converted(where: str, column: str, value: float, factor: float, unit: str, greatest: float) -> float:
    """Return ``value`` in ``unit``. Raises NotUnderstood beyond ``greatest``, and for infinity."""
    converted = factor * value
    if abs(converted) > greatest:
        raise NotUnderstood(
            f"{where}: {column} is {value:g}, that is {converted:g} {unit}; allowed: up to {greatest:g}; "
            "check the number, its unit and --duration"
        )
    return converted


def _speed_factor(arguments: Namespace) -> float:
    """Return what turns a number of the score's column into m/s."""
    if arguments.score_unit in _M_S:
        return _M_S[arguments.score_unit]
    if arguments.duration_s is None:
        raise NotUnderstood(
            f"--score-unit {arguments.score_unit} is a displacement: give the duration of a trial, --duration S"
        )
    return _METRES[arguments.score_unit] / float(arguments.duration_s)


COMMAND = Subcommand(
    help="import trials from a table, as a run to learn from",
    example="vvvaltr import examples/trials.csv --gait RPM_1,RPM_2,RPM_3 --unit rpm --score Displacement_mm "
    "--score-unit mm --duration 20 --out runs/lab",
    add_arguments=_add_arguments,
    execute=_execute,
)
