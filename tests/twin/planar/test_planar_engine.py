import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pymunk
import pytest

from vvvaltr.controller.core.errors import DeviceFault
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.twin.bodies import BODIES, icosahedron6, prism3
from vvvaltr.twin.body import apply_damage
from vvvaltr.twin.engine import Diverged, Start
from vvvaltr.twin.planar.engine import PlanarEngine
from vvvaltr.twin.planar.stepper import Stepper
from vvvaltr.twin.presets import PLANAR_DRIVES, PLANAR_PARTS
from vvvaltr.twin.world import PLAIN, Hills, Slope, World

PRISM = prism3(PLANAR_PARTS)
ICOSAHEDRON = icosahedron6(PLANAR_PARTS)
STILL = Gait((0.0, 0.0, 0.0))
LIVELY = Gait((12.0, 14.0, 16.0))
MOTION = """
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.twin.bodies import make_body
from vvvaltr.twin.planar.engine import PlanarEngine
from vvvaltr.twin.presets import PLANAR_PARTS
from vvvaltr.twin.world import Hills, World
engine = PlanarEngine(make_body({body!r}, PLANAR_PARTS), World(ground=Hills(seed=2)))
for _ in range(20):
    engine.step(Gait((12.0, -14.0, 16.0)), 0.05)
print(engine.nodes_m().tobytes().hex())
"""


def centre_m(engine):
    return engine.body.centre_m(engine.nodes_m())


def speed_m_s(engine, gait, duration_s=4.0):
    engine.reset()
    engine.step(STILL, 0.3)
    start_m = centre_m(engine)[0]
    engine.step(gait, duration_s)
    return abs(centre_m(engine)[0] - start_m) / duration_s


def driven_nodes(engine, gait=LIVELY):
    engine.reset(Start(0.003, 0.0, 0.0, 0.02))
    for _ in range(20):
        engine.step(gait, 0.05)
    return engine.nodes_m()


@pytest.mark.parametrize("body", [PRISM, ICOSAHEDRON], ids=lambda body: body.name)
def test_the_same_calls_give_the_same_motion_bit_for_bit_after_a_reset_and_on_another_engine(body):
    engine = PlanarEngine(body, PLAIN)
    first = driven_nodes(engine)

    assert np.array_equal(first, driven_nodes(engine))
    assert np.array_equal(first, driven_nodes(PlanarEngine(body, PLAIN)))


@pytest.mark.parametrize("body", BODIES)
def test_the_motion_is_the_same_bit_for_bit_in_a_fresh_process(body):
    elsewhere = subprocess.run(
        [sys.executable, "-c", MOTION.format(body=body)],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[3],
    ).stdout
    engine = PlanarEngine(BODIES[body](PLANAR_PARTS), World(ground=Hills(seed=2)))
    for _ in range(20):
        engine.step(Gait((12.0, -14.0, 16.0)), 0.05)

    assert elsewhere.strip() == engine.nodes_m().tobytes().hex()


def test_the_innermost_loop_moves_as_pymunks_own_calls_do():
    def strut():
        space = pymunk.Space()
        space.gravity = (0.0, -9.81)
        body = pymunk.Body(0.02, 1e-5)
        body.angle = 0.7
        space.add(body, pymunk.Segment(body, (-0.05, 0.0), (0.05, 0.0), 0.003))
        return space, body

    forces = np.exp(1j * np.arange(120.0)) * 0.3
    (space, body), (fast_space, fast_body) = strut(), strut()
    for force in forces:
        body.apply_force_at_local_point((force.real, force.imag))
        space.step(0.002)
    stepper = Stepper(fast_space, [fast_body], 0.002)
    for first in range(0, 120, 40):
        stepper.run(forces[first : first + 40, None])

    assert (fast_body.position, fast_body.angle) == (body.position, body.angle)


