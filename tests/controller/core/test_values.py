import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.controller.core.gaits import Gait, GaitSpace, Parameter, Quantity, make_lively_gait
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Outcome, Source, Suggestion, Trial

BOTH = GaitSpace.over(3, 4.0, 16.7, (Quantity.FREQUENCY, Quantity.PHASE))


def test_a_gait_writes_out_its_defaults() -> None:
    gait = Gait((12, -14, 0))

    assert gait.phase_rad == (0.0, 0.0, 0.0)
    assert gait.amplitude == (1.0, 1.0, 1.0)
    assert gait == Gait((12.0, -14.0, 0.0), (0.0,) * 3, (1.0,) * 3)


@pytest.mark.parametrize(
    ("frequency_hz", "phase_rad", "amplitude", "complaint"),
    [
        ((math.nan, 1, 1), (), (), "frequency_hz"),
        ((1, math.inf, 1), (), (), "frequency_hz"),
        ((1, 1, 1), (0, 0), (), "phase_rad"),
        ((1, 1, 1), (), (1, 1, 1.5), "amplitude"),
        ((1, 1, 1), (), (1, 1, -0.1), "amplitude"),
    ],
)
def test_an_impossible_gait_is_refused_by_name(
    frequency_hz: tuple[float, ...], phase_rad: tuple[float, ...], amplitude: tuple[float, ...], complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        Gait(frequency_hz, phase_rad, amplitude)


def test_a_scaled_gait_keeps_phase_and_amplitude() -> None:
    gait = Gait((12, -14, 9), (0.1, 0.2, 0.3), (0.5, 0.6, 0.7))

    assert gait.scaled(0.5) == Gait((6, -7, 4.5), (0.1, 0.2, 0.3), (0.5, 0.6, 0.7))


@given(st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_the_unit_cube_and_the_gaits_map_onto_each_other(place: list[float]) -> None:
    unit = np.array(place)

    gait = BOTH.from_unit(unit)

    assert np.allclose(BOTH.to_unit(gait), unit, atol=1e-12)
    assert all(4.0 <= frequency <= 16.7 for frequency in gait.frequency_hz)
    assert all(-math.pi <= phase <= math.pi for phase in gait.phase_rad)


@pytest.mark.parametrize("place", [[0.5] * 5, [0.5] * 5 + [1.1], [0.5] * 5 + [math.nan]])
def test_a_place_outside_the_cube_is_refused(place: list[float]) -> None:
    with pytest.raises(ValueError, match="unit cube of 6 parameters"):
        BOTH.from_unit(np.array(place))


def test_what_is_not_searched_stays_at_rest() -> None:
    space = GaitSpace(Gait((0, 11, 0)), (Parameter(Quantity.FREQUENCY, 2, 4.0, 16.0),))

    assert space.from_unit(np.array([0.5])) == Gait((0, 11, 10))


def test_parameters_are_named_with_their_unit_and_motors_counted_from_one() -> None:
    space = GaitSpace.over(2, 4, 16, tuple(Quantity))

    assert [parameter.name for parameter in space.parameters] == [
        "frequency_1_hz",
        "frequency_2_hz",
        "phase_1_rad",
        "phase_2_rad",
        "amplitude_1",
        "amplitude_2",
    ]


def test_an_empty_range_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="frequency_1_hz: the range 9 to 9 is empty"):
        GaitSpace.over(3, 9, 9)


def test_a_source_without_trials_is_refused() -> None:
    with pytest.raises(ValueError, match="no valid trial"):
        Source("runs/flat", (), ())


@pytest.mark.parametrize("score", [math.nan, math.inf, -math.inf])
def test_a_source_has_no_score_that_is_no_number(score: float) -> None:
    with pytest.raises(ValueError, match="flat, trial 2: the score is"):
        Source("flat", (Gait((1.0,)), Gait((2.0,))), (0.1, score))


@pytest.mark.parametrize("score_m_s", [math.nan, math.inf, -math.inf, 66.0, 8.7])
def test_no_trial_has_a_score_that_is_no_speed_of_a_robot(score_m_s: float) -> None:
    trial = Trial(7, Gait((1.0,)), Outcome.COMPLETED, "", 0.0, 1.0)
    with pytest.raises(ValueError, match=r"trial 7: a speed of .* is not plausible"):
        LoggedTrial(Suggestion(Gait((1.0,)), "model"), trial, score_m_s, None)


@pytest.mark.parametrize("motors", [1, 3, 11, 60])
def test_a_lively_gait_drives_every_motor_of_any_robot_and_no_two_alike(motors: int) -> None:
    hz = make_lively_gait([40.0] * motors).frequency_hz

    assert len(set(hz)) == motors
    assert min(hz) >= 0.5 * max(hz) == 20.0
