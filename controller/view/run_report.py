"""The report of a run: one HTML file that needs nothing else, for screen, telephone and paper."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr import __version__
from vvvaltr.controller.core.disk import write_whole
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Estimate
from vvvaltr.controller.view import run_figures as figures
from vvvaltr.controller.view.commands import write_making_command, write_trial_command
from vvvaltr.controller.view.page import to_png, write_figure, write_page, write_table
from vvvaltr.controller.view.run_findings import LeftOut, RunFindings, describe_start_drift, find_in_run
from vvvaltr.controller.view.run_movements import read_errand, write_movements
from vvvaltr.controller.view.scatter_causes import find_causes, tell_scatter
from vvvaltr.controller.view.showing import name_run
from vvvaltr.controller.view.words import write_gait

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_BELIEF = (
    " Line and band: posterior mean of the gait that was recommended after each trial, and its 95 % interval. The axis "
    "follows what was measured; the first intervals reach beyond it."
)


def write_run_report(path: Path, page: Path) -> RunFindings:
    """Write the report of the run in ``path``, a directory or a log, to ``page``; return what it found.

    Raises:
        UserError: there is no run, or none of its trials measured anything.
        ImportError: matplotlib is missing.
        OSError: the page cannot be written.
    """
    found = find_in_run(path)
    title = name_run(path)
    sections = (
        _head(found, title),
        write_movements(found, path),
        _search(found),
        _trials(found),
        _robot(found),
        _transfer(found),
        _making(found),
    )
    write_whole(page, write_page(f"Run {title}", "\n".join(part for section in sections for part in section)))
    return found


def _head(found: RunFindings, title: str) -> Iterator[str]:
    yield f"<h1>Run {escape(title)}</h1>"
    about = found.run.about
    robot = " ".join(filter(None, (about.get("robot", ""), found.config.robot.world or "" if found.config else "")))
    if found.config is not None and found.config.robot.is_twin:
        robot += " twin (simulated; so is the scatter between repeats)"
    yield f"<p>{escape(', '.join(filter(None, (robot, about.get('date', '')))))}</p>"
    if not found.ranked:
        best = max(found.valid, key=lambda it: it.score or 0.0)
        yield (
            "<p class='key'>No gait is recommended: there was no search, or its method has no model. "
            f"The fastest of {len(found.valid)} trials was "
            f"trial {best.trial.number} with {_mm_s(best.score or 0.0)} mm/s; one trial alone may be luck.</p>"
        )
        return
    (gait, estimate), *others = found.ranked
    yield (
        f"<div class='key'><p><b>Best gait: {write_gait(gait, 2)}</b><br>{_write_estimate(estimate)}</p>"
        f"<p>{escape(_compare(estimate, others))}</p>"
        f"<p>Drive it:</p><pre>{escape(write_trial_command(gait, about.get('robot', ''), found.config))}</pre></div>"
    )
    if others:
        rows = [(f"{place}", write_gait(it, 2), *_write_bounds(of)) for place, (it, of) in enumerate(found.ranked, 1)]
        yield write_table(
            "The recommended gait and other promising ones, and what the model believes of their mean speeds",
            ("place", "gait", "mean (mm/s)", "95 % interval (mm/s)"),
            rows,
        )


def _compare(best: Estimate, others: list[tuple[Gait, Estimate]]) -> str:
    """Return in words how the recommended gait compares with the fastest other."""
    if not others:
        return "The model names no second gait."
    gait, second = others[0]
    how = f"{_mm_s(abs(best.mean - second.mean))} mm/s {'slower' if second.mean <= best.mean else 'faster'}"
    lead = f"The next one, {write_gait(gait, 2)}, is expected to be {how}"
    if best.low > second.high:
        return f"{lead}. The two intervals do not overlap: the order is clear."
    return f"{lead}. The two intervals overlap: repeat both (--confirm 2x5) before relying on their order."


def _search(found: RunFindings) -> Iterator[str]:
    yield "<h2>The search</h2><div class='pair'>"
    yield _draw(
        figures.draw_convergence(found),
        "Speed of each trial." + (_BELIEF if any(it.recommendation for it in found.run.trials) else ""),
    )
    if found.left_out is not None:
        yield _draw(figures.draw_left_out(found.left_out), _describe_left_out(found.left_out))
    yield "</div>"
    yield "<div class='pair'>"
    for name, figure in figures.draw_surfaces(found):
        yield _draw(
            figure,
            f"Expected speed over {name}, all else as in the best gait (star). White dots: the trials, which differ in "
            "the other motors, too.",
        )
    yield "</div>"


def _describe_left_out(left_out: LeftOut) -> str:
    inside = round(left_out.coverage * len(left_out.trials))
    verdict = "as it should be" if 0.88 <= left_out.coverage <= 0.99 else "a sound model has about 95 %"
    return (
        f"Each trial against what all others let expect (leave-one-out, with a model of this run alone). {inside} of "
        f"{len(left_out.trials)} lie within their 95 % interval: {100.0 * left_out.coverage:.0f} %, {verdict}."
    )


def _trials(found: RunFindings) -> Iterator[str]:
    yield "<h2>The trials</h2><div class='pair'>"
    trials = found.run.trials
    yield _draw(figures.draw_outcomes(found), f"How the {len(trials)} trials ended.")
    if found.left_out is not None:
        yield _draw(figures.draw_drift(found.left_out), _describe_drift(found.left_out))
    yield "</div>"
    reasons = Counter((it.trial.outcome.words, it.trial.reason) for it in trials if it.trial.reason)
    if reasons:
        rows = [(outcome, reason, str(count)) for (outcome, reason), count in reasons.most_common(30)]
        yield write_table("Why trials did not run to their end", ("outcome", "reason", "trials"), rows)
    suspects = [(str(it.trial.number), it.review.suspicion) for it in trials if it.review.is_suspect]
    if suspects:
        yield write_table("Trials that a check found suspect", ("trial", "why"), suspects[:30])
    if causes := list(tell_scatter(find_causes(trials))):
        yield write_table("Causes of scatter that the trials tell", ("cause", "what was found"), causes[:30])


def _describe_drift(left_out: LeftOut) -> str:
    text = "Drift: what was observed minus what all other trials let expect, in standard deviations; grey: 95 %. "
    drift = left_out.drift
    if drift is None:
        return text + "Too few trials to tell whether the robot changed."
    change = f"From the first trial to the last it changed by {drift.mean:+.1f} ({drift.low:+.1f} to {drift.high:+.1f})"
    if drift.low <= 0.0 <= drift.high:
        return f"{text}{change}: no change was shown."
    return f"{text}{change}: the robot became {'faster' if drift.mean > 0.0 else 'slower'}; look at battery and floor."


def _robot(found: RunFindings) -> Iterator[str]:
    motors, starts = figures.draw_motors(found), figures.draw_starts(found)
    if motors is None and starts is None:
        return
    yield "<h2>The robot</h2><div class='pair'>"
    if motors is not None:
        yield _draw(
            motors, "Frequency that each motor applied, mean of the drive with its ramp, against what was asked."
        )
    if starts is not None:
        yield _draw(
            starts,
            f"Where each trial began, with the robot's heading, and where it ended, seen from above. "
            f"{describe_start_drift(found.run.trials)}",
        )
    yield "</div>"
    batteries = [it.trial.conditions.battery_v for it in found.run.trials if it.trial.conditions.battery_v is not None]
    if batteries:
        yield f"<p>Battery: {batteries[0]:.2f} V at the first trial, {batteries[-1]:.2f} V at the last.</p>"
    dropped = sum(it.trial.conditions.dropped_poses for it in found.run.trials)
    if dropped:
        yield f"<p>The tracker reported {dropped} poses that cannot be; they were left out.</p>"


def _transfer(found: RunFindings) -> Iterator[str]:
    sources = found.run.sources
    if not sources:
        return
    yield "<h2>What was transferred</h2>"
    trust = found.run.trials[-1].suggestion.hyperparameters
    rows = [
        (f"source {place}", it.name, str(len(it.gaits)), _mm_s(max(it.scores)), _write_trust(trust, place))
        for place, it in enumerate(sources, 1)
    ]  # fmt: skip
    yield write_table(
        "Trials of earlier runs that this run began with",
        ("source", "run", "trials", "fastest trial (mm/s)", "trust at the end"),
        rows,
    )
    if (figure := figures.draw_trust(found)) is not None:
        yield _draw(figure, "How far each source was trusted when a trial was chosen: 1 is fully, 0 not at all.")


def _write_trust(hyperparameters: Mapping[str, float], place: int) -> str:
    trust = hyperparameters.get(f"source_{place}_trust")
    return "this method does not tell" if trust is None else f"{trust:.2f}"


def _making(found: RunFindings) -> Iterator[str]:
    yield "<h2>How it was made</h2>"
    if found.config is not None:
        command = write_making_command(found.config, read_errand(found.path))
        yield f"<p>The same again:</p><pre>{escape(command)}</pre>"
    about = {"log": str(found.path), **found.run.about, "report by": f"vvvaltr {__version__}"}
    yield write_table("", ("what", "value"), list(about.items()))


def _draw(figure: Figure, caption: str) -> str:
    return write_figure(to_png(figure), caption)


def _write_estimate(it: Estimate) -> str:
    return f"{_mm_s(it.mean)} mm/s (posterior mean), 95 % interval {_mm_s(it.low)} to {_mm_s(it.high)} mm/s"


def _write_bounds(it: Estimate) -> tuple[str, str]:
    return _mm_s(it.mean), f"{_mm_s(it.low)} to {_mm_s(it.high)}"


def _mm_s(speed_m_s: float) -> str:
    return f"{1000.0 * speed_m_s:.1f}"