@pytest.mark.parametrize("body", [PRISM, ICOSAHEDRON], ids=lambda body: body.name)
def test_an_undriven_robot_stays_where_it_is(body):
    engine = PlanarEngine(body, PLAIN)
    before = engine.nodes_m()

    engine.step(STILL, 10.0)

    assert np.abs(engine.nodes_m() - before).max() < 1e-5
    assert engine.time_s == pytest.approx(10.0)


def test_the_prism_stands_on_a_side_of_69_mm_at_first_and_its_springs_pull_it_smaller():
    nodes = PlanarEngine(PRISM, PLAIN).nodes_m()
    feet = nodes[nodes[:, 2] < 0.005]

    assert len(feet) == 2
    assert 0.050 < np.ptp(feet[:, 0]) < 0.069
    assert np.all(nodes[:, 1] == 0.0)


def test_eccentric_motors_below_10_hz_leave_the_robot_where_it_is_and_above_14_hz_move_it():
    engine = PlanarEngine(PRISM, PLAIN)

    for dead in ((10.0, 9.0, 8.0), (9.5, 4.0, 10.0), (6.0, 10.0, -7.0)):
        assert speed_m_s(engine, Gait(dead)) < 0.0005
    for live in ((16.0, 12.0, 10.0), (14.5, 16.0, 8.0), (15.0, 4.0, 13.0)):
        assert speed_m_s(engine, Gait(live)) > 0.002


def test_the_constant_force_of_the_thesis_moves_the_robot_at_frequencies_above_the_motors_of_today():
    drive = PLANAR_DRIVES["constant"]
    engine = PlanarEngine(prism3(replace(PLANAR_PARTS, law=drive.law, max_hz=drive.range_hz[1])), PLAIN)

    assert speed_m_s(engine, Gait((30.0, 20.0, 25.0))) > 0.002
    assert engine.applied_hz() == pytest.approx((30.0, 20.0, 25.0))


def test_no_motor_turns_faster_than_it_can_and_a_disabled_one_not_at_all():
    engine = PlanarEngine(apply_damage(PRISM, ["disable:2"]), PLAIN)
    engine.step(Gait((40.0, 12.0, -40.0)), 2.0)

    assert engine.applied_hz() == (16.7, 0.0, -16.7)


def test_motors_take_their_time_to_follow():
    engine = PlanarEngine(PRISM, PLAIN)
    engine.step(LIVELY, 0.05)

    assert engine.applied_hz() == pytest.approx(np.array(LIVELY.frequency_hz) * (1.0 - np.exp(-1.0)))


def test_amplitude_scales_the_force_and_phases_change_the_motion():
    engine = PlanarEngine(PRISM, PLAIN)
    full = driven_nodes(engine)

    still = driven_nodes(engine, STILL)
    off = driven_nodes(engine, replace(LIVELY, amplitude=(0.0, 0.0, 0.0)))
    turned = driven_nodes(engine, replace(LIVELY, phase_rad=(0.0, 2.0, 0.0)))
    half = speed_m_s(engine, replace(LIVELY, amplitude=(0.5, 0.5, 0.5)))

    assert np.array_equal(off, still)
    assert np.abs(turned - full).max() > 1e-4
    assert half < 0.5 * speed_m_s(engine, LIVELY)


def test_time_that_does_not_fill_a_step_is_made_up_for():
    engine = PlanarEngine(PRISM, PLAIN)
    for _ in range(100):
        engine.step(LIVELY, 0.0013)

    assert engine.time_s == pytest.approx(0.13, abs=0.001)


def test_springs_that_only_pull_make_no_difference_while_none_is_slack():
    pulling = PlanarEngine(prism3(replace(PLANAR_PARTS, tension_only=True)), PLAIN)

    assert driven_nodes(pulling) == pytest.approx(driven_nodes(PlanarEngine(PRISM, PLAIN)), abs=1e-9)


def test_a_box_shaped_strut_moves_too():
    engine = PlanarEngine(prism3(replace(PLANAR_PARTS, shape="box")), PLAIN)

    assert speed_m_s(engine, LIVELY, 2.0) > 0.001


