from collections.abc import Callable

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import Hyperparameters, Observations
from vvvaltr.transfer.methods.guarded import Guarded, Mixture, list_hypotheses

SPACE = GaitSpace.over(3, -20.0, 20.0)


def bump(gait: Gait) -> float:
    """Speed in m/s, greatest at (12, -14, 9) Hz."""
    away = np.array(gait.frequency_hz) - [12.0, -14.0, 9.0]
    return float(0.05 * np.exp(-(away @ away) / 300.0))


def source(sign: float) -> Source:
    rng = np.random.default_rng(4)
    gaits = tuple(SPACE.from_unit(rng.random(3)) for _ in range(30))
    return Source("earlier", gaits, tuple(sign * bump(gait) for gait in gaits))


def trusted(sources: list[Source], trials: int) -> list[float]:
    optimizer, rng = Guarded(SPACE, 3, sources), np.random.default_rng(0)
    for _ in range(trials):
        gait = optimizer.ask().gait
        optimizer.tell(gait, bump(gait) * (1.0 + 0.2 * rng.normal()))
    learned = optimizer.ask().hyperparameters
    return [learned[f"source_{i}_trust"] for i in range(1, len(sources) + 1)]


def test_a_source_that_is_like_the_target_is_trusted_more_than_at_first() -> None:
    assert trusted([source(1.0)], 10)[0] > 0.9


def test_of_two_sources_the_one_that_is_like_the_target_is_trusted() -> None:
    rng = np.random.default_rng(9)
    like = source(1.0)
    unlike = Source("other", like.gaits, tuple(rng.random(len(like.gaits))))
    trust = trusted([unlike, like], 15)
    assert trust[1] > 0.7 > 0.5 > trust[0]


def test_every_second_trial_is_what_the_targets_own_trials_call_for() -> None:
    searches = [Guarded(SPACE, 3, [source(sign)]) for sign in (1.0, -1.0)]
    gaits, asked = source(1.0).gaits, []
    for gait in gaits[:8]:
        for search in searches:
            search.tell(gait, bump(gait))
        asked.append(searches[0].ask().gait == searches[1].ask().gait)
    assert asked[2::2] == [True] * 3
    assert not all(asked[3::2])


def drive(gait: Gait) -> float:
    """Speed in m/s of a robot that moves the faster, the harder it is shaken, whatever the senses of rotation."""
    return float(0.002 * np.maximum(np.abs(gait.frequency_hz) - 6.0, 0.0).sum())


def ruled(gait: Gait) -> float:
    """The same where two motors must turn against each other."""
    return drive(gait) * (1.0 - 0.8 * float(np.tanh(0.2 * gait.frequency_hz[0]) * np.tanh(0.2 * gait.frequency_hz[1])))


@pytest.mark.parametrize(("says", "low", "high"), [(drive, 0.0, 0.9), (ruled, 0.98, 1.0)])
def test_a_source_that_only_says_that_strong_gaits_are_fast_gains_little_trust(
    says: Callable[[Gait], float], low: float, high: float
) -> None:
    gaits = source(1.0).gaits
    optimizer, rng = Guarded(SPACE, 3, [Source("earlier", gaits, tuple(map(says, gaits)))]), np.random.default_rng(0)
    for place in np.random.default_rng(6).random((20, 3)):
        gait = SPACE.from_unit(place)
        optimizer.tell(gait, ruled(gait) * (1.0 + 0.1 * rng.normal()))
    assert low <= optimizer.ask().hyperparameters["source_1_trust"] <= high


@pytest.mark.parametrize("sources", [1, 2, 3])
def test_hypotheses_are_distinct_and_their_probabilities_sum_to_one(sources: int) -> None:
    correlations, probable = list_hypotheses(sources)
    assert correlations.shape == (len(probable), sources)
    assert probable.sum() == pytest.approx(1.0)
    assert len(np.unique(correlations, axis=0)) == len(correlations)
    assert not correlations[0].any()


def test_a_mixture_has_mean_and_variance_of_its_draws_and_the_gradients_of_both() -> None:
    rng = np.random.default_rng(1)
    parameters = Hyperparameters(np.array([0.3, 0.5]), 1.0, 0.1)
    parts = [
        GaussianProcess.condition(Observations.alike(rng.random((6, 2)), rng.normal(size=6)), parameters)
        for _ in range(3)
    ]
    mixture, x = Mixture(parts, np.array([0.5, 0.3, 0.2])), rng.random((4, 2))
    mean, variance, mean_slope, variance_slope = mixture.predict_with_gradient(x)
    assert (mean, variance) == (pytest.approx(mixture.predict(x)[0]), pytest.approx(mixture.predict(x)[1]))
    which = rng.choice(3, p=mixture.weights, size=100_000)
    means, variances = map(np.array, zip(*(part.predict(x[:1]) for part in parts), strict=True))
    draws = rng.normal(means[which, 0], np.sqrt(variances[which, 0]))
    assert (draws.mean(), draws.var()) == (pytest.approx(mean[0], abs=0.02), pytest.approx(variance[0], rel=0.02))
    step = 1e-6 * np.array([1.0, 0.0])
    (mean_up, variance_up), (mean_down, variance_down) = mixture.predict(x + step), mixture.predict(x - step)
    assert mean_slope[:, 0] == pytest.approx((mean_up - mean_down) / 2e-6, abs=1e-5)
    assert variance_slope[:, 0] == pytest.approx((variance_up - variance_down) / 2e-6, abs=1e-5)
