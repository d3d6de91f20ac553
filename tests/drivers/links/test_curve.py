from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.drivers.links.curve import Curve

CURVE = Curve(((14.0, 2.0), (40.0, 6.0), (127.0, 16.0)))


def test_points_are_met_and_between_them_the_curve_is_straight() -> None:
    assert [CURVE.command(hz) for hz in (2.0, 6.0, 11.0, 16.0)] == pytest.approx([14.0, 40.0, 83.5, 127.0])


def test_a_frequency_in_the_dead_band_is_off() -> None:
    assert CURVE.command(1.9) == 0.0
    assert CURVE.frequency_hz(13.0) == 0.0


def test_a_frequency_beyond_the_last_point_is_refused_in_both_senses() -> None:
    for frequency_hz in (16.1, -16.1):
        with pytest.raises(ValueError, match=r"beyond the calibrated 16 Hz"):
            CURVE.command(frequency_hz)


@given(st.floats(2.0, 16.0), st.sampled_from([-1.0, 1.0]))
def test_frequencies_go_to_commands_and_back(frequency_hz: float, sign: float) -> None:
    assert CURVE.frequency_hz(CURVE.command(sign * frequency_hz)) == pytest.approx(sign * frequency_hz, rel=1e-6)


@pytest.mark.parametrize(
    "points",
    [
        ((14.0, 2.0),),
        ((14.0, 2.0), (14.0, 3.0)),
        ((14.0, 2.0), (20.0, 1.0)),
        ((0.0, 2.0), (20.0, 3.0)),
        ((14.0, 2.0), (20.0, float("nan"))),
    ],
)
def test_points_that_make_no_curve_are_refused(points: tuple[tuple[float, float], ...]) -> None:
    with pytest.raises(ValueError, match="points"):
        Curve(points)