def test_the_robot_is_put_down_where_it_is_told_to_be():
    engine = PlanarEngine(PRISM, PLAIN)
    upright = engine.nodes_m()
    engine.reset(Start(x_m=0.25, pitch_rad=0.1))
    tilted = engine.nodes_m()

    assert tilted[:, 0].mean() == pytest.approx(0.25)
    assert tilted[:, 2].min() == pytest.approx(upright[:, 2].min())
    assert engine.angles_rad() == pytest.approx((0.0, 0.1, 0.0))
    # A positive pitch takes z towards x: the top moves forwards.
    assert tilted[upright[:, 2].argmax(), 0] - 0.25 > upright[upright[:, 2].argmax(), 0]


@pytest.mark.parametrize("ground", [Hills(seed=5), Hills(0.02, 0.1, 1), Slope(0.2)], ids=str)
def test_the_robot_stands_on_hills_and_slopes_and_stays(ground):
    engine = PlanarEngine(PRISM, World(ground=ground))
    engine.step(STILL, 1.0)
    before = engine.nodes_m()
    engine.step(STILL, 2.0)
    nodes = engine.nodes_m()
    gaps = nodes[:, 2] - engine.world.height_m(nodes[:, 0], np.zeros(1))

    assert np.abs(nodes - before).max() < 1e-4
    assert gaps.min() == pytest.approx(0.003, abs=0.0005)


def test_the_ground_goes_on_wherever_the_robot_wanders():
    engine = PlanarEngine(PRISM, World(ground=Slope(-0.4)))
    slippery = PlanarEngine(PRISM, World(friction=0.05, ground=Slope(-0.4)))

    engine.step(LIVELY, 2.0)
    slippery.step(STILL, 2.0)

    for wanderer in (engine, slippery):
        nodes = wanderer.nodes_m()
        gaps = nodes[:, 2] - wanderer.world.height_m(nodes[:, 0], np.zeros(1))
        assert 0.002 < gaps.min() < 0.01
    assert centre_m(slippery)[0] > 3.0


def test_the_seed_of_the_hills_changes_the_motion():
    first, second = (PlanarEngine(PRISM, World(ground=Hills(seed=seed))) for seed in (1, 2))

    assert np.abs(driven_nodes(first) - driven_nodes(second)).max() > 1e-4


@pytest.mark.parametrize("damage", [["snap:4,8"], ["lighten:2:0.5"], ["disable:1"]], ids=str)
def test_damage_changes_the_speed(damage):
    intact, hurt = PlanarEngine(PRISM, PLAIN), PlanarEngine(apply_damage(PRISM, damage), PLAIN)

    assert abs(speed_m_s(hurt, LIVELY) - speed_m_s(intact, LIVELY)) > 0.0005


def test_a_motion_that_breaks_down_is_a_fault_and_stays_one_until_the_reset():
    engine = PlanarEngine(PRISM, PLAIN)
    engine._plane.struts[0].velocity = (float("nan"), 0.0)

    for _ in range(2):
        with pytest.raises(Diverged, match="the planar twin broke down") as fault:
            engine.step(LIVELY, 0.05)
    assert isinstance(fault.value, DeviceFault)
    assert fault.value.code == "diverged"

    engine.reset()
    engine.step(LIVELY, 0.05)
    assert np.all(np.isfinite(engine.nodes_m()))


def test_springs_too_stiff_for_the_time_step_are_a_fault_at_once():
    with pytest.raises(Diverged):
        PlanarEngine(prism3(replace(PLANAR_PARTS, stiffness_n_m=2e4)), PLAIN)


def test_a_gait_for_another_number_of_motors_is_refused():
    with pytest.raises(ValueError, match="a gait for 2 motors, but prism3 has 3"):
        PlanarEngine(PRISM, PLAIN).step(Gait((1.0, 2.0)), 0.1)
