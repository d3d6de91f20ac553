import pickle
from functools import partial

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.twin.presets import PLANAR_DRIVES, planar_robot
from vvvaltr.twin.scatter import Scatter, TrackerNoise
from vvvaltr.twin.world import Hills, World

LIVELY = Gait((12.0, 14.0, 16.0))
SHORT = TrialSettings(duration_s=1.0)


def trial(robot: Robot, number: int, gait: Gait = LIVELY):
    done = run_trial(robot, gait, SHORT, number)
    assert done.outcome is Outcome.COMPLETED, done.reason
    return done.poses, done.states, done.commands


def moved_m(robot, number):
    poses, _, _ = trial(robot, number)
    return poses[-1].position_m[0] - poses[0].position_m[0]


def test_a_trial_depends_on_seed_and_number_alone_not_on_what_came_before():
    robot = planar_robot(seed=4)
    earlier = [trial(robot, number) for number in (1, 2)]

    assert trial(planar_robot(seed=4), 2)[0][0].position_m == earlier[1][0][0].position_m
    assert moved_m(robot, 2) == moved_m(planar_robot(seed=4), 2)
    assert moved_m(robot, 1) != moved_m(robot, 2)
    assert moved_m(planar_robot(seed=5), 1) != moved_m(robot, 1)


def test_the_whole_record_of_a_trial_repeats_bit_for_bit():
    first, second = (trial(planar_robot(seed=4), 3) for _ in range(2))

    assert first == second


def test_without_scatter_every_trial_is_the_same():
    robot = planar_robot(scatter=Scatter.none(), noise=TrackerNoise.none())

    assert moved_m(robot, 1) == pytest.approx(moved_m(robot, 2), abs=1e-12)


def test_repeats_of_a_gait_scatter_as_those_of_a_real_robot_do():
    robot = planar_robot(seed=9)
    distances = np.abs([moved_m(robot, number) for number in range(1, 11)])

    assert 0.1 < np.std(distances) / np.mean(distances) < 1.0


def test_a_command_expires_on_the_twins_own_time():
    robot = planar_robot(scatter=Scatter.none(), noise=TrackerNoise.none())
    robot.motors.drive(LIVELY, hold_s=0.25)
    robot.clock.sleep(0.25)
    held = robot.motors.state().frequency_hz
    robot.clock.sleep(1.0)

    assert held == pytest.approx(LIVELY.frequency_hz, rel=0.01)
    assert robot.motors.state().frequency_hz == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_a_command_that_expires_during_a_sleep_counts_to_the_step():
    robots = [planar_robot(scatter=Scatter.none(), noise=TrackerNoise.none()) for _ in range(2)]
    for robot, naps_s in zip(robots, [[0.5], [0.25, 0.25]], strict=True):
        robot.motors.drive(LIVELY, hold_s=0.25)
        for nap_s in naps_s:
            robot.clock.sleep(nap_s)

    assert robots[0].tracker.pose().markers_m == robots[1].tracker.pose().markers_m
    assert robots[0].motors.state() == robots[1].motors.state()


def test_stop_and_close_let_the_motors_run_down_and_may_be_repeated():
    robot = planar_robot()
    for halt in (robot.motors.stop, robot.motors.stop, robot.close, robot.close):
        robot.motors.drive(LIVELY, hold_s=10.0)
        robot.clock.sleep(0.3)
        halt()
        robot.clock.sleep(1.5)
        assert robot.motors.state().frequency_hz == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_time_grows_over_trials_and_only_by_sleeping():
    robot = planar_robot()
    times_s = []
    for number in range(3):
        robot.place(number)
        times_s.append(robot.clock.now_s())
        robot.clock.sleep(0.2)

    assert times_s == pytest.approx([0.0, 0.2, 0.4])
    assert robot.tracker.pose().t_s == robot.motors.state().t_s == robot.clock.now_s()


def test_motors_differ_from_their_command_in_every_trial_and_never_exceed_their_limit():
    robot = planar_robot(seed=1, scatter="frequency")
    applied = []
    for number in range(20):
        robot.place(number)
        robot.motors.drive(Gait((16.7, 10.0, -16.7)), hold_s=1.0)
        robot.clock.sleep(1.0)
        applied.append(robot.motors.state().frequency_hz)

    assert np.abs(applied).max() <= 16.7
    assert 0.06 < np.std(np.log(np.array(applied)[:, 1])) < 0.16


def test_the_tracker_sees_centre_and_strut_ends_with_noise_in_the_plane_of_the_robot_or_beside_it():
    robot = planar_robot(seed=2)
    robot.place(1)
    poses = [robot.tracker.pose() for _ in range(200)]
    places = np.array([pose.position_m for pose in poses])

    assert places.std(axis=0) == pytest.approx([0.0002] * 3, rel=0.2)
    assert abs(places[:, 1].mean()) < 1e-4
    assert len(poses[0].markers_m) == 6
    assert np.std([pose.yaw_rad for pose in poses]) == pytest.approx(0.002, rel=0.2)


def test_the_structure_names_the_terrain():
    structure = planar_robot(world=World(ground=Hills())).structure

    assert len(structure.springs) == 9
    assert structure.terrain is not None
    assert np.ptp(structure.terrain.height_m) > 0.003


def test_a_robot_can_be_made_in_a_worker_from_what_was_sent_there():
    make = partial(planar_robot, world=World(ground=Hills(seed=3)), damage=("snap:3",), seed=6, scatter=Scatter())
    sent = pickle.loads(pickle.dumps(make))

    assert moved_m(sent(), 1) == moved_m(make(), 1)


def test_the_range_to_search_is_that_of_the_law():
    assert planar_robot().range_hz == PLANAR_DRIVES["eccentric"].range_hz == (4.0, 16.7)
    assert planar_robot(law="constant").range_hz == (5.0, 50.0)
    assert planar_robot(damage=["disable:1"]).max_hz == (16.7, 16.7, 16.7)


def test_the_motors_take_frequency_phase_and_amplitude():
    assert planar_robot().motors.quantities == frozenset(Quantity)
    assert planar_robot(body="icosahedron6").motors.motor_count == 3


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (partial(planar_robot, body="cube"), "unknown body 'cube'; choose one of prism3, icosahedron6"),
        (partial(planar_robot, law="magic"), "unknown force law 'magic'; choose one of eccentric, constant"),
        (
            partial(planar_robot, damage=["snap:10"]),
            "damage 'snap:10': there is no spring 10; springs are numbered 1 to 9",
        ),
    ],
)
def test_an_impossible_robot_is_refused_in_one_line(make, complaint):
    with pytest.raises(ValueError, match=complaint):
        make()


def test_an_impossible_command_is_refused():
    motors = planar_robot().motors

    with pytest.raises(ValueError, match="a gait for 2 motors, but the twin has 3"):
        motors.drive(Gait((1.0, 2.0)), 0.1)
    for hold_s in (0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(ValueError, match="hold_s is"):
            motors.drive(LIVELY, hold_s)
