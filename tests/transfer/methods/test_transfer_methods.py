import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import Hyperparameters, Observations
from vvvaltr.transfer.methods.registry import METHODS, make_optimizer
from vvvaltr.transfer.methods.rgpe import ensemble_weights

SPACE = GaitSpace.over(3, -20.0, 20.0)
LEARNERS = [name for name, method in METHODS.items() if method.uses_sources]


def bump(gait: Gait) -> float:
    """Speed in m/s, greatest at (12, -14, 9) Hz."""
    away = np.array(gait.frequency_hz) - [12.0, -14.0, 9.0]
    return float(0.05 * np.exp(-(away @ away) / 300.0))


def source(score: Callable[[Gait], float], name: str = "earlier", trials: int = 30) -> Source:
    rng = np.random.default_rng(4)
    gaits = [SPACE.from_unit(rng.random(3)) for _ in range(trials)]
    return Source(name, tuple(gaits), tuple(map(score, gaits)))


LIKE = source(bump)
INVERTED = source(lambda gait: -bump(gait))


def made(method: str, sources: Sequence[Source] = (LIKE,), seed: int = 3) -> Optimizer:
    return make_optimizer(method, SPACE, seed, sources if METHODS[method].uses_sources else ())


def run(optimizer: Optimizer, trials: int, score: Callable[[Gait], float] = bump) -> list[tuple[Gait, float]]:
    log = []
    for _ in range(trials):
        gait = optimizer.ask().gait
        log.append((gait, score(gait)))
        optimizer.tell(*log[-1])
    return log


@pytest.mark.parametrize("method", METHODS)
def test_a_search_told_a_log_goes_on_like_the_one_that_asked(method: str) -> None:
    asked = made(method)
    log = run(asked, 9)
    told = made(method)
    for gait, score in log:
        told.tell(gait, score)
    assert told.ask() == asked.ask()
    assert told.recommend() == asked.recommend()
    assert told.improvement() == asked.improvement()


@pytest.mark.parametrize("method", METHODS)
def test_the_unit_of_the_score_changes_nothing(method: str) -> None:
    metres = run(made(method), 9)
    millimetres = source(lambda gait: 1024.0 * bump(gait))
    for (gait, _), (same, _) in zip(
        metres, run(made(method, [millimetres]), 9, lambda gait: 1024.0 * bump(gait)), strict=True
    ):
        assert same.frequency_hz == pytest.approx(gait.frequency_hz, abs=1e-3)


@pytest.mark.parametrize("method", LEARNERS)
def test_a_source_that_is_like_the_target_gives_a_good_gait_within_five_trials(method: str) -> None:
    optimizer = made(method)
    run(optimizer, 5)
    assert bump(optimizer.recommend().gait) > 0.8 * 0.05


@pytest.mark.parametrize("method", [name for name in LEARNERS if name != "efficient"])
def test_an_inverted_source_is_overcome(method: str) -> None:
    optimizer = made(method, [INVERTED])
    run(optimizer, 30)
    assert bump(optimizer.recommend().gait) > 0.7 * 0.05


@pytest.mark.parametrize("method", [name for name in LEARNERS if name != "efficient"])
def test_a_source_in_another_unit_helps_as_much(method: str) -> None:
    optimizer = made(method, [source(lambda gait: 1024.0 * bump(gait))])
    for (gait, _), (same, _) in zip(run(made(method), 6), run(optimizer, 6), strict=True):
        assert same.frequency_hz == pytest.approx(gait.frequency_hz, abs=1e-3)


@pytest.mark.parametrize("method", LEARNERS)
def test_several_sources_of_other_ranges_are_learned_from(method: str) -> None:
    wide = GaitSpace.over(3, -40.0, 40.0)
    rng = np.random.default_rng(5)
    gaits = tuple(wide.from_unit(rng.random(3)) for _ in range(20))
    optimizer = made(method, [Source("wide", gaits, tuple(map(bump, gaits))), LIKE])
    for gait, _ in run(optimizer, 6):
        assert all(-20.0 <= frequency <= 20.0 for frequency in gait.frequency_hz)
    assert optimizer.recommend().estimate.low <= optimizer.recommend().estimate.mean


