"""A run that nobody learns in: trials that a person asked for, on disk from the first one on."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from vvvaltr.controller.core.disk import new_folder, write_whole
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.values import Structure
from vvvaltr.controller.runs.log import LOG_NAME, RunLog


def begin_measured_run(path: Path, structure: Structure | None, about: Mapping[str, str] | None = None) -> RunLog:
    """Make the folder of a run, with an empty log, in one step; return the log, to be closed after use.

    ``about`` says what makes the log; see ``describe_maker``.

    Raises:
        UserError: ``path`` exists, or cannot be made.
    """
    if path.exists():
        raise UserError(f"{path} exists: choose another --out, or move it away")
    with ExitStack() as undo:
        try:
            with new_folder(path) as fresh:
                log = undo.enter_context(RunLog.create(fresh / LOG_NAME, structure, about=about))
        except OSError as error:
            raise UserError(f"{path} cannot be made: {error.strerror}; choose another place, or make room") from error
        undo.pop_all()
    return log


def write_summary(path: Path, found: Mapping[str, Any]) -> None:
    """Write `summary.json` into the folder of a run. Raises OSError."""
    write_whole(path / "summary.json", json.dumps(found, indent=2) + "\n")
