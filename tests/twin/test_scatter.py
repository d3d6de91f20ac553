import math

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.movement import measure_movement
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.twin import scatter
from vvvaltr.twin.engine import Start
from vvvaltr.twin.presets import planar_robot, spatial_robot
from vvvaltr.twin.scatter import CAREFUL, HURRIED, Scatter, TrackerNoise, parse_scatter
from vvvaltr.twin.world import World

LIVELY = Gait((12.0, 14.0, 16.0))
SHORT = TrialSettings(duration_s=1.0)


def test_a_scatter_is_written_as_a_preset_and_what_differs_from_it():
    assert parse_scatter("careful", 0.1) == CAREFUL
    assert parse_scatter("hurried:incline_rad=0.05,left=no,battery_trials=10", 0.1).incline_rad == 0.05
    assert not parse_scatter("hurried:left=no", 0.1).left
    assert parse_scatter("frequency", 0.05) == Scatter(frequency=0.05, spin_up_s=0.0)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("hurried2", "unknown scatter 'hurried2'"),
        ("careful:slope=1", "unknown setting of scatter 'slope'"),
        ("careful:incline_rad=2", "incline_rad is 2; allowed: 0 to 0.5"),
        ("careful:left=true", "left is 'true'; allowed: yes or no"),
        ("careful:drift=nan", "drift is nan"),
        ("careful:frequency=10", "frequency is 10; allowed: 0 to 1"),
        ("hurried:azimuth_rad=nan", "azimuth_rad is nan; allowed: any angle"),
        ("hurried:azimuth_rad=inf", "azimuth_rad is inf"),
        ("careful:battery_trials=1.5", "not a whole number"),
    ],
)
def test_a_scatter_that_makes_no_sense_is_refused_in_one_line(text, complaint):
    with pytest.raises(ValueError, match=complaint):
        parse_scatter(text, 0.1)


def test_the_strength_of_a_long_run_is_drawn_once_a_trial(monkeypatch):
    drawn = []
    monkeypatch.setattr(scatter, "stream", lambda *key: drawn.append(key) or stream(*key))

    strengths = [HURRIED.strength(4711, trial) for trial in range(1, 101)]

    assert len(drawn) <= 100
    assert strengths == [HURRIED.strength(4711, trial) for trial in range(1, 101)]
    assert len(set(strengths)) == 100


def test_on_an_inclined_floor_without_friction_a_robot_slides_downhill_as_gravity_says():
    engine = spatial_robot(scatter="none", world=World(friction=0.0)).engine
    engine.incline(0.05, math.pi / 2.0)
    before_m = engine.nodes_m().mean(axis=0)

    engine.step(Gait((0.0, 0.0, 0.0)), 0.5)

    moved_m = engine.nodes_m().mean(axis=0) - before_m
    assert moved_m[:2] == pytest.approx([0.0, 0.5 * 9.81 * math.sin(0.05) * 0.5**2], abs=1e-4)


def test_the_planar_floor_goes_down_towards_either_side():
    ends_m = []
    for azimuth_rad in (0.3, 2.8):
        engine = planar_robot(scatter="none").engine
        engine.incline(0.6, azimuth_rad)
        engine.step(Gait((0.0, 0.0, 0.0)), 0.5)
        ends_m.append(engine.nodes_m()[:, 0].mean())

    assert ends_m[0] > 0.05 and ends_m[1] < -0.05


def test_a_robot_that_is_left_goes_on_where_it_stopped_and_is_put_back_at_the_border():
    robot = planar_robot(seed=2, scatter="hurried:incline_rad=0,not_starting=0,stopping=0,border_m=0.012")
    movements = [measure_movement(run_trial(robot, LIVELY, SHORT, number)) for number in range(1, 8)]
    ends_m = [movement.end.position_m[0] for movement in movements]
    starts_m = [movement.start.position_m[0] for movement in movements]

    goes_on = [abs(after - before) < 0.002 for before, after in zip(ends_m, starts_m[1:], strict=False)]
    was_outside = [abs(end_m) > 0.012 for end_m in ends_m[:-1]]
    assert any(was_outside) and not all(was_outside)
    assert [not it for it in goes_on] == was_outside


