import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.fitting import Improbability, Prior, fit
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import JITTER, Hyperparameters, Observations, covariance_of, squared_differences

PLAIN = Hyperparameters(np.array([0.4]), 1.5, 0.2)


def some_observations(seed: int = 0, places: int = 9, dimension: int = 3) -> Observations:
    rng = np.random.default_rng(seed)
    given = np.where(np.arange(places) < 4, 0.3, 0.0)
    return Observations(rng.random((places, dimension)), rng.normal(size=places), given, np.where(given > 0, 0.0, 1.0))


def improbability(observations: Observations) -> Improbability:
    x = observations.x
    squares = (x.T[:, :, None] - x.T[:, None, :]) ** 2
    return Improbability(observations, Prior.of(x.shape[1]), squares.reshape(x.shape[1], -1))


def slopes(function, place: Array, step: float = 1e-5) -> Array:  # type: ignore[no-untyped-def]
    steps = step * np.eye(len(place))
    return np.array([(function(place + s) - function(place - s)) / (2 * step) for s in steps])


def matern(distance: float, length: float) -> float:
    a = math.sqrt(5.0) * distance / length
    return (1.0 + a + a * a / 3.0) * math.exp(-a)


def test_one_observation_pulls_the_mean_towards_it_and_shrinks_the_variance() -> None:
    process = GaussianProcess.condition(Observations.alike(np.array([[0.5]]), np.array([2.0])), PLAIN)
    mean, variance = process.predict(np.array([[0.5], [0.8]]))
    for i, distance in enumerate((0.0, 0.3)):
        kernel, total = 1.5 * matern(distance, 0.4), 1.5 * (1 + JITTER) + 0.2
        assert mean[i] == pytest.approx(2.0 * kernel / total)
        assert variance[i] == pytest.approx(1.5 - kernel**2 / total)


def test_each_parameter_has_its_own_length_scale() -> None:
    process = GaussianProcess.condition(
        Observations.alike(np.zeros((1, 2)), np.ones(1)), Hyperparameters(np.array([0.2, 5.0]), 1.0, 1e-9)
    )
    mean, _ = process.predict(np.array([[0.6, 0.0], [0.0, 0.6]]))
    assert mean == pytest.approx([matern(0.6, 0.2), matern(0.6, 5.0)], abs=1e-5)


def test_repeats_of_one_place_average_their_noise() -> None:
    x, y = np.full((4, 1), 0.5), np.array([1.0, 2.0, 3.0, 4.0])
    mean, variance = GaussianProcess.condition(Observations.alike(x, y), PLAIN).predict(x[:1])
    noise = (0.2 + 1.5 * JITTER) / 4
    assert mean[0] == pytest.approx(2.5 * 1.5 / (1.5 + noise))
    assert variance[0] == pytest.approx(1.5 * noise / (1.5 + noise))


def test_an_observation_with_more_noise_counts_less() -> None:
    x, y = np.array([[0.2], [0.8]]), np.array([1.0, 1.0])
    observations = Observations(x, y, given=np.array([3.0, 0.0]), share=np.array([0.0, 1.0]))
    mean, variance = GaussianProcess.condition(observations, PLAIN).predict(x)
    covariance = 1.5 * np.array([[1.0, matern(0.6, 0.4)], [matern(0.6, 0.4), 1.0]])
    total = covariance + np.diag([3.0, 0.2])
    assert mean == pytest.approx(covariance @ np.linalg.solve(total, y), rel=1e-5)
    assert variance == pytest.approx(np.diag(covariance - covariance @ np.linalg.solve(total, covariance)), rel=1e-5)


def test_far_from_all_observations_only_the_prior_is_left() -> None:
    process = GaussianProcess.condition(Observations.alike(np.array([[0.5]]), np.array([2.0])), PLAIN)
    mean, variance = process.predict(np.array([[50.0]]))
    assert (mean[0], variance[0]) == (pytest.approx(0.0), pytest.approx(1.5))


def test_a_scan_in_blocks_equals_single_predictions() -> None:
    process = GaussianProcess.condition(some_observations(), Hyperparameters(np.full(3, 0.4), 1.5, 0.2))
    x = np.random.default_rng(1).random((300, 3))
    single = [process.predict(place[None, :]) for place in x]
    mean, variance = process.predict(x)
    assert mean == pytest.approx(np.concatenate([m for m, _ in single]))
    assert variance == pytest.approx(np.concatenate([v for _, v in single]))


def test_prediction_gradients_equal_finite_differences() -> None:
    process = GaussianProcess.condition(some_observations(), Hyperparameters(np.array([0.3, 0.5, 0.9]), 1.5, 0.2))
    x = np.random.default_rng(1).random((5, 3))
    mean, variance, mean_gradient, variance_gradient = process.predict_with_gradient(x)
    assert np.array([mean, variance]) == pytest.approx(np.array(process.predict(x)))
    for place, by_mean, by_variance in zip(x, mean_gradient, variance_gradient, strict=True):
        assert by_mean == pytest.approx(slopes(lambda p: process.predict(p[None, :])[0][0], place), abs=1e-6)
        assert by_variance == pytest.approx(slopes(lambda p: process.predict(p[None, :])[1][0], place), abs=1e-6)


