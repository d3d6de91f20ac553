import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from vvvaltr.controller.core.errors import DeviceFault, UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.twin.bodies import icosahedron6, prism3
from vvvaltr.twin.body import EccentricForce, Shape, apply_damage
from vvvaltr.twin.engine import Diverged, Start
from vvvaltr.twin.presets import SPATIAL_DRIVES, SPATIAL_PARTS, spatial_robot
from vvvaltr.twin.robot import TwinRobot
from vvvaltr.twin.scatter import Scatter
from vvvaltr.twin.spatial.engine import SpatialEngine
from vvvaltr.twin.world import PLAIN, Hills, Slope, World

STILL = Gait((0.0, 0.0, 0.0))
LIVELY = Gait((30.0, -22.0, 41.0))
BODY = icosahedron6(SPATIAL_PARTS)
HILLS = World(ground=Hills(height_m=0.02, wavelength_m=0.3, seed=4))
SHORT = TrialSettings(duration_s=1.0)
ASKEW = Start(0.01, -0.02, 0.3, 0.02)


@pytest.fixture(scope="module")
def engine():
    return SpatialEngine(BODY, PLAIN)


def centre_m(engine):
    return engine.body.centre_m(engine.nodes_m())


def driven(engine, gait=LIVELY, pieces=(0.05,) * 10, start=ASKEW):
    engine.reset(start)
    for piece_s in pieces:
        engine.step(gait, piece_s)
    return engine.nodes_m()


def clearance_m(engine):
    """Return how high the lowest strut end is over the ground beneath it, less the strut's radius."""
    nodes_m = engine.nodes_m()
    heights_m = engine.world.height_m(nodes_m[:, 0], nodes_m[:, 1])
    return float(np.min(nodes_m[:, 2] - heights_m)) - engine.body.struts[0].radius_m


@pytest.mark.parametrize("make", [icosahedron6, prism3])
def test_the_same_calls_give_the_same_motion_bit_for_bit_after_a_reset_and_on_another_engine(make):
    engine = SpatialEngine(make(SPATIAL_PARTS), PLAIN)
    first = driven(engine)

    assert np.array_equal(first, driven(engine))
    assert np.array_equal(first, driven(SpatialEngine(make(SPATIAL_PARTS), PLAIN)))


def test_a_motion_in_other_pieces_is_the_same_motion(engine):
    whole = driven(engine, STILL, [0.3])

    assert np.array_equal(whole, driven(engine, STILL, [0.0001, 0.0123, 0.2, 0.0876]))
    assert engine.time_s == pytest.approx(0.3)
    assert driven(engine, pieces=[0.5]) == pytest.approx(driven(engine, pieces=[0.123, 0.377]), abs=1e-9)


def test_every_gait_parameter_matters(engine):
    nodes_m = driven(engine)

    for other in (
        Gait((30.0, -22.0, 40.0)),
        Gait((30.0, 22.0, 41.0)),
        Gait(LIVELY.frequency_hz, phase_rad=(0.0, 1.0, 0.0)),
        Gait(LIVELY.frequency_hz, amplitude=(1.0, 1.0, 0.5)),
    ):
        assert np.abs(driven(engine, other) - nodes_m).max() > 1e-5


def test_a_gait_for_another_number_of_motors_is_refused(engine):
    with pytest.raises(ValueError, match="a gait for 2 motors, but icosahedron6 has 3"):
        engine.step(Gait((1.0, 2.0)), 0.1)


