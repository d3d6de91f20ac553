"""The report of a campaign: one self-contained HTML file, and its figures as files of their own."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.controller.core.disk import make_own_folder, write_whole
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.view.page import to_png, write_figure, write_page, write_table
from vvvaltr.transfer.experiments import figures, tables
from vvvaltr.transfer.experiments.findings import PairFindings, gather_findings
from vvvaltr.transfer.experiments.store import Store
from vvvaltr.transfer.experiments.surfaces import fit_surfaces
from vvvaltr.transfer.experiments.tables import Table
from vvvaltr.transfer.experiments.unit import Settings, open_condition
from vvvaltr.transfer.methods.registry import METHODS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FEWEST_REPEATS = 6  # with fewer, a single lucky run decides

_READING = """
<p>A robot with vibration motors searches for a fast gait by trial: one gait at a time, each trial noisy.
<b>Plain-BO</b> (Bayesian optimisation) begins with nothing. The <b>transfer</b> methods begin with the trials of an
earlier run in another condition, the <i>source</i>. Do they find a good gait on the <i>target</i> sooner, and do they
do harm where the two have little in common?</p>
<ul>
<li><b>True speed</b>: at each checkpoint a method recommends a gait. That gait is then run from %(starts)d fresh
starts on the twin; the mean is its true speed. The method never sees these runs.</li>
<li><b>Best observed</b>: the greatest speed seen so far in any single trial, which is what the thesis plots. With noisy
trials it belongs to the luckiest trial and overstates the gait's speed.</li>
<li><b>Gain</b>: the excess of the mean over the repeats over Plain-BO's, with the 95 %% interval (bootstrap over
repeats) in brackets. An interval on both sides of 0 means that no difference was shown.</li>
<li><b>p</b>: p of Wilcoxon's signed-rank test, paired by seed, with permutations of each repeat's runs; in the first
table of each experiment after Holm's correction for the number of methods.</li>
<li><b>Effect size</b>: rank-biserial correlation; +1 if the method was ahead in every repeat, -1 if it was behind in
every repeat.</li>
<li><b>Chance</b>: how often one run of Plain-BO per repeat, compared with the other runs of Plain-BO, gains as much by
luck alone.</li>
<li>Plain-BO is grey, methods that learn from the source are blue, the controls <i>optimistic</i> and <i>random</i> are
red. A gain that <i>optimistic</i> shows as well is not due to transfer.</li>
</ul>
"""


def write_report(store: Store) -> Path:
    """Write `report.html` and `figures/` into the campaign's folder and return the file; an older report is replaced.

    Raises:
        UserError: no repeat of any experiment is complete.
        ImportError: matplotlib is missing.
        OSError: the folder cannot be written.
    """
    found = require_findings(store)
    folder = store.folder / "figures"
    make_own_folder(folder)
    page = "\n".join([*_head(store.settings, found, folder), *(_section(store, it, folder) for it in found)])
    path = store.folder / "report.html"
    write_whole(path, write_page("Transfer between conditions", page))
    return path


def require_findings(store: Store) -> tuple[PairFindings, ...]:
    """Return the campaign's findings. Raises UserError where no repeat of any experiment is complete."""
    found = gather_findings(store)
    if not found:
        raise UserError(
            f"{store.folder}: no repeat of an experiment is complete yet; continue it with vvvaltr experiment"
        )
    return found


def to_markdown(found: Sequence[PairFindings]) -> str:
    """Return all tables in Markdown, for documentation."""
    parts = [*map(tables.to_markdown, tables.compare_with_thesis(found))]
    for it in found:
        parts.append(f"### {_title(it)}\n\n{_repeats(it)} of {it.checkpoints[-1]} trials. {it.pair.why}")
        every = (tables.tabulate_true_speeds(it), *tables.tabulate_gains_over_drive(it), tables.tabulate_verdicts(it))
        parts += map(tables.to_markdown, every)
    return "\n\n".join(parts)


