"""What is told on standard error while a command works: lines, progress bars, and what the rooms below log."""

from __future__ import annotations

import errno
import logging
import os
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.printable import printable

if TYPE_CHECKING:
    from tqdm import tqdm


def add_telling_arguments(parser: ArgumentParser) -> None:
    """Declare how much is told, and how."""
    group = parser.add_argument_group("output")
    group.add_argument("--json", action="store_true", help="print one JSON object as the last line of standard output")
    how_much = group.add_mutually_exclusive_group()
    how_much.add_argument("-v", "--verbose", action="store_true", help="also tell each step on standard error")
    how_much.add_argument("-q", "--quiet", action="store_true", help="tell errors only; no progress bar")
    group.add_argument("--debug", action="store_true", help="show the traceback of an unexpected error")


def counted(number: int, noun: str) -> str:
    """Return a number of things in words: 1 trial, 2 trials."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def can_repaint() -> bool:
    """Return whether standard error is a terminal that can write a line anew, as bars and an operator's line need."""
    return sys.stderr.isatty() and os.environ.get("TERM", "dumb") != "dumb"


@contextmanager
def to_whoever_listens() -> Iterator[None]:
    """Tell nothing where the terminal was closed: that ends the command by a signal, and must not by an error."""
    try:
        yield
    except OSError as error:
        if error.errno != errno.EIO:
            raise


def say(arguments: Namespace, line: str) -> None:
    """Tell the person one line, unless they asked for quiet."""
    if not arguments.quiet:
        with to_whoever_listens():
            print(printable(line), file=sys.stderr, flush=True)


def ask(question: str) -> str:
    """Return the person's answer to a question, which stands on standard error. Raises UserError if none will come."""
    with to_whoever_listens():
        print(printable(question), end="", file=sys.stderr, flush=True)
    if not (line := sys.stdin.readline()):
        raise UserError(f"the input ended before an answer to: {question.strip()}")
    return line.strip()


def say_above(progress: tqdm[Any], line: str) -> None:
    """Tell the person one line above a progress bar."""
    with to_whoever_listens():
        progress.write(printable(line), sys.stderr)


def bar(arguments: Namespace, stream: Iterable[Any] | None = None, is_needed: bool = True, **more: Any) -> tqdm[Any]:
    """Return a progress bar as tqdm makes it; unseen where nobody needs it or wants it, and in a file."""
    from tqdm import tqdm

    return tqdm(stream, file=sys.stderr, disable=arguments.quiet or not is_needed or not can_repaint(), **more)


@contextmanager
def logs_on_standard_error(arguments: Namespace) -> Iterator[None]:
    """Show what the rooms log meanwhile: warnings, with ``--verbose`` each step, with ``--quiet`` errors alone."""
    level = logging.DEBUG if arguments.verbose else logging.ERROR if arguments.quiet else logging.WARNING
    handler = _AboveTheBar()
    handler.setFormatter(
        logging.Formatter("%(asctime)s %(name)s: %(message)s" if arguments.verbose else "vvvaltr: %(message)s")
    )
    logger = logging.getLogger("vvvaltr")
    level_before = logger.level
    logger.addHandler(handler)
    logger.setLevel(level)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level_before)


class _AboveTheBar(logging.Handler):
    """Writes to standard error, above a progress bar if there is one. A record marked ``once`` is told only once."""

    def __init__(self) -> None:
        super().__init__()
        self._told: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        with to_whoever_listens():
            self._tell(record)

    def _tell(self, record: logging.LogRecord) -> None:
        if getattr(record, "once", False):
            if record.getMessage() in self._told:
                return
            self._told.add(record.getMessage())
        if tqdm := sys.modules.get("tqdm"):
            tqdm.tqdm.write(printable(self.format(record)), file=sys.stderr)
        else:
            print(printable(self.format(record)), file=sys.stderr, flush=True)