def test_the_robot_stands_on_three_struts_at_the_height_of_its_centre(engine):
    engine.reset()

    nodes_m = engine.nodes_m()

    assert centre_m(engine)[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert nodes_m[:, 2].mean() == pytest.approx(0.044, abs=0.001)
    assert centre_m(engine)[2] == pytest.approx(0.046, abs=0.001)  # the motors sit in struts that lean higher
    assert np.sort(nodes_m[:, 2])[:3] == pytest.approx([0.004] * 3, abs=1e-4)
    assert np.linalg.norm(nodes_m[0::2] - nodes_m[1::2], axis=1) == pytest.approx([0.094] * 6)


def test_the_robot_is_put_down_where_it_is_told(engine):
    engine.reset(Start(0.2, -0.1, 2.5, 0.05))

    assert centre_m(engine)[:2] == pytest.approx([0.2, -0.1], abs=1e-12)
    assert engine.angles_rad() == (2.5, 0.05, 0.0)
    assert clearance_m(engine) == pytest.approx(0.0, abs=1e-4)
    engine.step(STILL, 0.0005)
    assert engine.angles_rad() == pytest.approx((2.5, 0.05, 0.0), abs=1e-3)


def test_the_heading_goes_on_past_half_a_turn(engine):
    alike = Gait((50.0, 50.0, 50.0))  # three motors as one turn a body that looks the same from three sides
    headings = []
    engine.reset()
    for _ in range(60):
        engine.step(alike, 0.05)
        headings.append(engine.angles_rad()[0])

    assert abs(headings[-1]) > 2.0 * math.pi
    assert np.abs(np.diff(headings)).max() < 1.0


def test_applied_frequencies_follow_the_command_with_a_lag_and_a_limit(engine):
    engine.reset()
    engine.step(Gait((10.0, -80.0, 0.0)), SPATIAL_PARTS.spin_up_s)
    after_a_lag = engine.applied_hz()
    engine.step(Gait((10.0, -80.0, 0.0)), 1.0)

    assert after_a_lag == pytest.approx((10.0 * (1.0 - math.exp(-1.0)), -50.0 * (1.0 - math.exp(-1.0)), 0.0))
    assert engine.applied_hz() == pytest.approx((10.0, -SPATIAL_PARTS.max_hz, 0.0))


@pytest.mark.parametrize("world", [HILLS, World(ground=Slope(0.1))], ids=["hills", "slope"])
def test_the_robot_stands_on_ground_of_any_shape(world):
    engine = SpatialEngine(BODY, world)
    for place in (Start(0.3, 0.1, 1.0), Start(-0.4, 0.25), Start(0.05, -0.45, -2.0)):
        engine.reset(place)
        before_m, before_rad = centre_m(engine), engine.angles_rad()
        engine.step(STILL, 0.5)

        assert clearance_m(engine) == pytest.approx(0.0, abs=5e-4)
        assert np.abs(centre_m(engine) - before_m).max() < 0.003
        assert engine.angles_rad() == pytest.approx(before_rad, abs=0.1)


def test_on_a_slope_the_robot_is_put_down_along_it():
    engine = SpatialEngine(BODY, World(ground=Slope(0.2)))
    for yaw_rad in (0.0, math.pi / 2.0, 2.0):
        engine.reset(Start(yaw_rad=yaw_rad))
        nodes_m = engine.nodes_m()
        feet_m = np.sort(nodes_m[:, 2] - math.tan(0.2) * nodes_m[:, 0])[:3]

        assert np.ptp(feet_m) < 1e-4


def test_a_steep_slope_lets_the_robot_slide_and_a_gentle_one_holds_it():
    slid_m = []
    for angle_rad in (0.2, 0.5):
        engine = SpatialEngine(BODY, World(friction=0.4, ground=Slope(angle_rad)))
        engine.step(STILL, 1.0)
        slid_m.append(-centre_m(engine)[0])

    assert slid_m[0] < 0.02
    assert slid_m[1] > 0.2


def test_leaving_the_hills_is_a_fault_and_not_a_fall():
    engine = SpatialEngine(BODY, HILLS)
    engine.reset(Start(x_m=1.49))

    with pytest.raises(DeviceFault, match=r"left the hills, which end at 1\.5 m"):
        engine.step(STILL, 0.1)


def test_damage_changes_how_the_robot_stands_and_moves(engine):
    whole = driven(engine)

    for specs in (["snap:4,18"], ["lighten:3:0.5"], ["disable:2"]):
        hurt = SpatialEngine(apply_damage(BODY, specs), PLAIN)
        assert np.abs(driven(hurt) - whole).max() > 1e-4

    sagged = SpatialEngine(apply_damage(BODY, ["snap:4,18"]), PLAIN)
    engine.reset()
    assert centre_m(sagged)[2] < centre_m(engine)[2] - 0.005


def test_springs_that_push_differ_from_springs_that_only_pull_once_they_go_slack():
    motions = []
    for tension_only in (True, False):
        parts = replace(SPATIAL_PARTS, rest_share=1.1, tension_only=tension_only)
        motions.append(SpatialEngine(icosahedron6(parts), PLAIN).nodes_m())

    assert motions[0][:, 2].max() < motions[1][:, 2].max() - 0.005  # without a push it lies down


def test_struts_can_be_boxes():
    engine = SpatialEngine(icosahedron6(replace(SPATIAL_PARTS, shape=Shape.BOX)), PLAIN)
    engine.step(LIVELY, 1.0)

    assert 0.03 < centre_m(engine)[2] < 0.05


@pytest.mark.parametrize("time_step_s", [0.02, 0.0005])
def test_a_motion_that_breaks_down_is_a_fault_with_a_reason_and_leaves_no_file(time_step_s, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # A step that is too long for the springs; or a motor of more than a hundred times the weight.
    law = SPATIAL_PARTS.law if time_step_s > 0.001 else EccentricForce(1e-3)

    def trial():
        parts = replace(SPATIAL_PARTS, law=law)
        robot = TwinRobot(
            SpatialEngine(icosahedron6(parts), PLAIN, time_step_s),
            SPATIAL_DRIVES["eccentric"].range_hz,
            0,
            Scatter.none(),
        )
        return run_trial(robot, Gait((50.0, 50.0, 45.0)), SHORT)

    if time_step_s > 0.001:
        with pytest.raises(Diverged, match="the spatial twin broke down at"):
            trial()
    else:
        done = trial()
        assert done.outcome is Outcome.FAULTED
        assert "the spatial twin broke down at" in done.reason
    assert list(tmp_path.iterdir()) == []


def test_a_state_that_stays_behind_the_clock_is_a_fault_and_not_a_robot_that_rests(engine):
    engine.reset()
    engine.step(STILL, 0.1)
    engine._simulation._state[0] -= 0.01

    with pytest.raises(Diverged, match="MuJoCo stopped there"):
        engine.step(STILL, 0.1)


def test_without_mujoco_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)

    with pytest.raises(UserError, match=r'^the spatial twin needs MuJoCo: pip install "vvvaltr\[spatial\]"$'):
        spatial_robot()


def test_a_trial_runs_on_the_spatial_twin_and_depends_on_seed_and_number_alone():
    robot = spatial_robot(world=HILLS, damage=["snap:4"], seed=3)
    trials = [run_trial(robot, Gait((30.0, 22.0, 41.0)), SHORT, number) for number in (1, 2, 1)]

    assert {trial.outcome for trial in trials} <= {Outcome.COMPLETED, Outcome.CUT_SHORT}
    assert trials[0].poses == trials[2].poses
    assert trials[0].poses != trials[1].poses
    assert robot.structure.terrain is not None
    assert len(robot.structure.struts) == 6


def test_at_rest_the_ground_carries_the_weight_and_motors_push_nothing(engine):
    engine.reset()
    engine.step(STILL, 0.5)

    forces = engine.forces()

    weight_n = 9.81 * BODY.masses_kg.sum()
    assert np.sum(forces.contacts_n, axis=0) == pytest.approx([0.0, 0.0, weight_n], abs=0.001 * weight_n)
    assert [z_m for _, _, z_m in forces.contacts_m] == pytest.approx([0.0] * len(forces.contacts_m), abs=1e-4)
    assert len(forces.tensions_n) == len(BODY.springs)
    assert all(2.0 < tension_n < 3.5 for tension_n in forces.tensions_n)
    assert forces.motors_n == ((0.0, 0.0, 0.0),) * 3


def test_motors_push_with_the_force_of_their_law_across_their_struts(engine):
    nodes_m = driven(engine, Gait((30.0, 0.0, -40.0)))

    forces = engine.forces()

    for motor, hz in enumerate((30.0, 0.0, 40.0)):
        strut = BODY.motors[motor].strut
        axis = nodes_m[2 * strut] - nodes_m[2 * strut + 1]
        assert math.hypot(*forces.motors_n[motor]) == pytest.approx(SPATIAL_PARTS.law.at(hz), rel=1e-3)
        assert abs(np.dot(forces.motors_n[motor], axis)) < 1e-9


def test_looking_at_the_forces_does_not_change_the_motion(engine):
    unseen = driven(engine)
    engine.reset(ASKEW)
    for _ in range(10):
        engine.forces()
        engine.step(LIVELY, 0.05)

    assert np.array_equal(engine.nodes_m(), unseen)


@pytest.mark.parametrize("renderer", ["osmesa", "nonsense"])
def test_a_renderer_that_the_computer_lacks_does_not_matter(renderer):
    program = (
        "import os; from vvvaltr.twin.presets import spatial_robot; spatial_robot(); print(os.environ['MUJOCO_GL'])"
    )

    done = subprocess.run(
        [sys.executable, "-c", program], env={**os.environ, "MUJOCO_GL": renderer}, capture_output=True, text=True
    )

    assert (done.returncode, done.stdout.strip()) == (0, renderer), done.stderr
