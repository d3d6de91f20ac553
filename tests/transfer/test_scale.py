import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from transfer.scale import Scale

SCORES = st.lists(st.floats(allow_nan=False, allow_infinity=False, width=64), min_size=1, max_size=20)


def test_scores_have_mean_zero_and_variance_one_on_their_scale() -> None:
    standardised = Scale.of(scores := np.array([1.0, 2.0, 6.0])).standardise(scores)
    assert (standardised.mean(), standardised.std()) == (pytest.approx(0.0), pytest.approx(1.0))


def test_equal_scores_are_measured_in_their_own_size() -> None:
    for scores, centre, spread in (([0.02], 0.02, 0.02), ([-0.1] * 3, -0.1, 0.1), ([0.0] * 3, 0.0, 1.0)):
        scale = Scale.of(np.array(scores))
        assert [scale.centre, scale.spread] == pytest.approx([centre, spread])


def test_an_estimate_is_in_the_unit_of_the_scores_with_a_95_percent_interval() -> None:
    (estimate,) = Scale(10.0, 2.0).estimates(np.array([0.5]), np.array([4.0]))
    assert [estimate.mean, estimate.low, estimate.high] == pytest.approx([11.0, 3.16, 18.84])


@given(SCORES)
def test_any_finite_scores_are_standardised_to_finite_numbers(scores: list[float]) -> None:
    scale = Scale.of(np.array(scores))
    standardised = scale.standardise(np.array(scores))
    assert np.isfinite(standardised).all()
    assert np.abs(standardised).max() <= np.sqrt(len(scores)) + 1e-6
