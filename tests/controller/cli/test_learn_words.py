"""What `vvvaltr learn` says of its best gait at the end."""

from typing import Any

import pytest

from vvvaltr.controller.cli.learn import _prose_of_best


@pytest.mark.parametrize(("high_m_s", "is_unknown"), [(0.025, False), (0.9, True)])
def test_a_best_gait_that_the_progress_calls_unknown_is_not_told_as_found(high_m_s: float, is_unknown: bool) -> None:
    best = {"gait_hz": [12.0, -14.0, 9.0], "mean_m_s": 0.02, "low_m_s": 0.0, "high_m_s": high_m_s}
    result: dict[str, Any] = {"recommended": best, "best_observed": {"trial": 1, "score_m_s": 0.02}}

    line, speed = _prose_of_best(result)

    assert line.startswith("best gait  12.00 -14.00 9.00 Hz")
    assert ("not known yet: make more trials" in line) is is_unknown
    assert f"95 % interval 0.0 to {1000.0 * high_m_s:.1f} mm/s" in speed
