"""A run in a terminal: columns that fit its width, and a small plot. No colours, and no letter beyond ASCII."""

from __future__ import annotations

from collections.abc import Sequence

from vvvaltr.controller.core.records import LoggedTrial


def lay_out_columns(names: Sequence[str], rows: Sequence[Sequence[str]], width: int, first_to_go: Sequence[str]) -> str:
    """Return a table that is at most ``width`` wide: columns that do not fit are left out, in the order given.

    The last resort is to cut the lines.
    """
    kept = list(names)
    for name in ("", *first_to_go):
        kept = [each for each in kept if each != name]
        places = [names.index(each) for each in kept]
        sizes = [max(len(row[place]) for row in (names, *rows)) for place in places]
        if sum(sizes) + 2 * (len(sizes) - 1) <= width:
            break
    lines = (
        "  ".join(row[place].ljust(size) for place, size in zip(places, sizes, strict=True)) for row in (names, *rows)
    )
    return "\n".join(line.rstrip()[:width] for line in lines)


def plot_speeds(trials: Sequence[LoggedTrial], width: int, height: int = 9) -> str:
    """Return a plot of the speeds in mm/s: ``o`` measured, ``x`` nothing measured, ``-`` mean of the best gait.

    Several trials may share a column; the fastest of them is shown. The axis follows what was measured: first means
    that lie beyond it say next to nothing, and are left out.
    """
    scores = [1000.0 * logged.score for logged in trials if logged.score is not None]
    if not scores:
        return "no trial has measured a speed"
    means = [1000.0 * it.recommendation.estimate.mean for it in trials if it.recommendation is not None]
    low, high = min(0.0, *scores), max(*scores, *means[-1:], 1e-3)
    columns = max(10, min(width - 9, len(trials)))
    cells = [[" "] * columns for _ in range(height)]

    def row(speed_mm_s: float) -> int:
        return round((height - 1) * (1.0 - (min(max(speed_mm_s, low), high) - low) / (high - low)))

    for place, logged in enumerate(trials):
        column = place * columns // len(trials)
        if logged.recommendation is not None and (mean := 1000.0 * logged.recommendation.estimate.mean) <= high:
            cells[row(mean)][column] = "-"
        if logged.score is None:
            cells[-1][column] = "x"
    for place, logged in enumerate(trials):
        if logged.score is not None:
            cells[row(1000.0 * logged.score)][place * columns // len(trials)] = "o"
    labels = {0: f"{high:.1f}", height - 1: f"{low:.1f}"}
    lines = [f"{labels.get(place, ''):>7} |{''.join(line)}".rstrip() for place, line in enumerate(cells)]
    ends = f"{'trial':>7}  1{len(trials):>{columns - 1}}"
    return "\n".join([f"{'mm/s':>7}", *lines, ends])
