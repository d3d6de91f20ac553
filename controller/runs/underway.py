"""The runs that are under way on this machine, as its kernel tells: which process writes to which log."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.runs.log import LOG_NAME

_PROC = Path("/proc")
_ENDING_S, _LOOK_S = 10.0, 0.01
# They turn motors and write no log, or need not.
_DRIVING = frozenset({"check", "calibrate", "trial", "compare", "floor", "camera", "track"})


@dataclass(frozen=True, slots=True)
class Underway:
    """A process that drives a robot.

    Args:
        process: its number.
        what: the run's folder, or the command.
    """

    process: int
    what: str

    @property
    def is_over(self) -> bool:
        """Whether it has ended."""
        try:
            state = (_PROC / str(self.process) / "stat").read_text().rpartition(")")[2].split()[0]
        except (OSError, IndexError):
            return True
        return state == "Z"  # ended, and its parent has not looked yet

    def stop(self) -> None:
        """Have it stop its motors, save and end. Raises UserError if it belongs to somebody else."""
        try:
            os.kill(self.process, signal.SIGTERM)
        except ProcessLookupError:  # it has just ended
            pass
        except PermissionError:
            raise UserError(
                f"{self.what} is somebody else's (process {self.process}): sudo kill {self.process}"
            ) from None

    def wait(self) -> None:
        """Wait until it has ended. Raises UserError if it does not."""
        deadline_s = time.monotonic() + _ENDING_S
        while not self.is_over:
            if time.monotonic() > deadline_s:
                raise UserError(
                    f"{self.what} has not ended in {_ENDING_S:g} s (process {self.process}); switch its motors off by "
                    f"hand, then kill -9 {self.process}"
                )
            time.sleep(_LOOK_S)


def find_run(run: Path) -> Underway:
    """Return the process that makes a run. Raises UserError if there is none."""
    log = run / LOG_NAME if run.is_dir() else run
    try:
        wanted = log.stat()
    except OSError as error:
        raise UserError(f"{log}: {error.strerror}; name the directory of a run") from error
    for process in _processes():
        for link in _files(process):
            with suppress(OSError):
                if _is_written(link) and os.path.samestat(link.stat(), wanted):
                    return Underway(int(process.name), str(run))
    raise UserError(f"{run} is not under way on this machine")


def find_all() -> list[Underway]:
    """Return all processes of this machine that make a run or turn motors, as far as this user may see them."""
    found = []
    for process in _processes():
        runs = [target.parent for link in _files(process) if (target := _target(link)).name == LOG_NAME
                and _is_written(link)]  # fmt: skip
        if what := str(runs[0]) if runs else _command(process):
            found.append(Underway(int(process.name), what))
    return found


def _processes() -> Iterator[Path]:
    """Yield the folders of all other processes."""
    own = str(os.getpid())
    return (entry for entry in _PROC.iterdir() if entry.name.isdecimal() and entry.name != own)


def _files(process: Path) -> list[Path]:
    try:
        return list((process / "fd").iterdir())
    except OSError:  # it has ended, or is another user's
        return []


def _target(link: Path) -> Path:
    try:
        return link.readlink()
    except OSError:
        return Path()


def _is_written(link: Path) -> bool:
    """Return whether a process has a file open to write to it."""
    try:
        flags = (link.parent.parent / "fdinfo" / link.name).read_text().split("flags:")[1].split()[0]
    except (OSError, IndexError):
        return False
    return int(flags, 8) & os.O_ACCMODE != os.O_RDONLY


def _command(process: Path) -> str:
    """Return the command of ours that turns motors in a process; empty for any other process."""
    try:
        words = (process / "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return ""
    for program, command in pairwise(words):
        if command in _DRIVING and Path(program).name == "vvvaltr":
            return f"vvvaltr {command}"
    return ""
