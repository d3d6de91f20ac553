"""Rotations as camera systems send them, and the angles of a pose."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.drivers.trackers.attitude import (
    angles_of,
    is_rotation,
    is_unit,
    matrix_of,
    matrix_of_quaternion,
    quaternion_of,
)

turns = st.floats(-math.pi, math.pi)
angles = st.tuples(turns, st.floats(-1.5, 1.5), turns)


@given(angles)
def test_angles_survive_as_matrix_and_as_quaternion(told):
    for matrix in (matrix_of(told), matrix_of_quaternion(quaternion_of(told))):
        assert is_rotation(matrix)
        again = matrix_of(angles_of(matrix, told))
        assert sum(again, ()) == pytest.approx(sum(matrix, ()), abs=1e-9)
    assert is_unit(quaternion_of(told))


def test_yaw_is_the_angle_from_x_to_y():
    assert matrix_of((math.pi / 2, 0.0, 0.0))[1][0] == pytest.approx(1.0)  # the body's x axis points along y
    assert angles_of(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))) == pytest.approx((math.pi / 2, 0.0, 0.0))


@given(angles, st.tuples(*[st.floats(-0.02, 0.02)] * 3))
def test_angles_go_on_from_the_last_ones_without_a_jump(told, change):
    later = tuple(angle + step for angle, step in zip(told, change, strict=True))
    found = angles_of(matrix_of(later), told)
    assert found == pytest.approx(later, abs=1e-6)


def test_a_rolling_robot_pitches_on_past_a_quarter_turn():
    last = (0.1, 0.0, 0.0)
    for step in range(100):
        last = angles_of(matrix_of((0.1, 0.1 * step, 0.0)), last)
    assert last == pytest.approx((0.1, 9.9, 0.0))


@pytest.mark.parametrize(
    "wrong",
    [
        ((math.nan,) * 3,) * 3,
        ((0.0,) * 3,) * 3,
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),  # a mirror
        ((2.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        ((1.0, 0.1, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ],
)
def test_what_is_no_rotation_is_told(wrong):
    assert not is_rotation(wrong)
    assert not is_unit((math.nan, 0.0, 0.0, 1.0))
    assert not is_unit((0.0, 0.0, 0.0, 0.0))
