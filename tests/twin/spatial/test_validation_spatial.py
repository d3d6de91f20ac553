"""The spatial twin against results of mechanics that hold for every program."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.twin.bodies import icosahedron6, prism3
from vvvaltr.twin.body import Body, Shape, Spring, Strut
from vvvaltr.twin.presets import SPATIAL_PARTS
from vvvaltr.twin.spatial.engine import TIME_STEP_S, SpatialEngine
from vvvaltr.twin.spatial.model import AXIAL_GYRATION_M, compile_model
from vvvaltr.twin.world import PLAIN, World

WEIGHTLESS = World(gravity_m_s2=0.0)
STILL = Gait((0.0, 0.0, 0.0))
BODIES = [icosahedron6(SPATIAL_PARTS), prism3(SPATIAL_PARTS)]
named = pytest.mark.parametrize("body", BODIES, ids=lambda body: body.name)


def at_design(body, world, hook_m=0.002, up_m=0.0, time_step_s=TIME_STEP_S):
    """Return model and data with the body at rest in its design state, ``up_m`` above the ground."""
    model = compile_model(body, world, time_step_s, hook_m)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY.value
    data = mujoco.MjData(model)
    coordinates(data)[:, 2] += body.struts[0].radius_m + up_m
    return model, data


def coordinates(data):
    return data.qpos.reshape(-1, 7)


def velocities(data):
    return data.qvel.reshape(-1, 6)[:, :3]


def relax(model, data):
    """Let the body find its equilibrium by bleeding off its speed, so that modes without damping die out too."""
    for _ in range(round(5.0 / TIME_STEP_S)):
        mujoco.mj_step(model, data)
        data.qvel *= 0.99


def nodes_m(model, data, body):
    """Return the nodes as MuJoCo itself sees them, shape (2 * struts, 3)."""
    mujoco.mj_kinematics(model, data)
    halves_m = [np.linalg.norm(np.subtract(*body.nodes_m[2 * i : 2 * i + 2])) / 2.0 for i in range(len(body.struts))]
    axes = data.xmat[1:].reshape(-1, 3, 3)[:, :, 2] * np.array(halves_m)[:, None]
    return np.stack([data.xpos[1:] + axes, data.xpos[1:] - axes], axis=1).reshape(-1, 3)


def centre_m(body, data):
    return body.masses_kg @ coordinates(data)[:, :3] / body.masses_kg.sum()


def energies_j(model, data, steps):
    """Return the sum of kinetic, elastic and potential energy before each step."""
    energies = []
    for _ in range(steps):
        mujoco.mj_step(model, data)
        energies.append(float(data.energy.sum()))
    return np.array(energies)


def damped(body, damping_n_s_m):
    return replace(body, springs=tuple(replace(spring, damping_n_s_m=damping_n_s_m) for spring in body.springs))


@named
def test_the_centre_of_mass_falls_freely_whatever_the_springs_do(body):
    model, data = at_design(body, PLAIN, up_m=1.0)
    start_m = centre_m(body, data)
    steps = round(0.4 / TIME_STEP_S)
    lengths_m = []

    for _ in range(steps):
        mujoco.mj_step(model, data)
        lengths_m.append(float(data.ten_length[0]))

    assert np.ptp(lengths_m) > 1e-6  # the springs were at work
    fallen_m = start_m - centre_m(body, data)
    assert fallen_m[2] == pytest.approx(9.81 * 0.4**2 / 2.0, rel=0.003)
    # The integrator's own sum, with no allowance: springs add nothing to it.
    assert fallen_m[2] == pytest.approx(9.81 * TIME_STEP_S**2 * steps * (steps + 1) / 2.0, abs=1e-12)
    assert fallen_m[:2] == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("mass_kg", [0.01, 0.04])
def test_a_strut_on_a_spring_oscillates_at_the_root_of_k_over_m(mass_kg):
    wall_kg, stiffness, rest_m = 1e6, 200.0, 0.05
    body = Body(
        name="strut on a spring",
        nodes_m=((0.1, 0.0, 1.0), (0.0, 0.0, 1.0), (-0.05, 0.0, 1.0), (-0.15, 0.0, 1.0)),
        struts=(Strut(0.004, mass_kg), Strut(0.004, wall_kg)),
        springs=(Spring((1, 2), rest_m, stiffness, 0.0),),
        motors=(),
        tension_only=False,
    )
    model, data = at_design(body, WEIGHTLESS)
    data.qpos[0] += 0.005

    stretches_m = []
    for _ in range(round(2.0 / TIME_STEP_S)):
        mujoco.mj_step(model, data)
        stretches_m.append(float(data.ten_length[0]) - rest_m)

    stretch = np.array(stretches_m)
    rising = np.flatnonzero((stretch[:-1] < 0.0) & (stretch[1:] >= 0.0))
    crossings = rising + stretch[rising] / (stretch[rising] - stretch[rising + 1])
    frequency_hz = (len(crossings) - 1) / ((crossings[-1] - crossings[0]) * TIME_STEP_S)
    assert frequency_hz == pytest.approx(math.sqrt(stiffness / mass_kg) / math.tau, rel=0.002)
    assert np.max(stretch) == pytest.approx(0.005, rel=0.01)


@pytest.mark.parametrize("damping_n_s_m", [0.4, 0.04])
@named
def test_energy_only_decreases_in_a_damped_body_that_floats(body, damping_n_s_m):
    model, data = at_design(damped(body, damping_n_s_m), WEIGHTLESS, up_m=1.0)
    velocities(data)[:] = np.random.default_rng(1).normal(0.0, 0.05, velocities(data).shape)

    energy = energies_j(model, data, 8000)

    # Within an oscillation the integrator's own energy ripples in proportion to the time step; so by means of 0.1 s.
    of_tenths = energy.reshape(-1, 200).mean(axis=1)
    assert np.all(np.diff(of_tenths) < 1e-7)
    assert np.all(energy < energy[0] + 1e-5)


@named
def test_energy_is_kept_without_damping(body):
    model, data = at_design(damped(body, 0.0), WEIGHTLESS, up_m=1.0)

    energy = energies_j(model, data, 8000)

    assert np.ptp(energy.reshape(-1, 500).mean(axis=1)) < 0.001 * energy[0]


@named
def test_energy_never_grows_when_a_body_falls_and_lands_without_motors(body):
    model, data = at_design(body, PLAIN, up_m=0.05)

    energy = energies_j(model, data, 6000)

    assert np.all(energy <= energy[0] + 1e-9)
    assert energy[-1] < energy[0] - 0.8 * body.masses_kg.sum() * 9.81 * 0.05


@pytest.mark.parametrize(("speed_m_s", "friction"), [(0.5, 0.5), (1.0, 0.5), (0.5, 0.25)])
def test_sliding_stops_after_v_squared_over_two_mu_g(speed_m_s, friction):
    rod = Body(
        name="rod",
        nodes_m=((0.047, 0.0, 0.0), (-0.047, 0.0, 0.0)),
        struts=(Strut(0.004, 0.02, Shape.BOX),),
        springs=(),
        motors=(),
        tension_only=True,
    )
    model, data = at_design(rod, World(friction=friction))
    for _ in range(200):
        mujoco.mj_step(model, data)
    start_m = data.qpos[0]
    data.qvel[0] = speed_m_s

    for _ in range(2000):
        mujoco.mj_step(model, data)

    assert data.qpos[0] - start_m == pytest.approx(speed_m_s**2 / (2.0 * friction * 9.81), rel=0.02)
    assert abs(data.qvel[0]) < 1e-4


def test_a_motor_that_speeds_up_turns_its_strut_by_the_torque_over_its_inertia():
    body = BODIES[0]
    model, data = at_design(replace(body, springs=()), WEIGHTLESS, up_m=1.0)
    data.ctrl[2] = 1e-6

    mujoco.mj_step(model, data)

    strut, mass_kg = body.motors[0].strut, body.masses_kg[body.motors[0].strut]
    spin_rad_s2 = data.qvel.reshape(-1, 6)[strut, 5] / TIME_STEP_S
    assert spin_rad_s2 == pytest.approx(1e-6 / (mass_kg * AXIAL_GYRATION_M**2), rel=1e-6)


def prism_twisted(twist_deg, height_m):
    """Return the prism with its top turned by ``twist_deg`` against its bottom, springs and struts as long as ever."""
    body = BODIES[1]
    strut_m = math.dist(*body.nodes_m[:2])
    turn = math.radians(120.0 + twist_deg)
    radius_m = math.sqrt((strut_m**2 - height_m**2) / (2.0 - 2.0 * math.cos(turn)))
    nodes = []
    for strut in range(3):
        bottom = math.radians(120.0 * strut)
        nodes += [(radius_m * math.cos(bottom + turn), radius_m * math.sin(bottom + turn), height_m)]
        nodes += [(radius_m * math.cos(bottom), radius_m * math.sin(bottom), 0.0)]
    return replace(body, nodes_m=tuple(nodes))


@pytest.mark.parametrize("twist_deg", [20.0, 40.0])
@pytest.mark.parametrize("rest_share", [0.5, 0.8])
def test_a_prism_of_three_struts_comes_to_rest_with_its_triangles_30_degrees_apart(twist_deg, rest_share):
    body = prism_twisted(twist_deg, height_m=0.06)
    springs = tuple(replace(spring, rest_m=rest_share * spring.rest_m / 0.75) for spring in body.springs)
    body = replace(body, springs=springs)
    model, data = at_design(body, WEIGHTLESS, hook_m=0.0, up_m=1.0)

    relax(model, data)

    nodes = nodes_m(model, data, body)
    tops, bottoms = nodes[0::2] - nodes[0::2].mean(axis=0), nodes[1::2] - nodes[1::2].mean(axis=0)
    up = np.cross(bottoms[0], bottoms[1])
    up /= np.linalg.norm(up)
    turn = math.atan2(up @ np.cross(bottoms[0], tops[0]), bottoms[0] @ tops[0])
    assert math.degrees(turn) - 120.0 == pytest.approx(30.0, abs=0.05)


@pytest.mark.parametrize("rest_share", [0.5, 0.75, 0.95])
def test_parallel_struts_of_the_icosahedron_come_to_rest_half_a_strut_apart(rest_share):
    body = BODIES[0]
    design_m = math.dist(body.nodes_m[body.springs[0].nodes[0]], body.nodes_m[body.springs[0].nodes[1]])
    springs = tuple(replace(spring, rest_m=rest_share * design_m) for spring in body.springs)
    model, data = at_design(replace(body, springs=springs), WEIGHTLESS, hook_m=0.0, up_m=1.0)
    middle_m = centre_m(body, data)
    # Pushed together to a shape that is not an equilibrium: every strut nearer to the middle.
    coordinates(data)[:, :3] = middle_m + 0.8 * (coordinates(data)[:, :3] - middle_m)

    relax(model, data)

    strut_m = math.dist(*body.nodes_m[:2])
    for first, second in ((0, 1), (2, 3), (4, 5)):
        apart_m = math.dist(data.xpos[1 + first], data.xpos[1 + second])
        assert apart_m / strut_m == pytest.approx(0.5, abs=1e-4)


@named
def test_without_drive_the_robot_moves_less_than_a_micrometre_in_10_s(body):
    engine = SpatialEngine(body, PLAIN)
    engine.step(STILL, 0.3)
    start_m = body.centre_m(engine.nodes_m())

    engine.step(STILL, 10.0)

    assert math.dist(body.centre_m(engine.nodes_m())[:2], start_m[:2]) < 1e-6


def test_halving_the_time_step_changes_the_median_speed_of_30_gaits_by_less_than_a_tenth():
    gaits = [Gait(tuple(frequencies)) for frequencies in np.random.default_rng(1).uniform(5.0, 50.0, (30, 3))]

    coarse, fine = (median_speed_m_s(SpatialEngine(BODIES[0], PLAIN, step_s), gaits) for step_s in (5e-4, 2.5e-4))

    assert coarse == pytest.approx(fine, rel=0.1)


def median_speed_m_s(engine, gaits, duration_s=1.5):
    speeds = []
    for gait in gaits:
        engine.reset()
        engine.step(STILL, 0.3)
        start_m = engine.body.centre_m(engine.nodes_m())
        for share in (0.25, 0.5, 0.75):
            engine.step(gait.scaled(share), 0.05)
        engine.step(gait, duration_s - 0.15)
        speeds.append(math.dist(engine.body.centre_m(engine.nodes_m())[:2], start_m[:2]) / duration_s)
    return float(np.median(speeds))