def test_a_motor_that_does_not_start_is_told_or_not():
    for telling in ("yes", "no"):
        robot = planar_robot(seed=1, scatter=f"careful:not_starting=1,telling={telling}")
        states = run_trial(robot, LIVELY, SHORT).states
        still = [hz == 0.0 for hz in states[-1].frequency_hz]

        assert sum(still) == (telling == "yes")
        assert states[-1].measured == (telling == "yes")


def test_a_motor_that_stops_within_a_trial_turned_before():
    robot = planar_robot(seed=3, scatter="careful:stopping=1")
    states = run_trial(robot, LIVELY, TrialSettings(duration_s=5.0)).states
    last_hz = np.abs(states[-1].frequency_hz)
    stopped = int(last_hz.argmin())

    assert last_hz[stopped] < 0.01
    assert max(abs(state.frequency_hz[stopped]) for state in states) > 5.0


def test_strength_never_exceeds_the_full_one_fades_and_comes_back_with_new_batteries():
    fading = Scatter(fade=0.01, battery_trials=10)
    of_run = [fading.strength(0, trial) for trial in range(1, 21)]

    assert of_run[0] == of_run[10] == 1.0
    assert of_run[9] == pytest.approx(math.exp(-0.09))
    assert max(HURRIED.strength(seed, trial) for seed in range(20) for trial in (1, 10, 40)) == 1.0


def test_a_step_stays():
    of_run = [Scatter(step=0.1, step_factor=0.5).strength(4, trial) for trial in range(1, 30)]

    assert len(set(of_run)) > 1
    assert of_run == sorted(of_run, reverse=True)


def test_a_weaker_robot_is_slower():
    def moved_m(scatter):
        robot = planar_robot(scatter=scatter)
        ends = [measure_movement(run_trial(robot, LIVELY, SHORT, number)) for number in (1, 2)]
        return [abs(movement.displacement.forward_m) for movement in ends]

    fresh, weak = moved_m("none:step=1,step_factor=0.8")
    assert weak < 0.8 * fresh


def test_motors_take_their_time_to_spin_up_and_stop_as_fast_as_before():
    robot = planar_robot(scatter="none:spin_up_s=1")
    for _ in range(20):
        robot.motors.drive(LIVELY, 0.25)
        robot.clock.sleep(0.05)
    spun_up_hz = robot.motors.state().frequency_hz
    robot.motors.stop()
    robot.clock.sleep(0.25)

    assert spun_up_hz == pytest.approx([0.95 * hz for hz in LIVELY.frequency_hz], rel=0.01)
    assert np.abs(robot.motors.state().frequency_hz).max() < 0.15


def test_truth_is_measured_on_a_level_floor_with_full_strength_and_all_motors():
    true = HURRIED.level()

    assert (true.incline_rad, true.left, true.not_starting, true.stopping) == (0.0, False, 0.0, 0.0)
    assert true.strength(0, 100) == 1.0
    assert true.spin_up_s == HURRIED.spin_up_s


def test_the_tracker_has_its_noise_without_any_scatter_unless_an_exact_one_is_asked_for():
    noisy, exact = planar_robot(scatter="none"), planar_robot(scatter="none", noise=TrackerNoise.none())

    assert noisy.tracker.pose() != noisy.tracker.pose()
    assert exact.tracker.pose() == exact.tracker.pose()


def test_a_robot_that_broke_down_is_put_down_again():
    robot = spatial_robot(seed=1, scatter="hurried")
    robot.place(1)
    robot._driven.is_broken = True

    robot.place(2)

    assert robot.engine.time_s == 0.0 and not robot._driven.is_broken
    assert run_trial(robot, Gait((10.0, 10.0, 10.0)), SHORT, 3).outcome is Outcome.COMPLETED


def test_the_tracker_tells_a_heading_of_more_than_half_a_turn_as_real_trackers_do():
    robot = spatial_robot(scatter="none", noise=TrackerNoise.none())
    robot.put_down(Start(yaw_rad=7.0))

    assert robot.tracker.pose().yaw_rad == pytest.approx(7.0 - math.tau, abs=1e-6)
    assert run_trial(robot, Gait((10.0, 10.0, 10.0)), SHORT).outcome is Outcome.COMPLETED
