"""The runs in a directory, from their small files alone: what each was asked to do, and what it has found so far."""

from __future__ import annotations

import fcntl
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

import msgspec

from vvvaltr.controller.core.disk import open_plain, read_bytes, read_text
from vvvaltr.controller.core.document import parse_toml
from vvvaltr.controller.core.errors import UserError

_LOG, _CONFIG, _SUMMARY = "trials.mcap", "run.toml", "summary.json"


class State(StrEnum):
    """How far a run is."""

    COMPLETE = "complete"
    RUNNING = "running"  # a process is writing its log
    STOPPED = "stopped"  # before its last trial
    ASKED = "by hand"  # trials that a person asked for, imported or put together: there is no number to reach
    UNREADABLE = "unreadable"


@dataclass(frozen=True, slots=True)
class Listed:
    """A run in a list. A text that is empty, and a number that is None, are not known.

    Args:
        path: its directory.
        robot: name or file of the robot.
        world: condition of a twin.
        method: name of the optimiser.
        trials: number of trials made.
        wanted: number of valid trials to make.
        best_m_s: posterior mean of the recommended gait, with its 95 % interval.
        observed_m_s: speed of the fastest single trial.
        sources: runs that it learns from.
        began: when its first file was written, local time.
        state: how far it is.
    """

    path: Path
    robot: str
    world: str
    method: str
    trials: int | None
    wanted: int | None
    best_m_s: tuple[float, float, float] | None
    observed_m_s: float | None
    sources: tuple[str, ...]
    began: datetime
    state: State


def list_runs(folder: Path) -> list[Listed]:
    """Return the runs in a folder, or the folder itself if it is one; the newest first.

    Raises:
        UserError: there is no such folder.
    """
    if not folder.is_dir():
        raise UserError(f"{folder} is not a directory: name the one that holds your runs")
    found = [folder] if (folder / _LOG).exists() else [log.parent for log in folder.glob(f"*/{_LOG}")]
    return sorted(map(describe_run, found), key=lambda run: (run.began, run.path), reverse=True)


def describe_run(path: Path) -> Listed:
    """Return the run in ``path`` as a list shows it. What cannot be read is left out."""
    try:
        config, summary = _read_toml(path / _CONFIG), _read_json(path / _SUMMARY)
        robot, best = _table(config, "robot"), _table(summary, "recommended")
        # A summary of an earlier version counts by outcome alone.
        completed = sum(_table(summary, "outcomes").get(name, 0) for name in ("completed", "cut_short"))
        valid = int(summary.get("valid_trials", completed))
        trials, wanted = _number(summary.get("trials", summary.get("primitives"))), _find_wanted(config)
        # A run of `go` that was killed has no summary, and has not arrived.
        has_arrived = summary.get("reached", False if config.get("method") == "go" else None)
        if summary.get("complete") is True:  # perhaps before its last trial: by --stop-when, or a clear confirmation
            has_arrived = True
        observed_m_s = _number(_table(summary, "best_observed").get("score_m_s"))
        return Listed(
            path,
            str(robot.get("name") or summary.get("robot") or ""),
            _name_world(robot),
            str(config.get("method") or ""),
            None if trials is None else int(trials),
            None if wanted is None else int(wanted),
            (float(best["mean_m_s"]), float(best["low_m_s"]), float(best["high_m_s"])) if best else None,
            observed_m_s,
            tuple(map(str, config.get("sources", ()))),
            _date(path),
            _find_state(path, wanted, valid, has_arrived),
        )
    except (
        OSError,
        UserError,
        msgspec.MsgspecError,
        ValueError,
        ArithmeticError,
        LookupError,
        TypeError,
        AttributeError,
        RecursionError,
    ):
        # A damaged file must not hide the other runs.
        return Listed(path, "", "", "", None, None, None, None, (), _date(path), State.UNREADABLE)


def _number(value: Any) -> float | None:
    """Return a number of a file, None where there is none. Raises ValueError or TypeError for something else."""
    return None if value is None else float(value)


def _find_wanted(config: Mapping[str, Any]) -> float | None:
    """Return the number of valid trials to make; None where no number of trials ends a run."""
    method = config.get("method")
    is_put_together = method == "repertoire" and bool(config.get("sources"))
    return None if method in ("go", "jog") or is_put_together else _number(config.get("trials"))


def _find_state(path: Path, wanted: float | None, valid: int, has_arrived: bool | None) -> State:
    """Return how far a run is; ``has_arrived`` says whether it ended where it should, None where trials are counted."""
    if _is_locked(path / _LOG):
        return State.RUNNING
    if has_arrived is not None:
        return State.COMPLETE if has_arrived is True else State.STOPPED
    if wanted is None:
        return State.ASKED
    return State.COMPLETE if valid >= wanted else State.STOPPED


def _is_locked(log: Path) -> bool:
    with open_plain(log) as file:
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return False  # a file system without locks
    return False


def _name_world(robot: Mapping[str, Any]) -> str:
    """Return world and damage of a twin in a word or two."""
    return " ".join([str(robot.get("world") or ""), *map(str, robot.get("damage") or ())]).strip()


def _read_toml(path: Path) -> dict[str, Any]:
    return parse_toml(read_text(path)) if path.exists() else {}


def _read_json(path: Path) -> dict[str, Any]:
    return msgspec.json.decode(read_bytes(path), type=dict[str, Any]) if path.exists() else {}


def _table(content: Mapping[str, Any], key: str) -> dict[str, Any]:
    return dict(content.get(key) or {})


def _date(path: Path) -> datetime:
    first = next((path / name for name in (_CONFIG, _LOG) if (path / name).exists()), path)
    return datetime.fromtimestamp(first.stat().st_mtime)
