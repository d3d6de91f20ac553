"""Tables of a campaign's findings: rows of plain text, which report and documentation format."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from vvvaltr.transfer.experiments.findings import PairFindings
from vvvaltr.transfer.experiments.statistics import Comparison, Gain


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text.

    Args:
        caption: caption.
        columns: names of the columns.
        rows: rows; the first cell of each is its name.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def tabulate_true_speeds(found: PairFindings) -> Table:
    """Return the table of true mean speeds at the checkpoints, with gain over Plain-BO, interval and p."""
    rows = []
    for name, method in found.methods.items():
        cells = []
        for mean_m_s, it, p in zip(method.runs.mean_true_m_s, method.against_plain, method.p_holm, strict=True):
            speed = f"{1000.0 * mean_m_s:.1f}"
            cells.append(speed if name == "plain" else f"{speed} ({gain_text(it)}, p {p_text(p)})")
        rows.append((name, *cells))
    caption = "True mean speed in mm/s of the recommended gait, and its gain over Plain-BO with the 95 % interval"
    return Table(caption, ("method", *_checkpoints(found)), tuple(rows))


def tabulate_gains_over_drive(found: PairFindings) -> tuple[Table, ...]:
    """Return a table of the gains over ``drive``, which has no source; none where it was not run."""
    rows = [(name, *map(gain_text, method.over_drive)) for name, method in found.methods.items() if method.over_drive]
    caption = "Gain in true mean speed over drive, which expects strong gaits to be fast and has no source"
    return (Table(caption, ("method", *_checkpoints(found)), tuple(rows)),) if rows else ()


def _checkpoints(found: PairFindings) -> tuple[str, ...]:
    return tuple("the end" if name == "end" else f"trial {name}" for name in found.checkpoint_names())


def tabulate_verdicts(found: PairFindings) -> Table:
    """Return the table of each method's other figures at the end of the budget."""
    rows = []
    for name, method in found.methods.items():
        end, best = method.against_plain[-1], method.best_against_plain
        coverage = tuple(
            f"{100.0 * float(covered.mean()):.0f} %"
            for covered in (method.runs.covered, method.runs.covered_within_error)
        )
        against = ("", "", "", "")
        if name != "plain":
            against = (f"{end.effect:+.2f}", chance_text(end), gain_text(best), chance_text(best))
        rows.append((name, *against, trials_text(method.trials_to_plain_level), *coverage))
    columns = (
        "method",
        "effect size (-1 to 1)",
        "chance that Plain-BO against itself gains as much",
        "gain in best observed speed",
        "the same chance for it",
        "trials to Plain-BO's final level",
        "intervals that hold the true speed as measured",
        "the same, allowing for the measurement's error",
    )
    return Table("At the end of the budget", columns, tuple(rows))


def compare_with_thesis(found: Sequence[PairFindings]) -> tuple[Table, ...]:
    """Return a table of the thesis' figures for Efficient-BO beside ours; none where it was not run."""
    rows = []
    for it in found:
        if it.pair.published is None or "efficient" not in it.methods:
            continue
        theirs, ours = it.pair.published, it.methods["efficient"]
        rows.append((
            f"{it.pair.key}: {it.pair.title}",
            f"{theirs.gain_percent:+.1f} %, p {theirs.p}",
            f"{gain_text(ours.best_against_plain)}, p {p_text(ours.best_against_plain.p)}",
            f"{theirs.trials} instead of {theirs.plain_trials}",
            f"{trials_text(ours.trials_to_plain_level)} instead of {trials_text(it.plain.trials_to_plain_level)}",
            f"{gain_text(ours.against_plain[-1])}, p {p_text(ours.against_plain[-1].p)}",
        ))  # fmt: skip
    columns = (
        "experiment",
        "best observed: thesis",
        "best observed: here",
        "trials to converge: thesis",
        "trials to Plain-BO's final level: here",
        "true speed at the end: here",
    )
    caption = "Efficient-BO against Plain-BO; p of Efficient-BO alone, not corrected"
    return (Table(caption, columns, tuple(rows)),) if rows else ()


def to_markdown(table: Table) -> str:
    """Return a table in Markdown."""
    lines = [f"*{table.caption}.*", "", "| " + " | ".join(table.columns) + " |", "|---" * len(table.columns) + "|"]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in table.rows)])


def gain_text(it: Comparison | Gain) -> str:
    """Return a gain with its interval: ``+12 % [-3, +27]``."""
    interval = it.interval_percent
    bounds = f"{interval.low:+.0f}, {interval.high:+.0f}" if interval else "one repeat has no interval"
    return f"{it.gain_percent:+.0f} % [{bounds}]"


def p_text(p: float) -> str:
    """Return a p-value as it is printed."""
    return "< 0.001" if p < 0.001 else f"{p:.3f}" if p < 0.1 else f"{p:.2f}"


def chance_text(it: Comparison) -> str:
    """Return a chance as it is printed."""
    return "below 0.1 %" if it.chance < 0.001 else f"{100.0 * it.chance:.1f} %"


def trials_text(trials: float) -> str:
    """Return a number of trials as it is printed; infinity is never."""
    return f"{trials:.0f}" if math.isfinite(trials) else "never"
