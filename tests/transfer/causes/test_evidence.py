import math

import numpy as np
import pytest

from vvvaltr.transfer.causes.evidence import difference, find_best


def test_looking_after_every_round_finds_a_difference_that_is_not_there_in_fewer_runs_than_allowed():
    random = np.random.default_rng(0)
    found = 0
    for _ in range(400):
        values = random.normal(0.0, 1.0, 40)
        found += any(difference(values[:n].tolist(), 0.9).is_decided for n in range(2, 41))

    assert 0.02 < found / 400 < 0.10


def test_a_difference_as_large_as_its_scatter_is_found_within_thirty_rounds():
    random = np.random.default_rng(1)

    found = [difference(random.normal(1.0, 1.0, 30).tolist(), 0.95).low > 0.0 for _ in range(100)]

    assert np.mean(found) > 0.95


def test_the_interval_holds_the_truth():
    random = np.random.default_rng(2)
    samples = [difference(random.normal(0.3, 1.0, 25).tolist(), 0.95) for _ in range(200)]

    assert np.mean([it.low <= 0.3 <= it.high for it in samples]) >= 0.95


def test_few_rounds_prove_nothing():
    assert difference([], 0.95).low == -math.inf
    assert difference([1.0], 0.95).low == -math.inf
    assert not difference([1.0, 1.001], 0.95).is_decided
    assert find_best([[1.0, 0.0], [1.0, 0.0]], 0.95) is None


def test_the_unit_does_not_matter():
    values = np.random.default_rng(3).normal(1.0, 1.0, 12)

    assert difference((1000.0 * values).tolist(), 0.95).low == pytest.approx(
        1000.0 * difference(values.tolist(), 0.95).low
    )


def test_the_best_gait_is_named_only_when_it_beats_every_other():
    random = np.random.default_rng(4)
    clear = np.column_stack([random.normal(mean, 1.0, 30) for mean in (0.0, 5.0, 1.0)])
    tied = np.column_stack([random.normal(mean, 1.0, 30) for mean in (0.0, 5.0, 5.0)])

    assert find_best(clear, 0.95) == 1
    assert find_best(tied, 0.95) is None


def test_a_drift_common_to_both_gaits_costs_nothing():
    random = np.random.default_rng(5)
    drift = np.linspace(0.0, 20.0, 10)
    scores = np.column_stack([drift + random.normal(mean, 0.3, 10) for mean in (0.0, 1.0)])

    assert find_best(scores, 0.95) == 1
