import numpy as np
import pytest

from vvvaltr.transfer.causes.standing import describe_standing, find_standing, is_far_below

# As a laboratory's robot: one trial in four stands still.
BIMODAL = [0.176, 0.012, 0.017, 0.224, 0.018, 0.160, 0.149, 0.147, 0.185, 0.013, 0.185, 0.174, 0.011, 0.200, 0.171]


def test_trials_that_stood_still_are_told_from_those_that_moved():
    stood = find_standing(BIMODAL)

    assert [speed < 0.05 for speed in BIMODAL] == list(stood)
    assert str(describe_standing(BIMODAL)) == "moved in 10 of 15 trials, 177.1 mm/s when it did"


def test_a_gait_that_scatters_widely_does_not_stand_still():
    random = np.random.default_rng(0)
    found = [any(find_standing(np.abs(random.normal(1.0, 0.3, 20)).tolist())) for _ in range(200)]

    assert np.mean(found) < 0.1


def test_a_gait_that_never_moves_has_no_trial_that_stands_out():
    assert not any(find_standing([0.0, 0.0, 0.0]))
    assert describe_standing([0.0, 0.0]).moving == 2


def test_the_probability_of_standing_grows_with_what_was_seen():
    never, often = describe_standing([1.0] * 10), describe_standing([1.0] * 6 + [0.01] * 4)

    assert never.probability == pytest.approx(0.5 / 20.0)
    assert often.probability == pytest.approx(4.5 / 20.0)


def test_a_trial_far_below_what_the_gait_did_before_is_suspect():
    assert is_far_below(0.015, [0.180, 0.170])
    assert is_far_below(0.015, [0.180, 0.012])
    assert not is_far_below(0.120, [0.180])
    assert not is_far_below(0.015, [])
    assert not is_far_below(-0.2, [0.180])  # a score that can be negative: it went backward
