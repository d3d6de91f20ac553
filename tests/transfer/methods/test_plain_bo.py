from collections.abc import Callable

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.transfer.methods.plain_bo import PlainBO
from vvvaltr.transfer.methods.registry import make_optimizer

SPACE = GaitSpace.over(3, -20.0, 20.0)


def bump(gait: Gait) -> float:
    """Speed in m/s, greatest at (12, -14, 9) Hz."""
    away = np.array(gait.frequency_hz) - [12.0, -14.0, 9.0]
    return float(0.05 * np.exp(-(away @ away) / 300.0))


def run(optimizer: Optimizer, trials: int, score: Callable[[Gait], float] = bump) -> list[tuple[Gait, float]]:
    log = []
    for _ in range(trials):
        gait = optimizer.ask().gait
        log.append((gait, score(gait)))
        optimizer.tell(*log[-1])
    return log


def test_the_same_seed_gives_the_same_trials_bit_for_bit_and_another_seed_others() -> None:
    first, second, other = (run(PlainBO(SPACE, seed), 14) for seed in (3, 3, 4))
    assert first == second
    assert first != other


def test_asking_twice_without_telling_gives_the_same_suggestion() -> None:
    optimizer = PlainBO(SPACE, 0)
    run(optimizer, 11)
    assert optimizer.ask() == optimizer.ask()


def test_an_optimizer_told_a_log_goes_on_like_the_one_that_asked() -> None:
    asked = PlainBO(SPACE, 5)
    log = run(asked, 17)
    told = PlainBO(SPACE, 5)
    for gait, score in log:
        told.tell(gait, score)
    assert told.ask() == asked.ask()
    assert told.recommend() == asked.recommend()
    assert run(told, 3) == run(asked, 3)


def test_it_finds_the_best_gait_of_a_smooth_speed() -> None:
    optimizer = PlainBO(SPACE, 1)
    run(optimizer, 25)
    recommended = optimizer.recommend()
    assert bump(recommended.gait) > 0.98 * 0.05
    assert recommended.estimate.low <= 0.05 <= recommended.estimate.high + 0.001
    assert optimizer.predict([recommended.gait])[0].mean == pytest.approx(recommended.estimate.mean)


def test_the_first_trials_are_spread_and_the_later_ones_explained() -> None:
    optimizer = PlainBO(SPACE, 2)
    first = optimizer.ask()
    assert (first.origin, first.expected, dict(first.hyperparameters)) == ("initial design", None, {})
    gaits = [gait for gait, _ in run(optimizer, 8)]
    for motor in range(3):
        slices = sorted(int((gait.frequency_hz[motor] + 20.0) / 5.0) for gait in gaits)
        assert slices == list(range(8))
    later = optimizer.ask()
    assert later.origin == "expected improvement"
    assert later.expected is not None and later.expected.low < later.expected.mean < later.expected.high
    assert set(later.hyperparameters) == {
        "length_scale_frequency_1_hz",
        "length_scale_frequency_2_hz",
        "length_scale_frequency_3_hz",
        "signal_sd",
        "noise_sd",
    }


def test_the_unit_of_the_score_changes_nothing() -> None:
    metres = run(PlainBO(SPACE, 7), 12)
    millimetres = run(PlainBO(SPACE, 7), 12, lambda gait: 1024.0 * bump(gait))
    for (gait, _), (same, _) in zip(metres, millimetres, strict=True):
        assert same.frequency_hz == pytest.approx(gait.frequency_hz, abs=1e-3)


def test_nothing_is_predicted_or_recommended_before_the_first_trial() -> None:
    optimizer = make_optimizer("plain", SPACE, 0)
    with pytest.raises(ValueError, match="no trial to predict from"):
        optimizer.recommend()
    with pytest.raises(ValueError, match="no trial to predict from"):
        optimizer.predict([Gait((1.0, 2.0, 3.0))])


@pytest.mark.parametrize("score", [float("nan"), float("inf")])
def test_a_score_that_is_no_number_is_refused(score: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        PlainBO(SPACE, 0).tell(Gait((1.0, 2.0, 3.0)), score)


def test_a_gait_of_another_robot_is_refused() -> None:
    with pytest.raises(ValueError, match="for 2 motors, the robot has 3"):
        PlainBO(SPACE, 0).tell(Gait((1.0, 2.0)), 0.1)
