"""Tables of others: comma-separated values as spreadsheets of any country write them, read or refused with the cure."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from vvvaltr.controller.core.disk import read_text
from vvvaltr.controller.core.errors import NotUnderstood, UserError
from vvvaltr.controller.core.spelling import did_you_mean

_MOST_BYTES = 256 << 20
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:[.,]\d{3})+(?:[.,]\d+)?")
_SEPARATORS = "\t;,"


@dataclass(frozen=True, slots=True)
class Row:
    """The cells of the columns that were asked for, in their order, stripped; empty for a cell that is missing."""

    line: int
    cells: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ForeignTable:
    """A table of another program.

    Args:
        path: where it is.
        separator: what stands between its cells.
        columns: the columns that were asked for.
        rows: its lines that have a cell in one of these columns.
    """

    path: Path
    separator: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    def number(self, row: Row, column: int) -> float:
        """Return the number in a cell. Raises NotUnderstood, with line, column and cure, where there is none."""
        text = row.cells[column]
        value = math.nan
        if self.separator != "," and _DECIMAL_COMMA.fullmatch(text):
            text = text.replace(",", ".")
        with suppress(ValueError):
            value = float(text) if "_" not in text else math.nan
        if not math.isfinite(value):
            raise NotUnderstood(
                f"{self.path}, line {row.line}: {self.columns[column]} is {self._complaint(row, column)}"
            )
        return value

    def _complaint(self, row: Row, column: int) -> str:
        text = row.cells[column]
        if not text:
            return "empty: give a number, or leave the line out"
        if _THOUSANDS.fullmatch(text) or _DECIMAL_COMMA.fullmatch(text):
            return f"{text!r}: write decimals with a point and no separators of thousands, as in 1234.5"
        if not any(map(_is_numeric, row.cells)):
            return f"{text!r}: give a number; if the line is a note, delete it or let it begin with #"
        return f"{text!r}: give a number, or leave the line out"


def read_foreign_table(path: Path, columns: Sequence[str]) -> ForeignTable:
    """Read the ``columns`` of a table with a line of column names.

    The separator is that of the line of names: comma, semicolon or tab, or what ``sep=`` in a line before it says. With
    semicolons and tabs, a decimal comma is understood. Blank lines, lines of empty cells, and notes after # are passed
    over.

    Raises:
        UserError: the file cannot be read.
        NotUnderstood: a column is missing or there twice, or a line has more cells than there are names.
    """
    try:
        text = read_text(path, _MOST_BYTES)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}: name a CSV file") from None
    except UnicodeDecodeError as error:
        raise _no_table(path, error) from None
    if "\0" in text:
        raise _no_table(path, ValueError("it has zero bytes, as UTF-16 does"))
    lines = text.splitlines()
    first, separator = _find_separator(lines)
    reader = csv.reader(lines[first:], delimiter=separator)
    try:
        names = [name.strip() for name in next(reader, [])]
        places = [_find(path, column, names) for column in columns]
        rows = tuple(_rows(path, reader, first, places, len(names), separator))
    except csv.Error as error:
        raise _no_table(path, error) from None
    return ForeignTable(path, separator, tuple(columns), rows)


def _no_table(path: Path, error: Exception) -> NotUnderstood:
    return NotUnderstood(f"{path} is not a CSV file ({error}): save the table as CSV in UTF-8")


def _find_separator(lines: Sequence[str]) -> tuple[int, str]:
    """Return the number of the line of column names, counted from 0, and the separator."""
    first = next((number for number, line in enumerate(lines) if line.strip() and not line.startswith("#")), 0)
    head = lines[first] if lines else ""
    if head.startswith("sep=") and len(head.rstrip()) <= len("sep=;"):
        return first + 1, head[4:5] or "\t"
    unquoted = re.sub(r'"[^"]*"', "", head)
    return first, next((each for each in _SEPARATORS if each in unquoted), ",")


def _find(path: Path, column: str, names: Sequence[str]) -> int:
    count = Counter(names)[column]
    if count > 1:
        raise NotUnderstood(
            f"{path} has {count} columns {column!r}: give each a name of its own; repeats are named as --score A,B"
        )
    if not count:
        has = ", ".join(filter(None, names)) or "nothing"
        raise NotUnderstood(f"{path} has no column {column!r}{did_you_mean(column, names)}; its first line has {has}")
    return names.index(column)


def _rows(
    path: Path, reader: Iterator[list[str]], first: int, places: Sequence[int], width: int, separator: str
) -> Iterator[Row]:
    for cells in reader:
        line = first + reader.line_num  # type: ignore[attr-defined]
        stripped = [cell.strip() for cell in cells]
        if not any(stripped) or stripped[0].startswith("#"):
            continue
        if any(stripped[width:]):
            cure = "write decimals with a point, 1.5, and quote text with commas" if separator == "," else "quote text"
            raise NotUnderstood(f"{path}, line {line} has more cells than there are column names: {cure}")
        yield Row(line, tuple(stripped[place] if place < len(stripped) else "" for place in places))


def _is_numeric(text: str) -> bool:
    try:
        return math.isfinite(float(text.replace(",", ".")))
    except ValueError:
        return False
