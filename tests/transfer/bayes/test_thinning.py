import numpy as np
import pytest

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import Hyperparameters
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.thinning import assign, spread, thin
from vvvaltr.transfer.bayes.trials import Trials


def some_trials(count: int, noise: float = 0.3) -> Trials:
    rng = np.random.default_rng(0)
    x = rng.random((count, 3))
    return Trials(x, hill(x) + noise * rng.normal(size=count))


def hill(x: Array) -> Array:
    return np.asarray(2.0 + np.sin(4.0 * x).sum(axis=1))


def test_few_trials_stay_as_they_are() -> None:
    trials = some_trials(50)

    assert thin(trials, 50) is trials


def test_the_best_and_the_latest_trials_stay_single_and_every_trial_counts_once() -> None:
    trials = some_trials(1000)

    thinned = thin(trials, 100)

    best = np.sort(trials.scores)[-10:]
    assert len(thinned) == 100
    assert set(best) | set(trials.scores[-10:]) <= set(thinned.scores[thinned.shares == 1.0])
    assert (1.0 / thinned.shares).sum() == pytest.approx(1000)


def test_repeats_of_a_few_gaits_become_their_means_and_nothing_is_lost() -> None:
    places = np.random.default_rng(1).random((20, 3))
    which = np.random.default_rng(2).integers(20, size=400)
    trials = Trials(places[which], 2.0 + 0.1 * np.random.default_rng(3).normal(size=400))
    fitted, scale = Hyperparameters(np.full(3, 0.3), 1.0, 0.5), Scale.of(trials.scores)

    whole = GaussianProcess.condition(trials.observe(scale), fitted)
    thinned = GaussianProcess.condition(thin(trials, 100).observe(scale), fitted)

    assert len(thinned.weights) < 100
    for expected, found in zip(whole.predict(places), thinned.predict(places), strict=True):
        assert found == pytest.approx(expected, abs=2e-5)


def test_a_thinned_history_predicts_almost_as_well_as_the_whole() -> None:
    trials, x = some_trials(600), np.random.default_rng(4).random((200, 3))
    fitted, scale = Hyperparameters(np.full(3, 0.5), 1.0, 0.2), Scale.linear(trials.scores)

    errors = [
        scale.scores(GaussianProcess.condition(kept.observe(scale), fitted).predict_mean(x)) - hill(x)
        for kept in (trials, thin(trials, 150), trials.part(slice(-150, None)))
    ]

    whole, thinned, latest = (float(np.sqrt(np.mean(error**2))) for error in errors)
    assert thinned < 1.4 * whole
    assert thinned < 0.8 * latest


def test_places_are_chosen_far_from_each_other_and_the_others_join_the_nearest() -> None:
    x = np.array([[0.0], [0.1], [1.0], [0.4], [0.9]])

    chosen = spread(x, 3)

    assert list(chosen) == [0, 2, 3]
    assert list(assign(x, chosen)) == [0, 0, 1, 2, 1]


def test_no_more_places_are_chosen_than_there_are() -> None:
    assert len(spread(np.zeros((5, 2)), 3)) == 1
