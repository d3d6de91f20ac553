"""The behaviour of every robot, as a suite for pytest that also runs on the driver of another package.

::

    from vvvaltr.controller.robot.contract import RobotContract


    class TestYours(RobotContract):
        device = "yours"  # a driver with a mock; or override ``source`` and ``open_robot``

A robot under test has three motors that reach 16 Hz both ways, and moves when they turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.opening import choose_robot, open_rig
from vvvaltr.drivers.mocking.process import MockProcess

GAIT = Gait((9.0, -11.0, 6.0))
REST = Gait((0.0, 0.0, 0.0))


def _hold(robot: Robot, gait: Gait, duration_s: float) -> None:
    for _ in range(round(duration_s / 0.05)):
        robot.motors.drive(gait, 0.25)
        robot.clock.sleep(0.05)
        robot.motors.state()


class RobotContract:
    """The suite. ``device`` is the name of a driver whose mock is tested, in a process of its own."""

    device = ""

    @pytest.fixture(scope="class")
    @classmethod
    def source(cls, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
        """What ``open_robot`` opens robots from, one after another: by default a running mock device."""
        with MockProcess(cls.device, tmp_path_factory.mktemp("mock") / "port") as mock:
            yield mock

    def open_robot(self, source: Any) -> Robot:
        """Return a robot whose motors are behind their guard, as in a run."""
        return open_rig(choose_robot({"name": source.greeting.robot_file}), seed=0).robot

    @pytest.fixture
    def robot(self, source: Any) -> Iterator[Robot]:
        """An open robot."""
        with closing(self.open_robot(source)) as robot:
            yield robot

    def test_motors_take_up_the_gait_with_its_signs(self, robot: Robot) -> None:
        _hold(robot, GAIT, 0.6)

        assert robot.motors.state().frequency_hz == pytest.approx(GAIT.frequency_hz, abs=0.2)

    def test_a_changed_gait_is_taken_up(self, robot: Robot) -> None:
        _hold(robot, GAIT, 0.4)
        _hold(robot, GAIT.scaled(-1.0), 0.7)

        assert robot.motors.state().frequency_hz == pytest.approx(GAIT.scaled(-1.0).frequency_hz, abs=0.2)

    def test_a_command_expires(self, robot: Robot) -> None:
        _hold(robot, GAIT, 0.2)

        robot.motors.drive(GAIT, 0.15)
        robot.clock.sleep(0.15 + 0.6)

        assert robot.motors.state().frequency_hz == pytest.approx(REST.frequency_hz, abs=0.5)

    def test_motors_stop_and_a_second_stop_does_no_harm(self, robot: Robot) -> None:
        _hold(robot, GAIT, 0.2)

        robot.motors.stop()
        robot.motors.stop()
        robot.clock.sleep(0.6)

        assert robot.motors.state().frequency_hz == pytest.approx(REST.frequency_hz, abs=0.5)

    def test_motors_start_again_after_a_stop(self, robot: Robot) -> None:
        _hold(robot, GAIT, 0.2)
        robot.motors.stop()
        robot.clock.sleep(0.2)

        _hold(robot, GAIT, 0.6)

        assert robot.motors.state().frequency_hz == pytest.approx(GAIT.frequency_hz, abs=0.2)

    def test_a_gait_for_other_motors_is_refused(self, robot: Robot) -> None:
        with pytest.raises(ValueError, match="2 frequencies given, but the robot has 3 motors"):
            robot.motors.drive(Gait((5.0, 5.0)), 0.25)

    def test_what_the_motors_cannot_set_is_refused(self, robot: Robot) -> None:
        gaits = {
            Quantity.PHASE: Gait((5.0, 5.0, 5.0), phase_rad=(0.0, 1.0, 0.0)),
            Quantity.AMPLITUDE: Gait((5.0, 5.0, 5.0), amplitude=(1.0, 0.5, 1.0)),
        }

        for quantity, gait in gaits.items():
            if quantity in robot.motors.quantities:
                robot.motors.drive(gait, 0.25)
            else:
                with pytest.raises(ValueError, match="cannot set"):
                    robot.motors.drive(gait, 0.25)

    def test_news_of_the_motors_is_on_the_robots_clock(self, robot: Robot) -> None:
        _hold(robot, GAIT, 0.2)

        assert robot.clock.now_s() - 0.3 <= robot.motors.state().t_s <= robot.clock.now_s() + 0.01

    def test_poses_are_finite_and_on_the_robots_clock(self, robot: Robot) -> None:
        first = robot.tracker.pose()
        _hold(robot, GAIT, 0.2)
        last = robot.tracker.pose()

        assert first.is_finite and last.is_finite
        assert len(last.markers_m) in (0, 6, 12)
        assert robot.clock.now_s() - 0.3 <= last.t_s <= robot.clock.now_s() + 0.01
        assert last.t_s > first.t_s

    def test_sleeping_takes_its_time(self, robot: Robot) -> None:
        robot.clock.sleep(0.01)
        before_s = robot.clock.now_s()

        robot.clock.sleep(0.1)

        assert robot.clock.now_s() - before_s >= 0.05  # a sleep makes up for the lateness of the one before

    def test_closing_stops_the_motors_and_can_be_done_twice(self, source: Any) -> None:
        robot = self.open_robot(source)
        _hold(robot, GAIT, 0.2)

        robot.close()
        robot.close()

        if isinstance(source, MockProcess):
            source.wait_until(lambda status: status.is_at_rest, timeout_s=0.5)

    def test_a_trial_moves_the_robot_and_records_what_was_applied(self, robot: Robot) -> None:
        trial = run_trial(robot, Gait((16.0, -15.0, 14.0)), TrialSettings(duration_s=0.7, heading_limit_rad=None))

        assert trial.outcome is Outcome.COMPLETED
        assert trial.duration_s == pytest.approx(0.7, abs=0.06)
        assert trial.states[-1].frequency_hz == pytest.approx((16.0, -15.0, 14.0), abs=0.3)
        assert max(math.dist(pose.position_m, trial.poses[0].position_m) for pose in trial.poses) > 0.0005