def test_the_gradient_of_the_hyperparameters_equals_finite_differences() -> None:
    function, rng = improbability(some_observations()), np.random.default_rng(2)
    for place in rng.normal(size=(5, 5)):
        assert function(place)[1] == pytest.approx(slopes(lambda p: function(p)[0], place), rel=1e-5, abs=1e-6)


def test_the_information_is_the_mean_of_the_second_derivatives_over_the_data_that_the_model_expects() -> None:
    place, rng, hessians = np.array([0.2, -0.4, 0.3, 0.1, 0.5]), np.random.default_rng(3), []
    observations = some_observations(places=30)
    prior = Prior.of(3)
    hyperparameters = Hyperparameters.from_logs(prior.mean + prior.sd * place)
    process = GaussianProcess.condition(observations, hyperparameters)
    root = np.linalg.inv(process.inverse_root)
    for _ in range(300):
        drawn = Observations(observations.x, root @ rng.normal(size=30), observations.given, observations.share)
        function = improbability(drawn)
        hessians.append(slopes(lambda p, f=function: f(p)[1], place, step=1e-4))
    expected = np.mean(hessians, axis=0)
    assert improbability(observations).information(place) == pytest.approx(expected, abs=0.12 * expected.max())


def test_the_value_is_the_log_density_of_the_scores_under_the_process() -> None:
    observations = some_observations()
    prior, places = Prior.of(3), [np.zeros(5), np.array([0.5, -0.5, 0.2, 0.3, -1.0])]
    values = []
    for place in places:
        hyperparameters = Hyperparameters.from_logs(prior.mean + prior.sd * place)
        root = np.linalg.inv(GaussianProcess.condition(observations, hyperparameters).inverse_root)
        covariance = root @ root.T
        _, log_determinant = np.linalg.slogdet(covariance)
        log_density = -0.5 * (observations.y @ np.linalg.solve(covariance, observations.y) + log_determinant)
        values.append(-log_density + 0.5 * place @ place)
    assert [improbability(observations)(place)[0] for place in places] == pytest.approx(values)


def test_a_fit_finds_the_length_scales_and_the_noise_that_made_the_data() -> None:
    rng = np.random.default_rng(4)
    x = rng.random((120, 2))
    made_by = Hyperparameters(np.array([0.15, 1.0]), 1.0, 0.05)
    root = np.linalg.inv(GaussianProcess.condition(Observations.alike(x, np.zeros(120)), made_by).inverse_root)
    prior = Prior.of(2)
    found = fit(Observations.alike(x, root @ rng.normal(size=120)), prior, [prior.mean]).hyperparameters
    assert found.logs == pytest.approx(made_by.logs, abs=0.7)
    assert found.length_scale[0] < 0.5 * found.length_scale[1]


def test_of_several_starts_the_best_optimum_is_kept() -> None:
    observations, prior = some_observations(), Prior.of(3)
    starts = [prior.mean, prior.mean + 2.0 * prior.sd, prior.mean - 2.0 * prior.sd]

    def value(process: GaussianProcess) -> float:
        return improbability(observations)((process.hyperparameters.logs - prior.mean) / prior.sd)[0]

    together = value(fit(observations, prior, starts))
    assert together == pytest.approx(min(value(fit(observations, prior, [start])) for start in starts), abs=0.05)


def test_the_interval_covers_the_truth_of_functions_drawn_from_the_prior() -> None:
    rng, covered = np.random.default_rng(5), []
    prior = Prior.of(2)
    for _ in range(40):
        x = rng.random((50, 2))
        hyperparameters = Hyperparameters.from_logs(rng.normal(prior.mean, prior.sd))
        silent = Hyperparameters(hyperparameters.length_scale, hyperparameters.signal_variance, 1e-9)
        root = np.linalg.inv(GaussianProcess.condition(Observations.alike(x, np.zeros(50)), silent).inverse_root)
        true = root @ rng.normal(size=50)
        observed = true[:30] + rng.normal(0.0, math.sqrt(hyperparameters.noise_variance), 30)
        mean, variance = fit(Observations.alike(x[:30], observed), prior, [prior.mean]).predict(x[30:])
        covered.append(np.abs(mean - true[30:]) <= 1.96 * np.sqrt(variance))
    assert 0.88 <= np.mean(covered) <= 0.98


