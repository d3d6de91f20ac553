"""Gaits whose motors turn nearly alike: which they are, and how they are told from their neighbours."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.controller.core.gaits import Gait, GaitSpace, Quantity
from vvvaltr.transfer.bayes.drive import Drive
from vvvaltr.transfer.bayes.driven import Driven, observe_drive
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.kernel import Hyperparameters
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.causes.beating import beat, move_apart

SIGNED = GaitSpace.over(3, -16.0, 16.0)
speeds = st.lists(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), min_size=1, max_size=5).map(np.array)


@pytest.mark.parametrize(
    ("speeds_of_motors", "expected"),
    [
        ((1.0, 1.0, 0.4), True),
        ((0.7, -0.72, 0.1), True),
        ((1.0, 0.95, -0.9), False),
        ((0.2, 0.2, 1.0), False),
        ((0.0, 0.0, 0.0), False),
    ],
)
def test_motors_beat_that_turn_nearly_alike_in_either_sense_and_fast_enough(
    speeds_of_motors: tuple[float, ...], expected: bool
) -> None:
    assert beat(np.array([speeds_of_motors]))[0] == expected


@given(speeds)
def test_motors_are_moved_apart_by_slowing_some_down(u: np.ndarray) -> None:
    apart = move_apart(u, np.random.default_rng(0))
    assert not beat(apart).any()
    assert (np.abs(apart) <= np.abs(u)).all() and (np.signbit(apart) == np.signbit(u)).all()
    assert np.array_equal(np.abs(apart).max(axis=1), np.abs(u).max(axis=1))


def test_where_phases_are_searched_nothing_is_left_to_chance() -> None:
    phased = GaitSpace.over(2, -16.0, 16.0, (Quantity.FREQUENCY, Quantity.PHASE))
    assert not Drive.of(phased).can_beat
    assert not Drive.of(phased).beats(np.ones((1, 4))).any()
    assert not Drive.of(GaitSpace.over(1, -16.0, 16.0)).can_beat


def test_places_to_scan_have_motors_apart_and_motors_alike_at_full_speed() -> None:
    drive = Drive.of(SIGNED)
    x = drive.draw(500, 3, np.random.default_rng(1))
    fast = x[np.abs(2.0 * x - 1.0).min(axis=1) > 0.85]
    assert 0.2 < drive.beats(fast).mean() < 0.8


def test_a_trial_of_a_gait_that_beats_says_less_of_gaits_that_do_not() -> None:
    drive, scale = Drive.of(SIGNED), Scale.of(np.array([1.0, 2.0]))
    alike, apart, between = SIGNED.to_units([Gait((16.0, hz, 0.0)) for hz in (16.0, 14.6, 15.25)])
    assert drive.beats(np.array([alike, apart, between])).tolist() == [True, False, False]
    variances = []
    for place in (alike, apart):
        observed = observe_drive(drive, Trials(place[None, :], np.ones(1)), scale, 0.0)
        process = GaussianProcess.condition(observed, Hyperparameters(np.full(3, 0.3), 1.0, 0.1))
        variances.append(Driven.of(drive, np.ones(1), [0.0], [process]).predict(between[None, :])[1][0])
    assert variances[0] > 2.0 * variances[1]
