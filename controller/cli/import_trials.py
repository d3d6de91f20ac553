"""`vvvaltr import`: trials measured elsewhere become a run that others can learn from."""

from __future__ import annotations

import csv
import json
import math
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from vvvaltr.controller.cli.answer import Answer, Command
from vvvaltr.controller.cli.options import number
from vvvaltr.controller.core.errors import NotUnderstood, UserError
from vvvaltr.controller.core.spelling import did_you_mean

if TYPE_CHECKING:
    from vvvaltr.controller.core.records import LoggedTrial

_HZ: Mapping[str, float] = MappingProxyType({"hz": 1.0, "rpm": 1.0 / 60.0, "rad/s": 1.0 / math.tau})
_METRES: Mapping[str, float] = MappingProxyType({"mm": 1e-3, "m": 1.0})
_M_S: Mapping[str, float] = MappingProxyType({"mm/s": 1e-3, "m/s": 1.0})
_GREATEST_HZ, _GREATEST_M_S = 10_000.0, 1000.0  # beyond these it is a mistake, in the table or in the unit


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
    parser.add_argument("--score", required=True, metavar="COLUMN", help="column of the net displacement or speed")
    parser.add_argument(
        "--score-unit",
        required=True,
        choices=(*_METRES, *_M_S),
        metavar="UNIT",
        help=f"unit of that column: {', '.join((*_METRES, *_M_S))}",
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
        f"{len(trials)} trials, the fastest {1000.0 * best['score_m_s']:.1f} mm/s\n"
        f"learn from them: vvvaltr learn --source {arguments.out}",
        result,
    )


def _write_run(path: Path, trials: Sequence[LoggedTrial], found: str) -> None:
    """Make the run's directory. Raises OSError, and then nothing is in its place."""
    from vvvaltr.controller.core.disk import new_folder, write_whole
    from vvvaltr.controller.runs.log import LOG_NAME, RunLog, describe_maker

    with new_folder(path) as fresh:
        with RunLog.create(fresh / LOG_NAME, structure=None, about=describe_maker("imported")) as log:
            for logged in trials:
                log.append(logged)
        write_whole(fresh / "summary.json", found)


def _trials(arguments: Namespace) -> Iterator[LoggedTrial]:
    from vvvaltr.controller.core.records import LoggedTrial
    from vvvaltr.controller.core.values import Gait, Outcome, Suggestion, Trial

    hz = _HZ[arguments.unit]
    m_s = _speed_factor(arguments)
    columns = arguments.gait.split(",")
    now_unix_s = time.time()
    for count, (line, row) in enumerate(_rows(arguments.csv, [*columns, arguments.score]), start=1):
        where = f"{arguments.csv}, line {line}"
        *motors, measured = row
        if measured < 0.0:
            raise NotUnderstood(f"{where}: {arguments.score} is {measured:g}; allowed: 0 or more")
        speed_m_s = _converted(where, arguments.score, measured, m_s, "m/s", _GREATEST_M_S)
        pairs = zip(columns, motors, strict=True)
        gait = Gait(tuple(_converted(where, column, value, hz, "Hz", _GREATEST_HZ) for column, value in pairs))
        trial = Trial(count, gait, Outcome.COMPLETED, "", now_unix_s, arguments.duration_s or 0.0)
        yield LoggedTrial(Suggestion(gait, "imported"), trial, speed_m_s, None)


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


def _rows(path: Path, columns: list[str]) -> Iterator[tuple[int, list[float]]]:
    """Yield the line's number and the numbers in these columns, line by line."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            table = csv.DictReader(file)
            if missing := [column for column in columns if column not in (table.fieldnames or ())]:
                has = ", ".join(table.fieldnames or ["nothing"])
                guess = did_you_mean(missing[0], table.fieldnames or ())
                raise NotUnderstood(f"{path} has no column {missing[0]!r}{guess}; its first line has {has}")
            for row in table:
                if None in row:  # where DictReader puts the cells beyond the last column
                    raise NotUnderstood(
                        f"{path}, line {table.line_num} has more cells than there are column names: write decimals "
                        "with a point, 1.5, and quote text with commas"
                    )
                yield table.line_num, [_number(path, table.line_num, column, row[column]) for column in columns]
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}: name a CSV file") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise NotUnderstood(f"{path} is not a CSV file ({error}): save the table as CSV in UTF-8") from None


def _number(path: Path, line: int, column: str, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        shown = repr(text) if text else "empty"
        raise NotUnderstood(f"{path}, line {line}: {column} is {shown}: give a number, or leave the line out")
    return value


COMMAND = Command(
    help="import trials from a table, as a run to learn from",
    example="vvvaltr import examples/trials.csv --gait RPM_1,RPM_2,RPM_3 --unit rpm --score Displacement_mm "
    "--score-unit mm --duration 20 --out runs/lab",
    add_arguments=_add_arguments,
    execute=_execute,
)
