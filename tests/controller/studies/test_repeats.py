import pytest
from scipy import stats

from vvvaltr.controller.studies.repeats import mean_with_interval


def test_the_interval_is_students() -> None:
    scores = [0.012, 0.020, 0.009, 0.015]

    found = mean_with_interval(scores)

    assert found is not None
    expected = stats.ttest_1samp(scores, 0.0).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))
    assert found.mean == pytest.approx(0.014)


@pytest.mark.parametrize("scores", [[], [0.01]])
def test_one_trial_has_no_interval(scores: list[float]) -> None:
    assert mean_with_interval(scores) is None
