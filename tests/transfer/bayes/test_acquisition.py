import math

import numpy as np
import pytest
from scipy.stats import norm

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.acquisition import LogExpectedImprovement, PosteriorMean, log_h, maximise
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import Hyperparameters, Observations


def process() -> GaussianProcess:
    rng = np.random.default_rng(0)
    observations = Observations.alike(rng.random((12, 3)), rng.normal(size=12))
    return GaussianProcess.condition(observations, Hyperparameters(np.array([0.2, 0.4, 0.6]), 1.2, 0.3))


def test_log_h_equals_the_textbook_where_that_does_not_cancel() -> None:
    z = np.linspace(-3.0, 8.0, 100)
    value, slope = log_h(z)
    h = norm.pdf(z) + z * norm.cdf(z)
    assert value == pytest.approx(np.log(h), rel=1e-11, abs=1e-13)
    assert slope == pytest.approx(norm.cdf(z) / h, rel=1e-11)


def test_log_h_follows_its_asymptote_far_in_the_tail() -> None:
    z = -np.array([30.0, 1e2, 1e3, 1e5, 1e8, 1e12])
    value, slope = log_h(z)
    series = 1.0 - 3.0 / z**2 + 15.0 / z**4 - 105.0 / z**6 + 945.0 / z**8
    assert value == pytest.approx(
        -0.5 * z**2 - 0.5 * math.log(2 * math.pi) - 2 * np.log(-z) + np.log(series), rel=1e-12
    )
    assert slope == pytest.approx(-z, rel=3e-3)


def test_log_h_has_no_step_where_its_two_forms_meet() -> None:
    value, slope = log_h(np.array([-10.0, np.nextafter(-10.0, -11.0)]))
    assert value[0] == pytest.approx(value[1], rel=1e-13)
    assert slope[0] == pytest.approx(slope[1], rel=1e-10)


def test_without_noise_it_is_the_expected_improvement() -> None:
    posterior, x = process(), np.random.default_rng(1).random((4, 3))
    mean, variance = posterior.predict(x)
    drawn = mean + np.sqrt(variance) * np.random.default_rng(2).normal(size=(200_000, 4))
    expected = np.maximum(drawn - 0.5, 0.0).mean(axis=0)
    assert np.exp(LogExpectedImprovement(posterior, 0.5, lambda _: 0.0).value(x)) == pytest.approx(expected, rel=0.02)


def test_with_noise_it_is_the_improvement_that_a_noisy_trial_is_expected_to_show() -> None:
    posterior, x, rng = process(), np.array([[0.3, 0.6, 0.2]]), np.random.default_rng(3)
    mean, variance = posterior.predict(x)
    observed = rng.normal(mean[0], math.sqrt(variance[0] + 0.3), 2000)
    known = posterior.observations
    after = [
        GaussianProcess.condition(
            Observations.alike(np.vstack([known.x, x]), np.append(known.y, y)), posterior.hyperparameters
        ).predict(x)[0][0]
        for y in observed
    ]
    expected = np.maximum(np.array(after) - 0.2, 0.0).mean()
    assert np.exp(LogExpectedImprovement(posterior, 0.2, lambda _: 0.3).value(x))[0] == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("incumbent", [0.5, 40.0])
@pytest.mark.parametrize("noise_variance", [0.0, 0.3])
def test_the_gradient_equals_finite_differences(incumbent: float, noise_variance: float) -> None:
    acquisition = LogExpectedImprovement(process(), incumbent, lambda _: noise_variance)
    x = np.random.default_rng(4).random((6, 3))
    value, gradient = acquisition.value_and_gradient(x)
    assert value == pytest.approx(acquisition.value(x))
    for i, step in enumerate(1e-6 * np.eye(3)):
        slope = (acquisition.value(x + step) - acquisition.value(x - step)) / 2e-6
        assert gradient[:, i] == pytest.approx(slope, rel=1e-4, abs=1e-4)


class Hill:
    """A known posterior mean: its summit may lie outside of the cube."""

    def __init__(self, summit: Array) -> None:
        self.summit = summit

    def predict(self, x: Array) -> tuple[Array, Array]:
        return -((x - self.summit) ** 2).sum(axis=1), np.ones(len(x))

    def predict_with_gradient(self, x: Array) -> tuple[Array, Array, Array, Array]:
        return *self.predict(x), -2.0 * (x - self.summit), np.zeros_like(x)

    def predict_mean(self, x: Array) -> Array:
        return self.predict(x)[0]

    def predict_mean_with_gradient(self, x: Array) -> tuple[Array, Array]:
        mean, _, gradient, _ = self.predict_with_gradient(x)
        return mean, gradient


@pytest.mark.parametrize("summit", [[0.3, 0.7, 0.5], [1.4, 0.5, -0.2]])
def test_the_maximum_is_found_inside_of_the_cube_and_on_its_faces(summit: list[float]) -> None:
    hill = Hill(np.array(summit))
    found = maximise(PosteriorMean(hill), np.full((1, 3), 0.5), np.random.default_rng(0))
    assert found == pytest.approx(np.clip(summit, 0.0, 1.0), abs=0.01)


def test_a_promising_place_is_never_lost_even_from_outside_of_the_cube() -> None:
    class Needle(Hill):
        def predict(self, x: Array) -> tuple[Array, Array]:
            return np.where(np.abs(x - self.summit).max(axis=1) < 1e-9, 1.0, 0.0), np.ones(len(x))

        def predict_with_gradient(self, x: Array) -> tuple[Array, Array, Array, Array]:
            return *self.predict(x), np.zeros_like(x), np.zeros_like(x)

    around = np.array([[0.2, 0.2, 0.2], [1.5, 0.25, -3.0]])
    found = maximise(PosteriorMean(Needle(np.array([1.0, 0.25, 0.0]))), around, np.random.default_rng(0))
    assert list(found) == [1.0, 0.25, 0.0]
