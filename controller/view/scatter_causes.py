"""What the scatter of a run is made of, as far as its trials tell: strength, floor, suspect and reference trials."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Phase
from vvvaltr.controller.loop.causes import find_drift_in, find_loss_in
from vvvaltr.controller.loop.summary import summarise, tell_causes
from vvvaltr.transfer.causes.floor import Drift
from vvvaltr.transfer.causes.strength import Loss

_RECENT = 60  # trials in which the floor is looked for: more say little more, and take seconds
_NAMED = 10  # trials that are named of a kind


@dataclass(frozen=True, slots=True)
class ScatterCauses:
    """What is known after some trials.

    Args:
        told: what the run's summary says: a word for each cause, and a sentence.
        loss: a loss of strength that is certain, and the number of the first trial with it; None for none.
        drift: of the floor; None where the trials do not tell it.
        suspects: trials that a check found suspect.
        references: valid trials of the reference gait.
    """

    told: tuple[tuple[str, str], ...]
    loss: tuple[Loss, int] | None
    drift: Drift | None
    suspects: tuple[LoggedTrial, ...]
    references: tuple[LoggedTrial, ...]


def find_causes(trials: Sequence[LoggedTrial]) -> ScatterCauses:
    """Return what ``trials`` tell."""
    return ScatterCauses(
        tuple(tell_causes(summarise(trials))),
        find_loss_in(trials),
        find_drift_in(trials[-_RECENT:]),
        tuple(logged for logged in trials if logged.review.is_suspect),
        tuple(logged for logged in trials if is_reference(logged)),
    )


def is_reference(logged: LoggedTrial) -> bool:
    """Return whether a trial is of the reference gait, and measured something."""
    return logged.suggestion.phase is Phase.REFERENCE and logged.score is not None


def tell_scatter(causes: ScatterCauses) -> Iterator[tuple[str, str]]:
    """Yield a word for each cause that was found, and a sentence."""
    yield from causes.told
    is_corrected = any(word == "corrected" for word, _ in causes.told)  # which names the floor's drift already
    if causes.drift is not None and causes.drift.is_told and not is_corrected:
        yield "floor", _describe_floor(causes.drift)
    if causes.suspects:
        numbers = [str(logged.trial.number) for logged in causes.suspects]
        yield "suspect", _list("trial", numbers)
    if causes.references:
        speeds = [f"{it.trial.number} with {1000.0 * (it.score or 0.0):.1f}" for it in causes.references]
        yield "reference", f"{_list('trial', speeds)} mm/s"


def _describe_floor(drift: Drift) -> str:
    """Return in words where an inclined floor carries the robot."""
    return (
        f"inclined ({100.0 * drift.is_inclined:.0f} % certain), it carries the robot by {1000.0 * drift.speed_m_s:.1f} "
        f"+- {1000.0 * drift.deviation_m_s:.1f} mm/s towards {math.degrees(drift.azimuth_rad):.0f} degrees from x"
    )


def _list(noun: str, items: Sequence[str]) -> str:
    """Return the newest of some items, and how many others there are."""
    earlier = len(items) - _NAMED
    more = f" and {earlier} before" if earlier > 0 else ""
    return f"{noun}{'s' * (len(items) > 1)} {', '.join(items[-_NAMED:])}{more}"
