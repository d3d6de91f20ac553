import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vvvaltr.controller.core.values import Structure
from vvvaltr.controller.runs.log import RunLog, read_run
from vvvaltr.twin.world import Flat, Hills, Slope, World, parse_world, sample_terrain

LINE = np.linspace(-2.0, 2.0, 4001)


def test_a_world_is_read_as_the_command_line_writes_it():
    assert parse_world("flat") == World(9.81, 0.5, Flat())
    assert parse_world("hills", friction=0.75) == World(friction=0.75, ground=Hills())
    assert parse_world("hills:height_m=0.004,wavelength_m=0.2,seed=3").ground == Hills(0.004, 0.2, 3)
    assert parse_world("slope:angle_rad=0.1", gravity_m_s2=1.96) == World(1.96, 0.5, Slope(0.1))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("moon", "unknown world 'moon'; choose one of flat, hills, slope"),
        ("flat:x=1", "world 'flat:x=1': flat has no settings"),
        ("hills:tall=1", "unknown setting of hills 'tall'; choose one of height_m, wavelength_m, seed"),
        ("hills:seed=a", "seed is 'a', which is not a whole number"),
        ("hills:height_m=a", "height_m is 'a', which is not a number"),
        ("hills:height_m=9", "height_m is 9; allowed: 0 to 0.1"),
        ("slope:angle_rad=nan", "angle_rad is nan; allowed: -0.5 to 0.5"),
        ("slope:angle_rad", "angle_rad is '', which is not a number"),
    ],
)
def test_a_bad_world_is_refused_with_what_is_wrong_and_what_is_allowed(text, complaint):
    with pytest.raises(ValueError) as refusal:
        parse_world(text)

    assert str(refusal.value).endswith(complaint)
    assert repr(text) in str(refusal.value)


@given(st.text(max_size=30))
def test_any_text_is_a_world_or_is_refused_in_one_line(text):
    try:
        parse_world(text)
    except ValueError as refusal:
        assert len(str(refusal).splitlines()) == 1


def test_gravity_and_friction_must_be_possible():
    with pytest.raises(ValueError, match="friction is -1; allowed: 0 to 10"):
        parse_world("flat", friction=-1.0)
    with pytest.raises(ValueError, match="gravity_m_s2 is nan"):
        parse_world("flat", gravity_m_s2=float("nan"))


def test_heights_come_in_the_shape_of_the_points():
    for ground in (Flat(), Slope(), Hills()):
        assert World(ground=ground).height_m(LINE[:, None], LINE[None, :7]).shape == (4001, 7)


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**31), st.floats(0.001, 0.1), st.floats(0.05, 1.0))
def test_hills_are_zero_at_the_origin_and_no_higher_than_they_say(seed, height_m, wavelength_m):
    world = World(ground=Hills(height_m, wavelength_m, seed))

    assert world.height_m(np.zeros(1), np.zeros(1)) == pytest.approx(0.0)
    assert np.ptp(world.height_m(LINE[::40, None], LINE[None, ::40])) <= height_m


def test_hills_are_the_same_for_the_same_seed_and_others_for_another():
    heights = [World(ground=Hills(seed=seed)).height_m(LINE, np.zeros(1)) for seed in (1, 1, 2)]

    assert np.array_equal(heights[0], heights[1])
    assert np.abs(heights[0] - heights[2]).max() > 0.001
    assert np.ptp(heights[0]) > 0.6 * Hills().height_m


def test_a_slope_rises_towards_x():
    assert World(ground=Slope(0.1)).height_m(np.array([2.0]), np.array([5.0])) == pytest.approx(2.0 * np.tan(0.1))


def test_a_viewer_gets_the_ground_as_a_grid():
    world = World(ground=Hills(seed=4))
    grid = sample_terrain(world, 0.3)

    assert (grid.x_m[0], grid.x_m[-1]) == (-0.3, 0.3)
    assert len(grid.height_m) == len(grid.x_m)
    assert grid.height_m[7][11] == pytest.approx(float(world.height_m(np.array(grid.x_m[7]), np.array(grid.y_m[11]))))
    assert len(sample_terrain(World()).x_m) == 2


def test_the_shortest_waves_make_a_ground_that_a_log_can_be_read_with(tmp_path):
    ground = sample_terrain(parse_world("hills:wavelength_m=0.02"))
    structure = Structure(struts=((0, 1),), springs=(), motor_struts=(0,), terrain=ground)

    RunLog.create(tmp_path / "trials.mcap", structure).close()

    assert read_run(tmp_path / "trials.mcap").structure.terrain == ground
