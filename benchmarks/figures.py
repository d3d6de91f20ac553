"""How a benchmark prints its figures: a line each, and with ``--json`` one JSON object as the last line."""

from __future__ import annotations

import json
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Mapping


def make_parser(description: str | None) -> ArgumentParser:
    """Return a parser with the option ``--json``; ``description`` is the benchmark's docstring."""
    parser = ArgumentParser(description=description, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    return parser


def print_figures(figures: Mapping[str, float], as_json: bool, width: int = 40) -> None:
    """Print names and figures in columns, the first of them ``width`` wide, and then the JSON object if asked for."""
    for name, figure in figures.items():
        print(f"{name:{width}} {figure:8.2f}")
    if as_json:
        print(json.dumps(figures))
