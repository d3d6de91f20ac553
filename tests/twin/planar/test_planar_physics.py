"""The planar twin against results of mechanics that hold for every program."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.twin.bodies import icosahedron6, prism3
from vvvaltr.twin.body import Body, EccentricForce, Motor, Spring, Strut
from vvvaltr.twin.engine import Start
from vvvaltr.twin.planar.engine import PlanarEngine
from vvvaltr.twin.planar.plane import Plane, Posture, flatten
from vvvaltr.twin.presets import PLANAR_PARTS
from vvvaltr.twin.world import PLAIN, Slope, World

STEP_S = 0.001
ROD = Body(
    name="rod",
    nodes_m=((-0.047, 0.0, 0.0), (0.047, 0.0, 0.0)),
    struts=(Strut(0.003, 0.02),),
    springs=(),
    motors=(Motor(0, EccentricForce(1e-5), 0.0, 16.7, 0.05),),
    tension_only=False,
)


def left_alone(plane, duration_s):
    for _ in range(round(duration_s / STEP_S / 50)):
        plane.run(np.zeros((50, 1), complex))


def lying_rod(world):
    return Plane(ROD, world, Posture(np.array([[0.0, 0.003]]), np.array([math.pi])), STEP_S)


def energy_j(plane, body, gravity_m_s2):
    layout, nodes = flatten(body), plane.nodes_m()
    masses, middles = body.masses_kg, plane.posture().middles_m
    stretch = [
        math.dist(nodes[spring.nodes[0]], nodes[spring.nodes[1]]) - rest
        for spring, rest in zip(body.springs, layout.rests_m, strict=True)
    ]
    moving = sum(s.mass * abs(s.velocity) ** 2 + s.moment * s.angular_velocity**2 for s in plane.struts) / 2.0
    elastic = sum(s.stiffness_n_m * x * x for s, x in zip(body.springs, stretch, strict=True)) / 2.0
    return moving + elastic + gravity_m_s2 * float(masses @ middles[:, 1])


@pytest.mark.parametrize("body", [prism3(PLANAR_PARTS), icosahedron6(PLANAR_PARTS)], ids=lambda body: body.name)
def test_the_centre_of_mass_falls_freely_whatever_the_springs_do(body):
    plane = Plane(body, PLAIN, flatten(body).posture.move(0.0, 0.0, 1.0), STEP_S)
    masses = body.masses_kg
    before = masses @ plane.posture().middles_m / masses.sum()

    left_alone(plane, 0.4)

    fallen = masses @ plane.posture().middles_m / masses.sum() - before
    assert fallen[1] == pytest.approx(-9.81 * 0.4**2 / 2.0, rel=0.005)
    assert fallen[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("friction", [0.3, 0.5, 0.75])
def test_a_sliding_strut_stops_after_v_squared_over_two_mu_g(friction):
    plane = lying_rod(World(friction=friction))
    left_alone(plane, 0.1)
    start_m = plane.struts[0].position.x
    plane.struts[0].velocity = (0.6, 0.0)

    left_alone(plane, 0.5)

    assert abs(plane.struts[0].velocity) < 1e-6
    assert plane.struts[0].position.x - start_m == pytest.approx(0.6**2 / (2.0 * friction * 9.81), rel=0.02)


def test_a_strut_slides_down_a_slope_with_g_times_sine_less_mu_cosine():
    angle_rad, friction = 0.3, 0.1
    engine = PlanarEngine(ROD, World(friction=friction, ground=Slope(angle_rad)), STEP_S)
    engine.reset(Start(pitch_rad=-angle_rad))
    start = engine.nodes_m().mean(axis=0)
    left_alone(engine._plane, 0.5)

    slid_m = float(np.linalg.norm(engine.nodes_m().mean(axis=0) - start))
    expected_m = 9.81 * (math.sin(angle_rad) - friction * math.cos(angle_rad)) * 0.5**2 / 2.0
    assert slid_m == pytest.approx(expected_m, rel=0.02)


def test_a_strut_stays_on_a_slope_that_friction_can_hold():
    engine = PlanarEngine(ROD, World(friction=0.5, ground=Slope(0.3)), STEP_S)
    engine.reset(Start(pitch_rad=-0.3))
    left_alone(engine._plane, 0.2)
    before = engine.nodes_m()
    left_alone(engine._plane, 1.0)

    assert np.abs(engine.nodes_m() - before).max() < 5e-5


def test_two_struts_on_a_spring_swing_at_the_root_of_stiffness_over_reduced_mass():
    mass_kg, stiffness_n_m = 0.02, 50.0
    pair = replace(
        ROD,
        nodes_m=((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.2, 0.0, 0.0), (0.3, 0.0, 0.0)),
        struts=(Strut(0.003, mass_kg),) * 2,
        springs=(Spring((1, 2), 0.09, stiffness_n_m, 0.0),),
    )
    plane = Plane(pair, World(gravity_m_s2=0.0), flatten(pair).posture.move(0.0, 0.0, 1.0), STEP_S)
    gaps = []
    for _ in range(1000):
        plane.run(np.zeros((1, 1), complex))
        gaps.append(abs(plane.struts[1].position.x - plane.struts[0].position.x) - 0.19)

    crossings = np.flatnonzero(np.diff(np.sign(gaps)) > 0)
    frequency_hz = (len(crossings) - 1) / ((crossings[-1] - crossings[0]) * STEP_S)
    assert frequency_hz == pytest.approx(math.sqrt(stiffness_n_m / (mass_kg / 2.0)) / (2.0 * math.pi), rel=0.01)
    assert max(gaps) == pytest.approx(0.01, rel=0.02)


@pytest.mark.parametrize("body", [prism3(PLANAR_PARTS), icosahedron6(PLANAR_PARTS)], ids=lambda body: body.name)
def test_without_motors_energy_only_ever_gets_less(body):
    plane = PlanarEngine(body, PLAIN, STEP_S)._plane
    rest_j = energy_j(plane, body, 9.81)
    for strut, velocity in zip(plane.struts, np.random.default_rng(1).normal(0.0, 0.2, (6, 2)).tolist(), strict=False):
        strut.velocity = tuple(velocity)

    energies = [energy_j(plane, body, 9.81)]
    for _ in range(20):
        left_alone(plane, 0.1)
        energies.append(energy_j(plane, body, 9.81))

    assert energies[0] > rest_j + 1e-4
    assert np.diff(energies).max() < 1e-6
    assert energies[-1] == pytest.approx(rest_j, abs=1e-3)


def test_halving_the_time_step_changes_the_median_speed_by_less_than_a_tenth():
    gaits = [Gait(tuple(gait)) for gait in np.random.default_rng(3).uniform(12.0, 16.7, (8, 3)).tolist()]

    def speeds(time_step_s):
        engine = PlanarEngine(prism3(PLANAR_PARTS), PLAIN, time_step_s)
        found = []
        for gait in gaits:
            engine.reset()
            engine.step(gait, 3.0)
            found.append(abs(engine.nodes_m()[:, 0].mean()))
        return found

    assert np.median(speeds(0.001)) == pytest.approx(np.median(speeds(0.002)), rel=0.1)
