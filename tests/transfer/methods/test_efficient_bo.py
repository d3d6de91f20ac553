from collections.abc import Callable

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.methods.efficient_bo import EfficientBO, source_variance
from vvvaltr.transfer.methods.plain_bo import PlainBO

SPACE = GaitSpace.over(3, -20.0, 20.0)
BEST = np.array([12.0, -14.0, 9.0])


def bump(gait: Gait, at: np.ndarray = BEST) -> float:
    """Speed in m/s, greatest at ``at``, in Hz."""
    away = np.array(gait.frequency_hz) - at
    return float(0.05 * np.exp(-(away @ away) / 300.0))


def near_bump(gait: Gait) -> float:
    return 0.9 * bump(gait, BEST + 1.5)


def inverted_bump(gait: Gait) -> float:
    return 0.05 - bump(gait)


def source(score: Callable[[Gait], float], trials: int = 30, space: GaitSpace = SPACE, name: str = "earlier") -> Source:
    gaits = tuple(map(space.from_unit, np.random.default_rng(0).random((trials, space.dimension))))
    return Source(name, gaits, tuple(map(score, gaits)))


def run(search: Search, trials: int) -> list[float]:
    scores = []
    for _ in range(trials):
        gait = search.ask().gait
        scores.append(bump(gait))
        search.tell(gait, scores[-1])
    return scores


def source_deviation(search: Search) -> float:
    return search.ask().hyperparameters["source_1_noise_sd"]


def test_the_variance_of_a_source_is_the_mode_of_its_inverse_gamma_distribution() -> None:
    # (beta_0 + sum of squares / 2) / (alpha_0 + p / 2 + 1)
    assert source_variance(np.empty(0)) == pytest.approx(0.001 / 1.001)
    assert source_variance(np.array([0.3])) == pytest.approx((0.001 + 0.045) / 1.501)
    assert source_variance(np.array([1.0, -2.0, 2.0])) == pytest.approx((0.001 + 4.5) / 2.501)


def test_the_differences_are_those_to_the_prediction_of_the_source_alone() -> None:
    flat = Source("flat", source(bump, 2).gaits, (0.02, 0.04))
    search = EfficientBO(SPACE, 0, [flat])
    far = Gait((-20.0, 20.0, -20.0))
    # A source of two trials says little of a gait far from both: about their mean, whatever the target did there.
    search.tell(far, 0.09)
    scores = np.array([0.02, 0.04, 0.09])
    expected = source_variance(np.array([0.09 - 0.03]) / scores.std())
    assert source_deviation(search) == pytest.approx(scores.std() * np.sqrt(expected), rel=0.25)


def test_a_like_source_makes_the_first_trials_good_ones() -> None:
    with_source = [max(run(EfficientBO(SPACE, seed, [source(near_bump)]), 4)) for seed in range(3)]
    without = [max(run(PlainBO(SPACE, seed), 4)) for seed in range(3)]
    assert min(with_source) > 0.04 > max(without)


def test_the_first_suggestion_rests_on_the_source_and_says_so() -> None:
    first = EfficientBO(SPACE, 0, [source(near_bump)]).ask()
    assert first.origin == "expected improvement"
    assert first.expected is not None and bump(first.gait) > 0.03


def test_a_source_that_agrees_stays_trusted_and_one_that_contradicts_loses_trust() -> None:
    like, unlike = (EfficientBO(SPACE, 0, [source(score)]) for score in (near_bump, inverted_bump))
    assert max(source_deviation(search) for search in (like, unlike)) < 0.001
    for gait in source(bump, 40).gaits[-8:]:
        for search in (like, unlike):
            search.tell(gait, bump(gait))
    assert source_deviation(like) < 0.005
    assert source_deviation(unlike) > 5 * source_deviation(like)
    # Where the target was not tried yet, what the source says counts less once it was caught out.
    (trusted,), (doubted,) = (search.predict([Gait((5.0, -5.0, 5.0))]) for search in (like, unlike))
    assert trusted.high - trusted.low < doubted.high - doubted.low


def test_each_of_several_sources_is_trusted_for_itself() -> None:
    search = EfficientBO(SPACE, 0, [source(inverted_bump), source(near_bump)])
    run(search, 6)
    names = search.ask().hyperparameters
    assert names["source_1_noise_sd"] > 2 * names["source_2_noise_sd"]


def test_gaits_of_the_source_outside_of_the_range_are_observations_too() -> None:
    wide = source(near_bump, 60, GaitSpace.over(3, -30.0, 30.0))
    narrow = GaitSpace.over(3, -13.0, 13.0)
    suggested = EfficientBO(narrow, 0, [wide]).ask().gait
    assert all(-13.0 <= frequency <= 13.0 for frequency in suggested.frequency_hz)
    assert bump(suggested) > 0.04


def test_an_optimizer_told_a_log_goes_on_like_the_one_that_asked() -> None:
    asked, told = (EfficientBO(SPACE, 5, [source(near_bump)]) for _ in range(2))
    log = []
    for _ in range(7):
        gait = asked.ask().gait
        log.append((gait, bump(gait)))
        asked.tell(*log[-1])
    for gait, score in log:
        told.tell(gait, score)
    assert told.ask() == asked.ask() == asked.ask()
    assert told.recommend() == asked.recommend()


def test_metres_or_millimetres_make_no_difference() -> None:
    metres, millimetres = EfficientBO(SPACE, 1, [source(bump)]), EfficientBO(SPACE, 1, [source(in_units(1024.0))])
    for _ in range(4):
        gait = metres.ask().gait
        assert millimetres.ask().gait.frequency_hz == pytest.approx(gait.frequency_hz, abs=1e-3)
        metres.tell(gait, bump(gait))
        millimetres.tell(gait, 1024.0 * bump(gait))


def in_units(factor: float) -> Callable[[Gait], float]:
    return lambda gait: factor * bump(gait)


def test_sources_are_no_trials_of_the_target() -> None:
    with pytest.raises(ValueError, match="no trial to predict from"):
        EfficientBO(SPACE, 0, [source(bump)]).recommend()


def test_no_source_and_a_source_of_another_robot_are_refused() -> None:
    with pytest.raises(ValueError, match="give it a source"):
        EfficientBO(SPACE, 0, [])
    with pytest.raises(ValueError, match="for 2 motors, the robot has 3"):
        EfficientBO(SPACE, 0, [Source("other", (Gait((1.0, 2.0)),), (0.1,))])
