import numpy as np
import pytest

from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.transfer.bayes.belief import Belief
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import Hyperparameters, Observations
from vvvaltr.transfer.bayes.proposal import expected_best
from vvvaltr.transfer.bayes.scale import Scale


def believed(x: list[float], noise_variance: float) -> Belief:
    """Belief after scores of 1 and, everywhere else, 0 at places along a line that know nothing of each other."""
    y = np.where(np.arange(len(x)) == 0, 1.0, 0.0)
    observations = Observations.alike(np.array(x)[:, None], y)
    process = GaussianProcess.condition(observations, Hyperparameters(np.array([0.01]), 1.0, noise_variance))
    return Belief.of(process, Scale.linear(y), GaitSpace.over(1, 0.0, 1.0))


def test_without_noise_the_expected_best_is_the_best() -> None:
    belief = believed([0.1, 0.5, 0.9], 1e-9)
    assert expected_best(belief, np.random.default_rng(0)) == pytest.approx(1.0, abs=0.001)


def test_with_noise_the_expected_best_is_the_mean_of_the_greatest_of_independent_draws() -> None:
    belief, rng = believed([0.1, 0.5, 0.9], 1.0), np.random.default_rng(1)
    # The process knows half of each score, and leaves a variance of one half.
    truth = (np.array([0.5, 0.0, 0.0]) + np.sqrt(0.5) * rng.normal(size=(100_000, 3))).max(axis=1).mean()
    drawn = np.mean([expected_best(belief, np.random.default_rng(seed)) for seed in range(40)])
    assert drawn == pytest.approx(truth, abs=0.02)


@pytest.mark.parametrize("noise_variance", [1e-9, 1.0])
def test_the_interval_is_wider_than_the_posteriors_by_what_few_trials_leave_open_and_a_share_of_the_noise(
    noise_variance: float,
) -> None:
    belief = believed([0.1, 0.5, 0.9], noise_variance)
    _, (variance,) = belief.posterior.predict(np.array([[0.3]]))
    estimate = belief.estimates(np.array([[0.3]]))[0]
    half = 1.96 * belief.scale.unit() * np.sqrt(variance * (1.0 + 15.0 / 3) + 0.25 * noise_variance)
    assert (estimate.high - estimate.low) / 2 == pytest.approx(half, rel=0.01)
