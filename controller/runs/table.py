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


def write_csv(table: NDArray[np.void], path: Path) -> None:
    """Write a table, as ``Run.table`` makes it, with a line of column names; NaN becomes an empty cell.

    Numbers are written with all their digits. An existing file is replaced in one step.

    Raises:
        UserError: the file cannot be written.
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.dtype.names or ())
    writer.writerows([_cell(value) for value in row] for row in table.tolist())
    try:
        write_whole(path, text.getvalue())
    except OSError as error:
        raise UserError(f"{path} cannot be written: {error.strerror}; name another file") from error


def _cell(value: Any) -> Any:
    return "" if isinstance(value, float) and math.isnan(value) else value
