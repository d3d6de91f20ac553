"""A pause that gets long lets go of the motors' lines, on each device, and takes them up again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.robot.hardware import open_motors
from vvvaltr.controller.robot.opening import Rig, choose_robot, open_rig
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.process import MockProcess

GAIT = Gait((9.0, -11.0, 6.0))


@pytest.fixture(scope="module", params=["qik", "odrive", "node", "struts"])
def mock(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess(request.param, tmp_path_factory.mktemp("mock") / "port") as running:
        yield running


@pytest.fixture
def rig(mock: MockProcess) -> Iterator[Rig]:
    rig = open_rig(choose_robot({"name": mock.greeting.robot_file}), seed=0)
    with closing(rig.robot):
        yield rig


def drive(rig: Rig, mock: MockProcess) -> None:
    for _ in range(6):
        rig.robot.motors.drive(GAIT, 0.25)
        rig.robot.clock.sleep(0.05)
    assert mock.wait_until(lambda it: all(it.applied_hz))


def test_a_parked_robot_rests_with_its_lines_free_until_the_next_trial(rig: Rig, mock: MockProcess) -> None:
    drive(rig, mock)

    rig.robot.park()
    rig.robot.park()

    assert mock.wait_until(lambda it: it.is_at_rest)
    (line,) = load_robot_file(Path(mock.greeting.robot_file)).line
    with closing(open_motors(line)) as another:  # the line is free, and the device answers whoever opens it
        another.state()
    rig.robot.place(2)
    drive(rig, mock)
    rig.robot.motors.stop()
    assert mock.wait_until(lambda it: it.is_at_rest)


def test_a_run_that_pauses_because_its_device_is_gone_does_not_end_by_parking(rig: Rig, mock: MockProcess) -> None:
    drive(rig, mock)
    mock.inject(Fault(Kind.UNPLUG, at_s=0.0, duration_s=0.4))
    assert mock.wait_until(lambda it: it.is_at_rest)

    rig.robot.park()

    rig.robot.place(2)
    drive(rig, mock)
    rig.robot.motors.stop()
