"""What every robot does, whatever it is made of: twins, and each driver on its device in a process of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.values import Gait, Outcome, Quantity
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.hardware import open_hardware
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.mocking.process import MockProcess
from vvvaltr.twin.presets import TWINS
from vvvaltr.twin.scatter import Scatter

GAIT = Gait((9.0, -11.0, 6.0))
REST = Gait((0.0, 0.0, 0.0))


@pytest.fixture(scope="module", params=["planar", "spatial", "qik", "odrive", "node"])
def source(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str | MockProcess]:
    if request.param in ("planar", "spatial"):
        yield request.param
    else:
        with MockProcess(request.param, tmp_path_factory.mktemp("mock") / "port") as mock:
            yield mock


@pytest.fixture
def robot(source: str | MockProcess) -> Iterator[Robot]:
    with closing(_opened(source)) as robot:
        yield robot


def _opened(source: str | MockProcess) -> Robot:
    if isinstance(source, MockProcess):
        return open_hardware(load_robot_file(Path(source.greeting.robot_file)))
    return TWINS[source].make(scatter=Scatter.none())


def hold(robot: Robot, gait: Gait, duration_s: float) -> None:
    for _ in range(round(duration_s / 0.05)):
        robot.motors.drive(gait, 0.25)
        robot.clock.sleep(0.05)
        robot.motors.state()


def test_motors_take_up_the_gait_with_its_signs(robot: Robot) -> None:
    hold(robot, GAIT, 0.6)

    assert robot.motors.state().frequency_hz == pytest.approx(GAIT.frequency_hz, abs=0.2)


def test_a_changed_gait_is_taken_up(robot: Robot) -> None:
    hold(robot, GAIT, 0.4)
    hold(robot, GAIT.scaled(-1.0), 0.7)

    assert robot.motors.state().frequency_hz == pytest.approx(GAIT.scaled(-1.0).frequency_hz, abs=0.2)


def test_a_command_expires(robot: Robot) -> None:
    hold(robot, GAIT, 0.2)

    robot.motors.drive(GAIT, 0.15)
    robot.clock.sleep(0.15 + 0.6)

    assert robot.motors.state().frequency_hz == pytest.approx(REST.frequency_hz, abs=0.5)


def test_motors_stop_and_a_second_stop_does_no_harm(robot: Robot) -> None:
    hold(robot, GAIT, 0.2)

    robot.motors.stop()
    robot.motors.stop()
    robot.clock.sleep(0.6)

    assert robot.motors.state().frequency_hz == pytest.approx(REST.frequency_hz, abs=0.5)


def test_motors_start_again_after_a_stop(robot: Robot) -> None:
    hold(robot, GAIT, 0.2)
    robot.motors.stop()
    robot.clock.sleep(0.2)

    hold(robot, GAIT, 0.6)

    assert robot.motors.state().frequency_hz == pytest.approx(GAIT.frequency_hz, abs=0.2)


def test_a_gait_for_other_motors_is_refused(robot: Robot) -> None:
    with pytest.raises(ValueError, match="2 motors"):
        robot.motors.drive(Gait((5.0, 5.0)), 0.25)


def test_what_the_motors_cannot_set_is_refused(robot: Robot) -> None:
    gaits = {
        Quantity.PHASE: Gait((5.0, 5.0, 5.0), phase_rad=(0.0, 1.0, 0.0)),
        Quantity.AMPLITUDE: Gait((5.0, 5.0, 5.0), amplitude=(1.0, 0.5, 1.0)),
    }

    for quantity, gait in gaits.items():
        if quantity in robot.motors.quantities:
            robot.motors.drive(gait, 0.25)
        else:
            with pytest.raises(ValueError, match=r"cannot set|can set"):
                robot.motors.drive(gait, 0.25)


def test_news_of_the_motors_is_on_the_robots_clock(robot: Robot) -> None:
    hold(robot, GAIT, 0.2)

    assert robot.clock.now_s() - 0.3 <= robot.motors.state().t_s <= robot.clock.now_s() + 0.01


def test_poses_are_finite_and_on_the_robots_clock(robot: Robot) -> None:
    first = robot.tracker.pose()
    hold(robot, GAIT, 0.2)
    last = robot.tracker.pose()

    assert first.is_finite and last.is_finite
    assert len(last.markers_m) in (6, 12)
    assert robot.clock.now_s() - 0.3 <= last.t_s <= robot.clock.now_s() + 0.01
    assert last.t_s > first.t_s


def test_sleeping_takes_its_time(robot: Robot) -> None:
    robot.clock.sleep(0.01)
    before_s = robot.clock.now_s()

    robot.clock.sleep(0.1)

    assert robot.clock.now_s() - before_s >= 0.05  # a sleep makes up for the lateness of the one before


def test_closing_stops_the_motors_and_can_be_done_twice(source: str | MockProcess) -> None:
    robot = _opened(source)
    hold(robot, GAIT, 0.2)

    robot.close()
    robot.close()

    if isinstance(source, MockProcess):
        source.wait_until(lambda status: status.is_at_rest, timeout_s=0.5)


def test_a_trial_moves_the_robot_and_records_what_was_applied(robot: Robot) -> None:
    trial = run_trial(robot, Gait((16.0, -15.0, 14.0)), TrialSettings(duration_s=0.7, heading_limit_rad=None))

    assert trial.outcome is Outcome.COMPLETED
    assert trial.duration_s == pytest.approx(0.7, abs=0.06)
    assert trial.states[-1].frequency_hz == pytest.approx((16.0, -15.0, 14.0), abs=0.3)
    assert max(math.dist(pose.position_m, trial.poses[0].position_m) for pose in trial.poses) > 0.0005
