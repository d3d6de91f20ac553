import math

import numpy as np
import pytest

from vvvaltr.controller.core.ask_tell import WithoutModel, complete
from vvvaltr.controller.core.errors import NothingToRecommend
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.values import Suggestion
from vvvaltr.transfer.methods.plain_bo import PlainBO

SLOW, FAST, UNTRIED = Gait((5.0,)), Gait((12.0,)), Gait((8.0,))


class Sweep:
    """Asks for ever higher frequencies and learns nothing."""

    def __init__(self) -> None:
        self.told: list[tuple[Gait, float]] = []

    def ask(self) -> Suggestion:
        return Suggestion(Gait((5.0 + len(self.told),)), "sweep")

    def tell(self, gait: Gait, score: float) -> None:
        self.told.append((gait, score))


def told(*scores: tuple[Gait, float]) -> WithoutModel:
    optimizer = WithoutModel(Sweep())
    for gait, score in scores:
        optimizer.tell(gait, score)
    return optimizer


def test_an_optimiser_with_a_model_is_left_as_it_is() -> None:
    whole = PlainBO(GaitSpace.over(3, 4.0, 16.0), 0)
    assert complete(whole) is whole


def test_ask_and_tell_reach_the_optimiser() -> None:
    sweep = Sweep()
    optimizer = complete(sweep)

    optimizer.tell(optimizer.ask().gait, 0.02)

    assert sweep.told == [(SLOW, 0.02)]
    assert optimizer.ask().gait == Gait((6.0,))


def test_nothing_is_recommended_until_a_gait_has_been_repeated() -> None:
    once = told((SLOW, 0.02), (FAST, 0.08), (UNTRIED, 0.05))

    with pytest.raises(NothingToRecommend, match="--confirm"):
        once.recommend()
    assert once.promising(2) == (FAST, UNTRIED)


def test_a_single_trial_tells_nothing_of_the_spread() -> None:
    (estimate,) = told((SLOW, 0.02)).predict([FAST])
    assert estimate.mean == pytest.approx(0.02)
    assert (estimate.low, estimate.high) == (-math.inf, math.inf)


def test_repeats_draw_a_gait_towards_the_mean_of_all_as_far_as_they_scatter() -> None:
    quiet = told((SLOW, 1.0), (SLOW, 1.2), (FAST, 9.0), (FAST, 9.2)).recommend()
    noisy = told((SLOW, 1.0), (SLOW, 7.0), (FAST, 4.0), (FAST, 10.0)).recommend()

    assert quiet.gait == noisy.gait == FAST
    assert quiet.estimate.mean == pytest.approx(9.1, abs=0.5)
    assert 5.5 < noisy.estimate.mean < 6.5
    assert noisy.estimate.low < 4.0 and noisy.estimate.high > 7.0


def test_repeats_of_one_gait_alone_give_its_mean_and_students_interval() -> None:
    (estimate,) = told((SLOW, 1.0), (SLOW, 2.0), (SLOW, 3.0)).predict([SLOW])
    assert estimate.mean == pytest.approx(2.0)
    assert estimate.high - 2.0 == pytest.approx(4.30265273 / math.sqrt(3.0))


def test_trials_without_any_scatter_are_believed() -> None:
    optimizer = told((SLOW, 1.0), (SLOW, 1.0), (FAST, 2.0), (FAST, 2.0))
    assert optimizer.recommend().estimate.mean == pytest.approx(2.0, abs=0.05)
    assert told((SLOW, 1.0), (SLOW, 1.0)).recommend().estimate.low == pytest.approx(1.0)


def test_a_lucky_trial_is_drawn_towards_the_mean_and_intervals_hold_the_truth() -> None:
    draw = np.random.default_rng(1)
    held = lucky = 0
    for _ in range(200):
        truth = draw.normal(50.0, 10.0, 12)
        scores = [(Gait((float(i),)), float(draw.normal(truth[i], 20.0))) for i in range(12) for _ in range(2)]
        optimizer = told(*scores)
        best = optimizer.recommend()
        true = truth[int(best.gait.frequency_hz[0])]
        held += best.estimate.low <= true <= best.estimate.high
        observed = np.mean([score for gait, score in scores if gait == best.gait])
        lucky += abs(best.estimate.mean - true) < abs(observed - true)
    assert held >= 184
    assert lucky >= 150


@pytest.mark.parametrize("score", [math.nan, math.inf])
def test_a_score_that_is_not_a_number_is_refused(score: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        told((SLOW, score))


def test_before_the_first_trial_there_is_nothing_to_predict_from() -> None:
    with pytest.raises(ValueError, match="nothing has been told"):
        told().predict([SLOW])