def _head(settings: Settings, found: Sequence[PairFindings], folder: Path) -> list[str]:
    motors = "motors turn both ways" if settings.signed else "motors turn one way"
    methods = dict.fromkeys(name for it in found for name in it.methods)
    return [
        "<h1>Does what was learned before help?</h1>",
        f"<p>{settings.robot} twin, {motors}, trials of {settings.duration_s:g} s, seed {settings.seed}.</p>",
        _READING % {"starts": settings.starts},
        _figure(figures.draw_overview(found), folder / "overview.png",
                "All experiments at a glance. To the right of the grey line "
                "a method is faster than Plain-BO; the dotted line is 5 % slower."),
        *map(_table, tables.compare_with_thesis(found)),
        "<h3>The methods</h3><ul>",
        *(f"<li><b>{escape(name)}</b>: {escape(METHODS[name].description)}</li>" for name in methods),
        "</ul>",
    ]  # fmt: skip


def _section(store: Store, it: PairFindings, folder: Path) -> str:
    pair = it.pair
    _, space = open_condition(store.settings, pair.target, seed=0)
    learned = fit_surfaces(space, it.source_runs, it.target_runs)
    inverted = ", its scores turned upside down" if pair.inverted else ""
    inverted += ", its scores dealt out by the strength of its gaits" if pair.shuffled else ""
    return "\n".join([
        f"<h2 id='{escape(pair.key)}'>{escape(_title(it))}</h2>",
        f"<p>{escape(pair.why)} Source: {escape(pair.source.title)}{inverted}. Target: {escape(pair.target.title)}. "
        f"{_repeats(it)} of {it.checkpoints[-1]} trials.</p>",
        f"<p class='key'>{escape(_in_words(it))}</p>",
        _figure(figures.draw_true_speed(it), folder / f"{pair.key}-true-speed.png",
                "True mean speed of the recommended gait against the trial, with the 95 % band of the mean. "
                "Grey: Plain-BO."),
        _table(tables.tabulate_true_speeds(it)),
        *map(_table, tables.tabulate_gains_over_drive(it)),
        _figure(figures.draw_best_so_far(it), folder / f"{pair.key}-best-so-far.png",
                "Best observed speed so far, as the thesis plots it. Dotted: final level of Plain-BO's median run; the "
                "triangle is where the method's median run reaches it."),
        _table(tables.tabulate_verdicts(it)),
        _figure(figures.draw_learned(learned, it), folder / f"{pair.key}-learned.png",
                "What the runs have learned, source and target side by side: expected speed over two motors, with the "
                "third as given. On both, the star marks the gait that is expected to be fastest on the target."),
    ])  # fmt: skip


def _repeats(it: PairFindings) -> str:
    return f"{it.repeats} repeat{'s' * (it.repeats > 1)}"


def _title(it: PairFindings) -> str:
    number = f"Experiment {it.pair.key}" if it.pair.key[0].isdigit() else f"Control, {it.pair.key}"
    return f"{number}: {it.pair.title}"


def _in_words(it: PairFindings) -> str:
    """Return in words what the experiment shows about the default method, or else about the published one."""
    name = next((name for name in ("guarded", "efficient") if name in it.methods), None)
    if name is None:
        return f"Plain-BO ends at a true speed of {1000.0 * it.plain.runs.mean_true_m_s[-1]:.1f} mm/s."
    if it.repeats < _FEWEST_REPEATS:
        return f"{_repeats(it)}: too few to distinguish the methods from chance; run {_FEWEST_REPEATS} or more."
    sentences = []
    for checkpoint, comparison in zip(it.checkpoints[-3:], it.methods[name].against_plain[-3:], strict=True):
        interval = comparison.interval_percent
        assert interval is not None  # of so many repeats
        verdict = "faster" if interval.low > 0.0 else "slower" if interval.high < 0.0 else "no difference shown"
        sentences.append(f"after {checkpoint} trials {tables.gain_text(comparison)} ({verdict})")
    return f"True speed of {name} against Plain-BO: {'; '.join(sentences)}."


def _figure(figure: Figure, path: Path, caption: str) -> str:
    picture = to_png(figure)
    write_whole(path, picture)
    return write_figure(picture, caption)


def _table(table: Table) -> str:
    return write_table(table.caption, table.columns, table.rows)
