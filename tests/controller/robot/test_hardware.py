"""One robot on two lines: a qik and an ODrive bus, each a device in a process of its own."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from vvvaltr.controller.core.errors import DeviceFault, LinkLost, TrackingLost, UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.safety import GuardedRobot
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.choice import RobotChoice
from vvvaltr.controller.robot.commissioning.calibrate import Reading, fit_curve, replace_curves
from vvvaltr.controller.robot.commissioning.vibration import record_states
from vvvaltr.controller.robot.hardware import HardwareRobot, open_hardware, open_motors
from vvvaltr.controller.robot.opening import open_rig
from vvvaltr.controller.robot.robot_file import RobotFile, load_robot_file
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.process import MockProcess
from vvvaltr.drivers.table import Points

GAIT = Gait((6.0, -11.5, 16.5, 5.0, -7.0, 9.0))


@pytest.fixture
def robot_file(qik: MockProcess, odrive: MockProcess) -> RobotFile:
    first, second = (load_robot_file(Path(mock.greeting.robot_file)) for mock in (qik, odrive))
    return msgspec.structs.replace(first, line=(*first.line, *second.line))


@pytest.fixture
def robot(robot_file: RobotFile) -> Iterator[HardwareRobot]:
    with closing(open_hardware(robot_file)) as robot:
        yield robot


def hold(robot: HardwareRobot, gait: Gait, duration_s: float) -> None:
    end_s = time.monotonic() + duration_s
    while time.monotonic() < end_s:
        robot.motors.drive(gait, 0.25)
        time.sleep(0.02)
        robot.motors.state()


def test_motors_of_two_lines_have_one_order(qik: MockProcess, odrive: MockProcess, robot: HardwareRobot) -> None:
    hold(robot, GAIT, 0.4)

    assert robot.motors.state().frequency_hz == pytest.approx(GAIT.frequency_hz, abs=0.1)
    assert not robot.motors.state().measured
    assert qik.wait_until(lambda status: True).applied_hz == pytest.approx(GAIT.frequency_hz[:3], abs=0.1)
    assert odrive.wait_until(lambda status: True).applied_hz == pytest.approx(GAIT.frequency_hz[3:])


def test_a_gait_that_one_line_cannot_apply_is_sent_to_none(
    qik: MockProcess, odrive: MockProcess, robot_file: RobotFile
) -> None:
    backwards = msgspec.structs.replace(robot_file, line=robot_file.line[::-1])
    with (
        closing(open_hardware(backwards)) as robot,
        pytest.raises(ValueError, match="motor 3 of the line: 99 Hz is beyond"),
    ):
        robot.motors.drive(Gait((5.0, 5.0, 5.0, 6.0, 6.0, 99.0)), 0.25)

    time.sleep(0.1)
    assert qik.wait_until(lambda status: True).is_at_rest
    assert odrive.wait_until(lambda status: True).is_at_rest


def test_a_fault_on_one_line_stops_all_motors_and_the_next_trial_runs(
    qik: MockProcess, odrive: MockProcess, robot: HardwareRobot
) -> None:
    hold(robot, GAIT, 0.2)
    odrive.inject(Fault(kind=Kind.UNPLUG, at_s=0.0, duration_s=0.5))

    with pytest.raises(LinkLost):
        hold(robot, GAIT, 1.0)
    with pytest.raises(LinkLost):
        robot.motors.stop()

    qik.wait_until(lambda status: status.is_at_rest, timeout_s=0.5)
    odrive.wait_until(lambda status: status.is_at_rest, timeout_s=0.5)
    trial = run_trial(robot, GAIT, TrialSettings(duration_s=0.4, heading_limit_rad=None))
    assert trial.outcome is Outcome.COMPLETED


def test_a_curve_corrects_what_a_motor_with_a_sensor_is_asked_for(odrive: MockProcess) -> None:
    robot_file = load_robot_file(Path(odrive.greeting.robot_file))
    line = robot_file.line[0]
    motors = tuple(msgspec.structs.replace(motor, curve=((2.0, 1.0), (16.0, 8.0)), max_hz=8.0) for motor in line.motor)
    robot_file = msgspec.structs.replace(robot_file, line=(msgspec.structs.replace(line, motor=motors),), search=None)

    with closing(open_hardware(robot_file)) as robot:
        hold(robot, Gait((4.0, -4.0, 0.5)), 0.3)
        applied_hz = odrive.wait_until(lambda status: not status.is_at_rest).applied_hz

    assert applied_hz == pytest.approx((8.0, -8.0, 0.0))


@pytest.mark.parametrize("share", [0.998, 0.9937, 1.02], ids=lambda share: f"{share:g} of what is asked")
def test_a_calibrated_axis_turns_at_its_greatest_frequency_both_ways_and_no_faster(
    odrive: MockProcess, share: float
) -> None:
    bare = load_robot_file(Path(odrive.greeting.robot_file))
    seen = [Reading(0, command, share * command) for command in (16.5, 13.6, 10.7, 7.8, 4.9, 1.98)]
    calibrated = replace_curves(bare, [fit_curve(seen, ())] * 3)
    greatest_hz = calibrated.limits.max_hz[0]

    with closing(open_hardware(calibrated)) as robot:
        hold(robot, Gait((greatest_hz, -greatest_hz, 0.0)), 0.3)
        applied_hz = odrive.wait_until(lambda status: not status.is_at_rest).applied_hz
        with pytest.raises(ValueError, match="outside its limits"):
            GuardedRobot(robot, calibrated.limits).motors.drive(Gait((0.0, greatest_hz + 0.01, 0.0)), 0.25)

    assert applied_hz == pytest.approx((greatest_hz / share, -greatest_hz / share, 0.0), abs=1e-3)


def with_ramp(robot_file: RobotFile, ramp_hz_s: float) -> RobotFile:
    line = robot_file.line[0]
    motors = tuple(msgspec.structs.replace(motor, ramp_hz_s=ramp_hz_s) for motor in line.motor)
    return msgspec.structs.replace(robot_file, line=(msgspec.structs.replace(line, motor=motors),))


def test_a_ramp_in_the_file_slows_the_start(odrive: MockProcess) -> None:
    with closing(open_hardware(with_ramp(load_robot_file(Path(odrive.greeting.robot_file)), 20.0))) as robot:
        begun_s = time.monotonic()
        hold(robot, Gait((10.0, 10.0, 10.0)), 0.7)

    rising = [status for status in odrive.statuses if begun_s < status.t_s < begun_s + 0.5]
    assert all(status.applied_hz[0] <= 20.0 * (status.t_s - begun_s) + 0.5 for status in rising)


def test_a_motor_that_starts_slowly_is_measured_once_its_ramp_is_over(odrive: MockProcess) -> None:
    with closing(open_hardware(with_ramp(load_robot_file(Path(odrive.greeting.robot_file)), 15.0))) as robot:
        states = record_states(robot.motors, Gait((0.0, 12.0, 0.0)), settle_s=0.3, duration_s=0.1)

    assert [state.frequency_hz[1] for state in states] == pytest.approx([12.0] * len(states), abs=0.5)


def test_without_a_tracker_the_robot_does_not_open(robot_file: RobotFile) -> None:
    elsewhere = msgspec.structs.replace(robot_file, tracker=msgspec.structs.replace(robot_file.tracker, port=0))

    with pytest.raises(TrackingLost, match="start the tracker and let it send there"):
        open_hardware(elsewhere)


def test_a_motor_without_a_sensor_wants_a_curve(qik: MockProcess) -> None:
    robot_file = load_robot_file(Path(qik.greeting.robot_file))
    line = robot_file.line[0]
    motors = tuple(msgspec.structs.replace(motor, curve=()) for motor in line.motor)
    robot_file = msgspec.structs.replace(robot_file, line=(msgspec.structs.replace(line, motor=motors),))

    with pytest.raises(UserError, match="has no curve; run vvvaltr calibrate first"):
        open_hardware(robot_file)


def test_learning_gets_limits_search_and_trials_from_the_file(qik: MockProcess) -> None:
    robot_file = load_robot_file(Path(qik.greeting.robot_file))
    choice = RobotChoice(name=qik.greeting.robot_file, file=msgspec.to_builtins(robot_file))

    rig = open_rig(choice, seed=0)
    with closing(rig.robot), pytest.raises(ValueError, match="outside its limits"):
        rig.robot.motors.drive(Gait((17.0, 0.0, 0.0)), 0.25)

    assert rig.range_hz == (4.0, 16.0)
    assert rig.settings.period_s == 0.04


@pytest.fixture(scope="module")
def node(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess("node", tmp_path_factory.mktemp("node") / "port") as mock:
        yield mock


def test_a_node_with_other_motors_than_the_file_is_refused(node: MockProcess) -> None:
    line = load_robot_file(Path(node.greeting.robot_file)).line[0]

    with pytest.raises(DeviceFault, match="the node has 3 motors, the robot's file has 2"):
        open_motors(msgspec.structs.replace(line, motor=line.motor[:2]))


@pytest.mark.parametrize(
    ("max_hz", "curve"), [(20.0, ()), (16.0, ((2.0, 1.6), (20.0, 16.0)))], ids=["as it is", "through its curve"]
)
def test_a_node_that_turns_slower_than_the_file_allows_is_refused_when_it_is_opened(
    node: MockProcess, max_hz: float, curve: Points
) -> None:
    line = load_robot_file(Path(node.greeting.robot_file)).line[0]
    eager = msgspec.structs.replace(line.motor[1], max_hz=max_hz, curve=curve)
    eager_line = msgspec.structs.replace(line, motor=(line.motor[0], eager, line.motor[2]))

    complaint = r"motor 2 of the line: the robot's file allows 20 Hz, the node's firmware 16\.5 Hz; lower max_hz"
    with pytest.raises(DeviceFault, match=complaint) as caught:
        open_motors(eager_line)

    assert caught.value.code == "max_hz"
    open_motors(line).close()
