"""What a run found, as plain data: what was seen and what is believed are kept apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Recommendation
from vvvaltr.controller.loop.causes import find_loss_in


def summarise(trials: Sequence[LoggedTrial]) -> dict[str, Any]:
    """Return outcomes, best observed trial and recommended gait of a run."""
    valid = [logged for logged in trials if logged.score is not None]
    best = max(valid, key=lambda logged: logged.score or 0.0, default=None)
    recommendation = valid[-1].recommendation if valid else None
    loss = find_loss_in(trials)
    lost = {"lost_strength": {"since_trial": loss[1], "factor": loss[0].factor}} if loss else {}
    return {
        **lost,
        "trials": len(trials),
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
