"""What one test of a robot showed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Finding:
    """What one test of a robot showed. What passed with a ``cure`` is a warning."""

    name: str
    passed: bool
    detail: str
    cure: str = ""
