"""The events of a run as JSON lines, for a program that follows it: ``--events FILE`` of ``learn`` and ``go``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, BinaryIO, Self

import msgspec

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.records import Event, LoggedTrial, SteeringStep
from vvvaltr.controller.loop.summary import describe_recommendation


class EventStream:
    """An observer that writes one JSON object a line, each at once.

    ``{"event": "trial", ...}`` comes for each trial, ``{"event": KIND, "text": ...}`` for what else happens, with the
    kinds of ``EventKind``; docs/log.md lists the keys. What is not known is null.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    @classmethod
    def open(cls, name: str) -> Self:
        """Open a file, to append to it, or an open descriptor of this process by its number.

        Raises:
            UserError: it cannot be written.
        """
        try:
            if name.isdecimal():
                number = min(int(name), 2**31 - 1)  # a greater number cannot be a descriptor either
                return cls(os.fdopen(number, "wb", buffering=0, closefd=False))
            return cls(Path(name).open("ab", buffering=0))
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise UserError(f"--events {name} cannot be written: {reason}; name another file") from error

    def on_trial(self, logged: LoggedTrial) -> None:
        """Write a trial."""
        self._write({"event": "trial", **_describe(logged)})

    def on_event(self, event: Event) -> None:
        """Write an event."""
        self._write({"event": event.kind.value, "text": event.text})

    def close(self) -> None:
        """Close the file. Idempotent."""
        self._stream.close()

    def _write(self, content: dict[str, Any]) -> None:
        line = memoryview(msgspec.json.encode(content) + b"\n")
        while line:  # a pipe may take a part of it
            line = line[self._stream.write(line) :]


def _describe(logged: LoggedTrial) -> dict[str, Any]:
    trial, movement, expected = logged.trial, logged.movement, logged.suggestion.expected
    return {
        "trial": trial.number,
        "phase": logged.suggestion.phase,
        "outcome": trial.outcome,
        "reason": trial.reason,
        "gait_hz": trial.gait.frequency_hz,
        "score_m_s": logged.score,
        "expected": expected and {"mean_m_s": expected.mean, "low_m_s": expected.low, "high_m_s": expected.high},
        "duration_s": trial.duration_s,
        "started_unix_s": trial.started_unix_s,
        "displacement": movement and movement.displacement,
        "applied_hz": logged.applied and logged.applied.mean_hz,
        "verdict": logged.review.verdict,
        "verdict_reason": logged.review.verdict_reason or None,
        "notes": logged.review.notes or None,
        "suspicion": logged.review.suspicion if logged.review.is_suspect else None,
        "steering": logged.steering and _describe_step(logged.steering),
        "recommended": logged.recommendation and describe_recommendation(logged.recommendation),
    }


def _describe_step(step: SteeringStep) -> dict[str, Any]:
    planned = [gait.frequency_hz for gait in step.plan]
    return {
        "goal_m": step.goal_m,
        "goal_yaw_rad": step.goal_yaw_rad,
        "predicted": step.predicted,
        "planned_hz": planned,
    }
