"""What a benchmark has measured so far, a line a run: one that was ended goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

Row = dict[str, Any]


class Rows:
    """Rows of a file, each with the names that tell it from the others and with what was measured."""

    def __init__(self, path: Path) -> None:
        self._path = path
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        self._rows: list[Row] = [json.loads(line) for line in lines]

    def get(self, names: Mapping[str, Any], measure: Callable[[], Row]) -> Row:
        """Return the row with these names: the file's, or one that is measured now and added to the file."""
        for row in self._rows:
            if all(row.get(name) == value for name, value in names.items()):
                return row
        row = {**names, **measure()}
        self._rows.append(row)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        return row
