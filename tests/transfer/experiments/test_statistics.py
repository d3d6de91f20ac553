import numpy as np
import pytest
from scipy.stats import wilcoxon

from vvvaltr.transfer.experiments.statistics import (
    chance_of_as_much,
    compare,
    gain_interval,
    holm,
    mean_interval,
    rank_biserial,
    signed_rank_p,
    trials_to_level,
)


def random() -> np.random.Generator:
    return np.random.default_rng(1)


def test_holm_multiplies_the_least_p_by_their_number_and_keeps_the_order() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


def test_against_one_replicate_the_p_is_of_the_paired_signed_rank_test() -> None:
    plain = random().normal(10.0, 1.0, 15)
    method = plain + random().normal(0.5, 1.0, 15)

    assert signed_rank_p(method, plain[:, None], random()) == pytest.approx(wilcoxon(method - plain).pvalue, abs=0.02)
    assert signed_rank_p(plain, plain[:, None], random()) == 1.0


def test_a_p_below_a_twentieth_is_as_rare_as_it_says_also_of_skewed_runs() -> None:
    draws = random()
    campaigns = [10.0 - draws.exponential(3.0, (20, 4)) for _ in range(100)]
    effects = [compare(runs[:, 0], runs[:, 1:], draws) for runs in campaigns[:40]]

    low = [signed_rank_p(runs[:, 0], runs[:, 1:], draws) < 0.05 for runs in campaigns]
    assert 0 < sum(low) <= 11
    assert abs(np.mean([it.effect for it in effects])) < 0.1


def test_the_effect_is_one_where_every_repeat_agrees_and_the_rank_difference_else() -> None:
    assert rank_biserial(np.array([0.1, 2.0, 3.0])) == 1.0
    assert rank_biserial(np.array([-0.1, -2.0])) == -1.0
    assert rank_biserial(np.array([1.0, -2.0, 3.0])) == pytest.approx((1 - 2 + 3) / 6)
    assert rank_biserial(np.zeros(3)) == 0.0


def test_the_interval_of_a_gain_holds_the_true_gain_about_as_often_as_it_says() -> None:
    draws = random()
    held = 0
    for _ in range(100):
        baseline = draws.normal(10.0, 2.0, 40)
        interval = gain_interval(1.2 * baseline + draws.normal(0.0, 2.0, 40), baseline, draws)
        held += interval.low <= 20.0 <= interval.high

    assert 88 <= held <= 100


def test_plain_against_itself_often_shows_a_small_gain_and_never_a_huge_one() -> None:
    plain = random().normal(10.0, 3.0, (10, 3))

    assert 0.2 < chance_of_as_much(0.5, plain, random()) < 0.8
    assert 0.2 < chance_of_as_much(-0.5, plain, random()) < 0.8
    assert chance_of_as_much(200.0, plain, random()) == 0.0
    assert chance_of_as_much(-90.0, plain, random()) == 0.0


def test_trials_to_a_level_are_the_median_runs_and_may_be_never() -> None:
    best = np.array([[1.0, 2.0, 3.0], [3.0, 3.0, 3.0], [1.0, 1.0, 1.0]])

    assert trials_to_level(best, 2.0) == 2.0
    assert trials_to_level(best, 0.5) == 1.0
    assert trials_to_level(best, 9.0) == np.inf


def test_the_band_of_one_repeat_is_unknown() -> None:
    low, high = mean_interval(np.array([[1.0, 2.0]]))

    assert np.isnan(low).all() and np.isnan(high).all()


def test_the_band_of_several_repeats_is_students() -> None:
    low, high = mean_interval(np.array([[1.0], [2.0], [3.0]]))

    assert (low[0], high[0]) == (
        pytest.approx(2.0 - 4.303 / 3**0.5, abs=1e-3),
        pytest.approx(2.0 + 4.303 / 3**0.5, abs=1e-3),
    )
