"""How a benchmark prints its figures: a line each, and with ``--json`` one JSON object as the last line."""

from __future__ import annotations

import json
from argparse import SUPPRESS, Action, ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Mapping


class _Formatter(RawDescriptionHelpFormatter):
    """Leaves the docstring as it is written, and tells each default that is one."""

    def _get_help_string(self, action: Action) -> str | None:
        default, text = action.default, action.help or ""
        if default is None or default is False or default in ("", [], SUPPRESS) or "(default" in text:
            return text
        return f"{text} (default {' '.join(map(str, default)) if isinstance(default, (list, tuple)) else default})"


def make_parser(description: str | None) -> ArgumentParser:
    """Return a parser with the option ``--json``; ``description`` is the benchmark's docstring."""
    parser = ArgumentParser(description=description, formatter_class=_Formatter)
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    return parser


def print_figures(figures: Mapping[str, float], as_json: bool, width: int = 40) -> None:
    """Print names and figures in columns, the first of them ``width`` wide, and then the JSON object if asked for."""
    for name, figure in figures.items():
        print(f"{name:{width}} {figure:8.2f}")
    if as_json:
        print(json.dumps(figures))