@settings(max_examples=60, deadline=None)
@given(
    x=arrays(float, (5, 2), elements=st.sampled_from([0.0, 0.5, 1.0, 1e-12, 3.0])),
    y=arrays(float, 5, elements=st.sampled_from([0.0, 1.0, -1.0, 2.0, 1e-300])),
    places=st.integers(1, 5),
)
def test_degenerate_data_give_finite_predictions(x: Array, y: Array, places: int) -> None:
    prior = Prior.of(2)
    process = fit(Observations.alike(x[:places], y[:places]), prior, [prior.mean])
    mean, variance, mean_gradient, variance_gradient = process.predict_with_gradient(np.vstack([x, np.eye(2)]))
    for numbers in (mean, variance, mean_gradient, variance_gradient):
        assert np.isfinite(numbers).all()
    assert (variance > 0.0).all()


@pytest.mark.parametrize("coupled", [False, True])
def test_a_process_that_is_extended_is_the_one_conditioned_on_all(coupled: bool) -> None:
    whole = some_observations(places=14)
    if coupled:
        loading = np.where(np.arange(14) < 5, 0.6, 1.0)
        coupling = np.where(loading[:, None] == loading, 1.0, 0.6)
        whole = replace(whole, coupling=coupling, loading=loading)
    fitted, x = Hyperparameters(np.array([0.4, 0.3, 0.6]), 1.3, 0.2), np.random.default_rng(1).random((7, 3))

    grown = GaussianProcess.condition(first(whole, 9), fitted).extend(whole)

    expected = GaussianProcess.condition(whole, fitted)
    assert grown.inverse_root == pytest.approx(expected.inverse_root, abs=1e-12)
    for ours, theirs in zip(grown.predict(x), expected.predict(x), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-12)


@given(st.integers(1, 300), st.integers(1, 30))
@settings(max_examples=25, deadline=None)
def test_rows_added_one_by_one_or_at_once_give_the_same_bits(known: int, added: int) -> None:
    whole = some_observations(places=known + added)
    fitted = Hyperparameters(np.array([0.4, 0.3, 0.6]), 1.3, 0.2)
    begun = GaussianProcess.condition(first(whole, known), fitted)

    in_steps = begun
    for count in range(known + 1, known + added + 1):
        in_steps = in_steps.extend(first(whole, count))

    assert np.array_equal(in_steps.inverse_root, begun.extend(whole).inverse_root)


def test_a_repeat_of_a_noiseless_gait_leaves_the_process_finite() -> None:
    x, fitted = np.full((4, 1), 0.5), Hyperparameters(np.array([0.4]), 1.0, 1e-12)
    begun = GaussianProcess.condition(Observations.alike(x[:1], np.ones(1)), fitted)

    grown = begun.extend(Observations.alike(x, np.ones(4)))

    assert grown.predict(x[:1])[0] == pytest.approx(1.0, abs=1e-3)


def test_observations_whose_noise_has_changed_are_conditioned_on_from_the_beginning() -> None:
    whole = some_observations(places=12)
    fitted = Hyperparameters(np.array([0.4, 0.3, 0.6]), 1.3, 0.2)
    louder = replace(whole, given=whole.given + 0.5)

    grown = GaussianProcess.condition(first(whole, 9), fitted).extend(louder)

    assert np.array_equal(grown.inverse_root, GaussianProcess.condition(louder, fitted).inverse_root)


def test_the_mean_alone_has_the_bits_of_mean_and_variance() -> None:
    observations, x = some_observations(places=250), np.random.default_rng(1).random((300, 3))
    process = GaussianProcess.condition(observations, Hyperparameters(np.array([0.4, 0.3, 0.6]), 1.3, 0.2))

    mean, _, gradient, _ = process.predict_with_gradient(x)
    alone, slope = process.predict_mean_with_gradient(x)

    assert np.array_equal(process.predict_mean(x), process.predict(x)[0])
    assert np.array_equal(alone, mean) and np.array_equal(slope, gradient)


def test_a_large_process_is_inverted_and_predicted_in_blocks_with_the_same_result() -> None:
    observations, x = some_observations(places=330), np.random.default_rng(1).random((20, 3))
    fitted = Hyperparameters(np.array([0.4, 0.3, 0.6]), 1.3, 0.2)
    process = GaussianProcess.condition(observations, fitted)
    covariance, _ = covariance_of(observations, fitted, squared_differences(observations.x))

    assert process.inverse_root @ covariance @ process.inverse_root.T == pytest.approx(np.eye(330), abs=1e-9)
    assert process.predict(x)[1] == pytest.approx(process.predict_with_gradient(x)[1], abs=1e-12)


def first(observations: Observations, count: int) -> Observations:
    coupled = isinstance(observations.coupling, np.ndarray)
    return Observations(
        observations.x[:count],
        observations.y[:count],
        observations.given[:count],
        observations.share[:count],
        observations.coupling[:count, :count] if coupled else 1.0,  # type: ignore[index]
        observations.loading[:count] if coupled else 1.0,  # type: ignore[index]
    )
