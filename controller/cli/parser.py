"""The parser of the command line: what it does not understand is one line, with what was probably meant."""

from __future__ import annotations

import re
import shutil
import sys
import textwrap
from argparse import Action, ArgumentError, ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn

from vvvaltr.controller.core.printable import printable
from vvvaltr.controller.core.spelling import did_you_mean, unknown

Details = Mapping[str, Mapping[str, str]]
"""Sections of a help text: the title of each, then its names with a line on each."""

_RENAMED = {"run": "trial"}
_OPTION = re.compile(r"--?[A-Za-z][^\s=]*")
_MISSING, _EXTRA = "the following arguments are required: ", "unrecognized arguments: "


class Parser(ArgumentParser):
    """An argument parser whose errors are one line and name the cure.

    Args:
        example: a complete command line, shown below the help and where an argument is missing.
        details: makes further sections of the help; called only when the help is shown, because it may import much.
    """

    def __init__(self, *, example: str = "", details: Callable[[], Details] | None = None, **more: Any) -> None:
        super().__init__(allow_abbrev=False, formatter_class=RawDescriptionHelpFormatter, **more)
        self._positionals.title = "arguments"
        self._example = example
        self._details = details

    def format_help(self) -> str:
        """Return the help, with its further sections and the example."""
        width = max(20, min(shutil.get_terminal_size().columns, 100)) - 2
        self.usage = textwrap.fill(self._usage(), width - 7, subsequent_indent=" " * 9, break_on_hyphens=False)
        self.description = textwrap.fill(self.description or "", width)
        sections = (_section(title, lines, width) for title, lines in (self._details or dict)().items())
        example = textwrap.wrap(self._example, width - 6, break_on_hyphens=False, break_long_words=False)
        return "\n".join([super().format_help(), *sections, "example:", "  " + " \\\n    ".join(example), ""])

    def format_usage(self) -> str:
        """Return the usage: what must be given; the options that may be given are listed below it."""
        return f"usage: {self._usage()}\n"

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: Namespace | None = None
    ) -> tuple[Namespace, list[str]]:
        """Return the parsed arguments and an empty list: an argument that is not understood ends the program."""
        words = list(sys.argv[1:] if args is None else args)
        self._refuse_unknown_options(words)
        parsed, extra = super().parse_known_args(words, namespace)
        if extra:
            self.error(f"unexpected argument {extra[0]!r}; see {self.prog} --help")
        return parsed, []

    def error(self, message: str) -> NoReturn:
        """End the program with one line and the status 2."""
        if message.startswith(_MISSING):
            names = message.removeprefix(_MISSING)
            message = f"{names} {'are' if ',' in names else 'is'} missing; example: {self._example}"
        self.exit(2, printable(f"{self.prog}: {' '.join(message.split())}\n"))

    def _usage(self) -> str:
        words = [_usage_of(action) for action in self._actions if not action.option_strings or action.required]
        return " ".join([self.prog, *words, *(["[OPTIONS]"] if self._subparsers is None else ["..."])])

    def _refuse_unknown_options(self, words: Sequence[str]) -> None:
        """Say what was probably meant before the parser complains of what it misses instead."""
        for word in words:
            if word == "--" or (self._subparsers is not None and not word.startswith("-")):
                return  # what follows is not for this parser
            option = _OPTION.fullmatch(word.partition("=")[0])
            if option and option[0] not in self._option_string_actions:
                guess = did_you_mean(option[0], self._option_string_actions)
                self.error(f"unknown option {option[0]}{guess or f'; see {self.prog} --help'}")

    def _check_value(self, action: Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        if isinstance(action.choices, dict):  # the commands
            if value in _RENAMED:
                raise ArgumentError(
                    None, f"{value} is now called {_RENAMED[value]}, with the same arguments: {self.prog} trial ..."
                )
            raise ArgumentError(None, unknown("command", value, action.choices))
        raise ArgumentError(action, unknown("value", value, action.choices))


def _usage_of(action: Action) -> str:
    name = str(
        action.metavar or (action.choices and f"{{{','.join(map(str, action.choices))}}}") or action.dest.upper()
    )
    if action.option_strings:
        return f"{action.option_strings[-1]} {name}"
    return {"?": f"[{name}]", "+": f"{name} [{name} ...]", "*": f"[{name} ...]"}.get(str(action.nargs), name)


def _section(title: str, lines: Mapping[str, str], width: int) -> str:
    """Return names and what they are in two columns."""
    column = max(map(len, lines), default=0) + 4
    rows = (
        textwrap.fill(line, width, initial_indent=f"  {name}".ljust(column), subsequent_indent=" " * column)
        for name, line in lines.items()
    )
    return "\n".join([f"{title}:", *rows, ""])