@pytest.mark.parametrize("method", LEARNERS)
def test_a_source_without_spread_does_no_harm(method: str) -> None:
    optimizer = made(method, [Source("still", LIKE.gaits[:2], (0.0, 0.0))])
    run(optimizer, 4)
    assert math.isfinite(optimizer.recommend().estimate.mean)


@pytest.mark.parametrize("method", METHODS)
def test_promising_gaits_lead_with_the_recommended_one_and_are_distinct(method: str) -> None:
    optimizer = made(method)
    run(optimizer, 10)
    first, *others = optimizer.promising(3)
    assert first == optimizer.recommend().gait
    assert len(others) == 2
    for gait in others:
        assert np.linalg.norm(SPACE.to_unit(gait) - SPACE.to_unit(first)) > 0.17


def test_less_improvement_is_expected_once_the_best_gait_is_known() -> None:
    optimizer = made("plain")
    assert optimizer.improvement() == math.inf
    run(optimizer, 8)
    early = optimizer.improvement()
    run(optimizer, 22)
    assert 0.0 < optimizer.improvement() < early < 0.05


def test_optimism_reaches_for_the_unknown_but_is_kept_out_of_what_is_recommended() -> None:
    optimizer = made("optimistic")
    log = run(optimizer, 6)
    gaits = np.array([SPACE.to_unit(gait) for gait, _ in log])
    assert np.linalg.norm(gaits[:, None] - gaits, axis=2)[~np.eye(6, dtype=bool)].min() > 0.4
    assert optimizer.recommend().estimate.mean < 0.1


def test_icm_learns_that_a_source_is_inverted() -> None:
    optimizer = made("icm", [LIKE, INVERTED])
    run(optimizer, 12)
    learned = optimizer.ask().hyperparameters
    assert learned["source_1_correlation"] > 0.3 > -0.3 > learned["source_2_correlation"]


def test_rgpe_gives_a_tie_between_sources_to_the_first() -> None:
    process = GaussianProcess.condition(
        Observations.alike(np.array([[0.1], [0.5], [0.9]]), np.array([-1.0, 0.0, 1.0])),
        Hyperparameters(np.array([0.5]), 1.0, 1e-6),
    )
    first, second, _ = ensemble_weights([process, process], process, np.random.default_rng(0))
    assert first > second == 0.0


def test_rgpe_gives_no_weight_to_a_source_that_is_clearly_worse_than_the_target() -> None:
    def process(y: list[float], noise_variance: float) -> GaussianProcess:
        x = np.linspace(0.0, 1.0, len(y))[:, None]
        parameters = Hyperparameters(np.array([0.5]), 1.0, noise_variance)
        return GaussianProcess.condition(Observations.alike(x, np.array(y)), parameters)

    rising = np.linspace(-1.5, 1.5, 9).tolist()
    # Its draws are wide: now and then one ranks the trials as well as the target's do.
    vague = GaussianProcess.condition(
        Observations.alike(np.array([[0.5]]), np.array([0.0])), Hyperparameters(np.array([0.2]), 1.0, 1.0)
    )
    weights = ensemble_weights([vague], process(rising, 0.01), np.random.default_rng(0))
    assert weights.tolist() == [0.0, 1.0]


def test_first_trials_of_several_sources_are_well_apart() -> None:
    optimizer = made("warm", [LIKE, source(bump, "again")])
    places = np.array([SPACE.to_unit(gait) for gait, _ in run(optimizer, 3)])
    assert np.linalg.norm(places[:, None] - places, axis=2)[~np.eye(3, dtype=bool)].min() >= 0.1 * 3**0.5


def test_rgpe_leaves_out_a_source_that_ranks_the_trials_wrongly() -> None:
    for sources, low, high in (([LIKE], 0.3, 1.0), ([INVERTED], 0.0, 0.1)):
        optimizer = made("rgpe", sources)
        run(optimizer, 8)
        assert low <= optimizer.ask().hyperparameters["source_1_weight"] <= high
