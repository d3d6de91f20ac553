"""What a run found, as plain data: what was seen and what is believed are kept apart."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Phase, Recommendation
from vvvaltr.controller.loop.causes import find_loss_in, find_standing_gaits
from vvvaltr.transfer.causes.correction import CAUSES, FLOOR_PROBABILITY, FLOOR_SD, FLOOR_X, FLOOR_Y, STRENGTH

_LIKELY = 0.8  # probability of a drift from which on its direction is told


def summarise(trials: Sequence[LoggedTrial]) -> dict[str, Any]:
    """Return outcomes, best observed trial and recommended gait of a run.

    ``valid_trials`` are those that count towards a run's number of trials: neither failed, discarded nor a reference.
    """
    valid = [logged for logged in trials if logged.score is not None]
    best = max(valid, key=lambda logged: logged.score or 0.0, default=None)
    # An interrupt may have kept the optimiser from learning from the last trial: then what it believed before counts.
    recommendation = next((it.recommendation for it in reversed(valid) if it.recommendation is not None), None)
    loss = find_loss_in(trials)
    lost = {"lost_strength": {"since_trial": loss[1], "factor": loss[0].factor}} if loss else {}
    corrected = describe_correction(trials)
    standing = [
        {
            "gait_hz": list(gait.frequency_hz),
            "trials": it.trials,
            "moved": it.moving,
            "speed_m_s": it.speed_m_s,
            "probability": it.probability,
        }
        for gait, it in find_standing_gaits(trials).items()
    ]
    return {
        **lost,
        **({"corrected": corrected} if corrected else {}),
        **({"stood_still": standing} if standing else {}),
        "trials": len(trials),
        "valid_trials": sum(logged.suggestion.phase is not Phase.REFERENCE for logged in valid),
        "outcomes": dict(Counter(logged.trial.outcome.value for logged in trials)),
        "best_observed": best
        and {
            "trial": best.trial.number,
            "gait_hz": list(best.trial.gait.frequency_hz),
            "score_m_s": best.score,
        },
        "recommended": recommendation and describe_recommendation(recommendation),
    }


def describe_recommendation(recommendation: Recommendation) -> dict[str, Any]:
    """Return a recommended gait with what is believed of its true speed."""
    return {
        "gait_hz": list(recommendation.gait.frequency_hz),
        "mean_m_s": recommendation.estimate.mean,
        "low_m_s": recommendation.estimate.low,
        "high_m_s": recommendation.estimate.high,
    }


def describe_correction(trials: Sequence[LoggedTrial]) -> dict[str, float]:
    """Return what the recommended speed is corrected for, as the model found it in the end; empty for nothing.

    ``strength`` is today's over that of the first trial; the floor's drift is that of a gait of mean frequencies.
    """
    fit = next((logged.fit for logged in reversed(trials) if logged.score is not None), None)
    return {name: fit.hyperparameters[name] for name in CAUSES if name in fit.hyperparameters} if fit else {}


def tell_causes(found: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what a summary says of the causes of scatter: a word for each, and a sentence."""
    if corrected := found.get("corrected"):
        yield "corrected", _tell_correction(corrected)
    if lost := found.get("lost_strength"):
        change = f"from trial {lost['since_trial']} on the robot moved {lost['factor']:.2f} times as far"
        yield "strength", f"{change}: battery, springs, floor?"
    for it in found.get("stood_still", ()):
        gait = " ".join(f"{hz:.2f}" for hz in it["gait_hz"])
        moved = f"{gait} Hz moved in {it['moved']} of {it['trials']} trials"
        yield "stood", f"{moved}, {1000.0 * it['speed_m_s']:.1f} mm/s when it did"


def _tell_correction(corrected: Mapping[str, float]) -> str:
    """Return for what floor and strength the speeds are given."""
    strength = f"today's strength ({corrected[STRENGTH]:.2f} of the first trial's)" if STRENGTH in corrected else ""
    if FLOOR_X not in corrected:
        return f"the speed is that at {strength}"
    x_mm_s, y_mm_s, sd_mm_s = (1000.0 * corrected[name] for name in (FLOOR_X, FLOOR_Y, FLOOR_SD))
    drift = f"the floor carries the robot by {math.hypot(x_mm_s, y_mm_s):.1f} +- {sd_mm_s:.1f} mm/s"
    if corrected[FLOOR_PROBABILITY] >= _LIKELY:
        drift += f" towards {math.degrees(math.atan2(y_mm_s, x_mm_s)):.0f} degrees"
    return f"the speed is that on a level floor{f' at {strength}' if strength else ''}; {drift}"
