import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.transfer.bayes.scale import Scale

SCORES = st.lists(st.floats(allow_nan=False, allow_infinity=False, width=64), min_size=1, max_size=20)


def test_scores_have_mean_zero_and_variance_one_on_their_scale() -> None:
    standardised = Scale.of(scores := np.array([1.0, 2.0, 6.0])).standardise(scores)
    assert (standardised.mean(), standardised.std()) == (pytest.approx(0.0), pytest.approx(1.0))


def test_equal_scores_are_measured_in_their_own_size() -> None:
    for scores, low, middle in (([0.02], 0.0, 0.02), ([-0.1] * 3, -0.2, -0.1)):
        assert Scale.linear(np.array(scores)).scores(np.array([0.0])) == pytest.approx([middle])
        assert sorted(Scale.linear(np.array(scores)).scores(np.array([-1.0, 1.0])))[0] == pytest.approx(low, abs=1e-6)
        assert Scale.of(np.array(scores)).scores(np.array([0.0])) == pytest.approx([middle])


def test_a_linear_scale_is_affine_and_the_other_makes_a_scatter_in_proportion_even() -> None:
    scores = np.array([1.0, 2.0, 8.0, 16.0])
    steps = np.diff(Scale.linear(scores).standardise(scores)), np.diff(Scale.of(scores).standardise(scores))
    assert steps[0][[0, 2]] == pytest.approx(steps[0][1] * np.array([1 / 6, 8 / 6]), rel=1e-6)
    assert steps[1][2] < 0.9 * steps[1][1]


def test_an_estimate_is_of_the_mean_over_the_noise_with_a_95_percent_interval() -> None:
    scale = Scale(bend=0.02, centre=0.5, spread=0.8)
    (estimate,) = scale.estimates(np.array([0.7]), np.array([0.09]), noise_variance=0.25)
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 0.5, 100_000)
    value = rng.normal(0.7, 0.3, 100_000)
    assert estimate.mean == pytest.approx(scale.scores(value + noise).mean(), rel=0.01)
    for bound, sign in ((estimate.low, -1.0), (estimate.high, 1.0)):
        assert bound == pytest.approx(scale.scores(0.7 + sign * 1.96 * 0.3 + noise).mean(), rel=0.01)


@given(SCORES)
def test_any_finite_scores_are_standardised_to_finite_numbers(scores: list[float]) -> None:
    scale = Scale.of(np.array(scores))
    standardised = scale.standardise(np.array(scores))
    assert np.isfinite(standardised).all()
    assert np.abs(standardised).max() <= np.sqrt(len(scores)) + 1e-6


def test_an_interval_that_nothing_is_known_of_ends_at_a_hundred_times_the_size_of_the_scores() -> None:
    scale = Scale.of(np.array([0.01, 0.03]))
    estimate = scale.estimates(np.zeros(1), np.array([400.0]), 1.0)[0]
    assert (estimate.low, estimate.high) == (pytest.approx(-2.0), pytest.approx(2.0))
