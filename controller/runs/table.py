"""The table of a run as comma-separated values, for spreadsheets and statistics."""

from __future__ import annotations

import csv
import math
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.core.disk import write_whole
from vvvaltr.controller.core.errors import UserError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def to_csv(table: NDArray[np.void]) -> str:
    """Return a table, as ``Run.table`` makes it, with a line of column names; NaN becomes an empty cell.

    Numbers have all their digits.
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.dtype.names or ())
    writer.writerows([_cell(value) for value in row] for row in table.tolist())
    return text.getvalue()


def write_csv(table: NDArray[np.void], path: Path) -> None:
    """Write a table as ``to_csv`` returns it. An existing file is replaced in one step.

    Raises:
        UserError: the file cannot be written.
    """
    try:
        write_whole(path, to_csv(table))
    except OSError as error:
        raise UserError(f"{path} cannot be written: {error.strerror}; name another file") from error


def _cell(value: Any) -> Any:
    return "" if isinstance(value, float) and math.isnan(value) else value
