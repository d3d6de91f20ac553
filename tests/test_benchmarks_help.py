"""The help of a benchmark: its docstring as it is written, and every option with what it is and its default."""

import re
from pathlib import Path

import pytest

from benchmarks.figures import make_parser

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


def test_a_help_is_the_docstring_and_tells_each_default() -> None:
    parser = make_parser("What is measured:\n\n- a list\n- of two lines")
    parser.add_argument("--count", type=int, default=500, help="number of logs")
    parser.add_argument("--seed", type=int, default=0, help="seed of all")
    parser.add_argument("--twins", nargs="+", default=["planar", "spatial"], help="twins to measure")

    text = parser.format_help()

    assert "- a list\n- of two lines" in text
    assert "number of logs (default 500)" in text
    assert "twins to measure (default planar spatial)" in text
    assert "seed of all (default 0)" in text
    assert text.count("default") == 3


@pytest.mark.parametrize("path", sorted(BENCHMARKS.rglob("*.py")), ids=lambda path: path.stem)
def test_every_option_is_explained(path: Path) -> None:
    calls = re.split(r"\bparser\.add_argument\(", path.read_text(encoding="utf-8"))[1:]

    assert [call.splitlines()[0] for call in calls if "help=" not in re.split(r"\)\n", call)[0]] == []
