"""A run in words, as Markdown: its result, and a table of its trials."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import LoggedTrial, Run, SteeringStep
from vvvaltr.controller.core.values import Pose

_TABLE_ROWS = 60  # the newest trials; `vvvaltr export` has all
_TWINS = ("planar", "spatial")


def write_gait(gait: Gait, digits: int = 1) -> str:
    """Return a gait as text, with its phases and amplitudes where these are not the usual ones."""
    parts = [f"{_join_numbers(gait.frequency_hz, digits)} Hz"]
    if any(gait.phase_rad):
        parts.append(f"phases {_join_numbers(gait.phase_rad, 2)} rad")
    if any(share != 1.0 for share in gait.amplitude):
        parts.append(f"amplitudes {_join_numbers(gait.amplitude, 2)}")
    return ", ".join(parts)


def _join_numbers(numbers: Sequence[float], digits: int) -> str:
    return " / ".join(f"{number:.{digits}f}" for number in numbers)


def describe(logged: LoggedTrial) -> str:
    """Return what a trial came to: its speed, or why it measured nothing."""
    if logged.score is None:
        return logged.trial.ending
    return f"{1000 * logged.score:.1f} mm/s" + (", suspect" if logged.review.is_suspect else "")


def write_about(run: Run, has_maps: bool = False) -> str:
    """Return what the run was made with, of a twin that its scatter is simulated, and what the maps show."""
    about = [f"{key} {run.about[key]}" for key in ("robot", "seed", "version", "date") if key in run.about]
    if run.about.get("robot") in _TWINS:
        about.append("a twin: the scatter between repeats is simulated")
    maps = (
        "Maps: speed expected over two motors, the others as in the best gait. Dots: trials, by their speed; "
        "star: best gait; ring: the next one."
    )
    return "\n\n".join(filter(None, (maps if has_maps else "", "; ".join(about))))


def write_result(trials: Sequence[LoggedTrial]) -> str:
    """Return the result of a run, or of its first trials."""
    if trials and trials[-1].steering is not None and trials[-1].recommendation is None:
        return _write_way(trials, trials[-1].steering)
    outcomes = Counter([logged.trial.outcome for logged in trials])
    counts = ", ".join(f"{count} {outcome.words}" for outcome, count in outcomes.most_common())
    recommended = [logged.recommendation for logged in trials if logged.recommendation is not None]
    measured = [logged for logged in trials if logged.score is not None]
    if not recommended or not measured:
        return f"### No gait yet\n\nTrials: {counts}."
    best, luckiest = recommended[-1], max(measured, key=lambda logged: logged.score or 0.0)
    estimate = best.estimate
    return (
        f"### Best gait: {write_gait(best.gait)}\n\n"
        f"**{1000 * estimate.mean:.1f} mm/s** (posterior mean), "
        f"95 % interval {1000 * estimate.low:.1f} to {1000 * estimate.high:.1f} mm/s\n\n"
        f"{len(trials)} trials: {counts}\n\n"
        f"The fastest single trial was {luckiest.trial.number} with {describe(luckiest)}; one trial alone may be luck."
    )


def _write_way(trials: Sequence[LoggedTrial], step: SteeringStep) -> str:
    """Return where a run of steering goes, how far it has come, and what was planned for its last movement."""
    x_m, y_m = step.goal_m
    heading = "" if step.goal_yaw_rad is None else f", heading {step.goal_yaw_rad:.2f} rad"
    seen = [pose for logged in trials for pose in logged.trial.poses[-1:]]
    left = _write_rest(seen[-1], step) if seen else "where the robot is was not seen"
    movements = f"{len(trials)} movement{'s' * (len(trials) > 1)}"
    expected = step.predicted
    return (
        f"### Going to {x_m:.3f} {y_m:.3f} m{heading}\n\n{left}, after {movements}\n\n"
        f"Plan of the last movement: {max(1, len(step.plan))} up to the goal; this one was to take the robot "
        f"{1000.0 * expected.forward_m:.0f} mm forward, {1000.0 * expected.left_m:.0f} mm to the left, and turn it by "
        f"{expected.turn_rad:.2f} rad (arrow)."
    )


def _write_rest(pose: Pose, step: SteeringStep) -> str:
    """Return how far it is from a pose to the goal."""
    left_m = math.dist(pose.position_m[:2], step.goal_m)
    if step.goal_yaw_rad is None:
        return f"**{1000.0 * left_m:.0f} mm to go**"
    turn_rad = math.remainder(step.goal_yaw_rad - pose.yaw_rad, math.tau)
    return f"**{1000.0 * left_m:.0f} mm to go**, {abs(turn_rad):.2f} rad to turn"


def write_tables(trials: Sequence[LoggedTrial], counts: Sequence[int]) -> list[str]:
    """Return tables of the newest among the first so many trials, the newest one first, for each of ``counts``."""
    first = max(0, min(counts, default=0) - _TABLE_ROWS)
    rows = [_write_row(logged) for logged in trials[first:]]
    return [_join_rows(rows[max(0, count - _TABLE_ROWS - first) : count - first], count) for count in counts]


def _join_rows(rows: Sequence[str], count: int) -> str:
    lines = ["| trial | gait (Hz) | mm/s | outcome | why |", "|--:|---|--:|---|---|", *reversed(rows)]
    if count > len(rows):
        lines.append(f"\n{count - len(rows)} earlier trials are not listed; vvvaltr export writes all.")
    return "\n".join(lines)


def _write_row(logged: LoggedTrial) -> str:
    speed = "" if logged.score is None else f"{1000 * logged.score:.1f}"
    gait = _join_numbers(logged.trial.gait.frequency_hz, 1)
    cells = (str(logged.trial.number), gait, speed, logged.trial.outcome.words, _reason(logged))
    return f"| {' | '.join(cells)} |"


def _reason(logged: LoggedTrial) -> str:
    """Return why a trial ended as it did, what is suspect about it, and whether it belongs to no search."""
    suspicion = f"suspect: {logged.review.suspicion}" if logged.review.is_suspect else ""
    text = "; ".join(filter(None, (logged.trial.reason, suspicion)))
    return (text or logged.suggestion.origin).replace("|", "/").replace("\n", " ")
