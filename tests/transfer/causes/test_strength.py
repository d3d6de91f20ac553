import numpy as np
import pytest

from vvvaltr.transfer.causes import strength
from vvvaltr.transfer.causes.strength import StrengthLearner, find_loss


def repeats(random, before, after, factor, noise=0.1):
    trials = before + after
    speeds = 0.1 * np.exp(random.normal(0.0, noise, trials)) * np.where(np.arange(trials) < before, 1.0, factor)
    return np.zeros((trials, 3)), speeds.tolist()


def test_a_halving_is_told_within_a_few_repeats_with_its_trial_and_its_factor():
    random = np.random.default_rng(0)
    for _ in range(20):
        loss = find_loss(*repeats(random, 12, 4, 0.5))

        assert loss is not None and loss.is_told
        assert loss.since == 12
        assert loss.factor == pytest.approx(0.5, rel=0.25)


def test_what_only_scatters_or_grows_is_not_told():
    random = np.random.default_rng(1)

    assert not any(find_loss(*repeats(random, 10, 10, 1.0)).is_told for _ in range(40))
    assert not any(find_loss(*repeats(random, 10, 10, 2.0)).is_told for _ in range(40))


def test_a_single_trial_that_stood_still_is_no_loss():
    random = np.random.default_rng(2)
    for _ in range(20):
        places, speeds = repeats(random, 12, 4, 1.0)
        speeds[13] *= 0.05

        assert not find_loss(places, speeds).is_told


def test_a_loss_is_seen_through_different_gaits():
    random = np.random.default_rng(3)
    gaits = random.random((5, 3))
    order = random.integers(5, size=40)
    speeds = 0.1 * np.exp(gaits[order, 0] + random.normal(0.0, 0.1, 40)) * np.where(np.arange(40) < 25, 1.0, 0.5)

    loss = find_loss(gaits[order], speeds.tolist())

    assert loss is not None and loss.is_told and abs(loss.since - 25) <= 1


def test_few_trials_say_nothing():
    assert find_loss(np.zeros((3, 3)), [1.0, 1.0, 0.5]) is None
    assert find_loss(np.zeros((5, 3)), [0.0] * 5) is None


def test_what_is_left_of_trials_that_nearly_all_stood_still_says_nothing():
    random = np.random.default_rng(0)
    for count in range(4, 12):
        for _ in range(40):
            speeds = np.exp(random.normal(0.0, 4.0, count))  # so far apart that hardly two agree
            loss = find_loss(random.random((count, 3)), speeds.tolist())
            assert loss is None or 0.0 <= loss.probability <= 1.0


def test_the_strength_of_each_trial_follows_a_loss_in_a_long_run_with_the_same_bits_however_it_was_told(monkeypatch):
    monkeypatch.setattr(strength, "STRETCH", 12)
    random = np.random.default_rng(5)
    gaits = random.random((4, 3))
    order = random.integers(4, size=60)
    lost = np.where(np.arange(60) < 20, 1.0, 0.5)
    speeds = 0.1 * np.exp(gaits[order, 0] + random.normal(0.0, 0.08, 60)) * lost
    learner = StrengthLearner()
    for told in range(4, 61):
        logs = learner.follow(gaits[order[:told]], speeds[:told])

    anew = StrengthLearner().follow(gaits[order], speeds)

    assert logs.tolist() == anew.tolist()
    assert np.exp(anew[-1] - anew[0]) == pytest.approx(0.5, rel=0.25)
    assert np.exp(anew[19] - anew[0]) == pytest.approx(1.0, rel=0.15)


def test_the_luck_of_gaits_that_beat_is_no_loss():
    random = np.random.default_rng(6)
    others = random.uniform([0.8, 0.5, 0.1], [1.0, 0.7, 0.3], (20, 3))
    beating = np.repeat([[1.0, 1.0, 0.2]], 10, axis=0)
    speeds = [*(0.02 * np.exp(random.normal(0.0, 0.05, 20))), *[0.06] * 5, *[0.025] * 5]

    loss = find_loss(np.concatenate([others, beating]), speeds)

    assert loss is not None and not loss.is_told
    alone = find_loss(beating, speeds[20:])
    assert alone is not None and alone.is_told  # where nothing else was driven, these trials are all there is
