"""What a command hands back to the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from vvvaltr.controller.cli.parser import Details


@dataclass(frozen=True, slots=True)
class Answer:
    """A command's result: prose for people, an object for programs (``--json``), and the exit status."""

    text: str
    data: Mapping[str, Any]
    status: int = 0


@dataclass(frozen=True, slots=True)
class Subcommand:
    """One command of the command line.

    Args:
        help: what it does, in one line.
        example: a complete command line that works.
        add_arguments: declares its arguments.
        execute: does it; None where the command has printed its results itself. Raises UserError for what the user can
            put right, and NotUnderstood, a UserError, for what means nothing.
        details: further sections of its help; None for none.
    """

    help: str
    example: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    execute: Callable[[argparse.Namespace], Answer | None]
    details: Callable[[], Details] | None = None
