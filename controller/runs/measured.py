"""A run that nobody learns in: trials that a person asked for, on disk from the first one on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from vvvaltr.controller.core.disk import new_folder, write_whole
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Structure
from vvvaltr.controller.loop.summary import summarise
from vvvaltr.controller.runs.log import LOG_NAME, RunLog, describe_maker


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


@contextmanager
def measuring(
    out: Path | None, robot: Robot, name: str, seed: int, find: Callable[[], Mapping[str, Any]] = dict
) -> Iterator[Callable[[LoggedTrial], None]]:
    """Yield what keeps a trial for good, in a new run; where ``out`` is None, nothing is kept.

    However the block is left, the run has a summary: of its trials, and of what ``find`` returns by then.

    Args:
        out: folder of the run.
        robot: that makes the trials.
        name: of the robot.
        seed: seed of every random stream.
        find: what the trials have shown, for the summary.

    Raises:
        UserError: ``out`` exists, or cannot be made.
        KeyboardInterrupt: one that came within the block, which then says where the trials are.
    """
    if out is None:
        yield lambda logged: None
        return
    trials: list[LoggedTrial] = []
    with begin_measured_run(out, robot.structure, describe_maker(name, seed)) as log:

        def keep(logged: LoggedTrial) -> None:
            log.append(logged)
            trials.append(logged)

        try:
            yield keep
        except KeyboardInterrupt as interrupt:
            raise KeyboardInterrupt(f"{interrupt}; what was driven is saved in {out}") from None
        finally:
            summary = {"run": str(out), "robot": name, **summarise(trials), **find()}
            write_whole(out / "summary.json", json.dumps(summary, indent=2) + "\n")
