"""What the tracker sees of a motor, on a computer that does other things as well. A qik in a process of its own."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from vvvaltr.controller.core.errors import DeviceTimeout, TrackingLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Tracker
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.robot.commissioning.vibration import find_peak, measure_spectrum, record_poses
from vvvaltr.controller.robot.hardware import HardwareRobot, open_hardware
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.mocking.process import MockProcess

GAIT = Gait((0.0, 12.0, 0.0))
SETTLE_S, LOOK_S = 1.2, 0.8


@pytest.fixture(scope="module")
def robot(qik: MockProcess) -> Iterator[HardwareRobot]:
    file = load_robot_file(Path(qik.greeting.robot_file))
    patient = replace(file, tracker=replace(file.tracker, age_limit_s=1.0))  # gaps are what is tested
    with closing(open_hardware(patient)) as robot:
        yield robot


class Sleepy:
    """A tracker that keeps the program waiting at some of its looks."""

    def __init__(self, tracker: Tracker, wait_s: float, looks: frozenset[int] | None) -> None:
        self._tracker, self._wait_s, self._looks = tracker, wait_s, looks
        self.asked = 0

    def pose(self) -> Pose:
        self.asked += 1
        if self._looks is None or self.asked in self._looks:
            time.sleep(self._wait_s)
        return self._tracker.pose()


def seen_hz(poses: list[Pose]) -> float:
    return find_peak(measure_spectrum(poses), 2.0, 25.0).frequency_hz


def test_a_look_during_which_the_program_was_held_up_is_made_again(robot: HardwareRobot) -> None:
    begin_s = time.monotonic()
    tracker = Sleepy(robot.tracker, 0.3, frozenset({30}))

    poses = record_poses(robot.motors, tracker, GAIT, SETTLE_S, LOOK_S)

    assert time.monotonic() - begin_s > 2.0 * (SETTLE_S + LOOK_S)
    assert np.diff([pose.t_s for pose in poses]).max() < 0.1
    assert seen_hz(poses) == pytest.approx(12.0, abs=0.5)


def test_where_nothing_moves_there_is_no_vibration() -> None:
    still = [Pose(0.02 * number, (0.1, 0.2, 0.037), 0.3) for number in range(80)]

    assert find_peak(measure_spectrum(still), 2.0, 25.0).clarity == 0.0


def test_a_look_in_which_the_tracker_paused_is_made_again(robot: HardwareRobot, qik: MockProcess) -> None:
    begin_s = time.monotonic()
    pauses = (
        threading.Timer(SETTLE_S + LOOK_S / 2.0, qik.process.send_signal, [signal.SIGSTOP]),
        threading.Timer(SETTLE_S + LOOK_S / 2.0 + 0.12, qik.process.send_signal, [signal.SIGCONT]),
    )
    for pause in pauses:
        pause.start()

    poses = record_poses(robot.motors, robot.tracker, GAIT, SETTLE_S, LOOK_S)

    assert time.monotonic() - begin_s > 2.0 * (SETTLE_S + LOOK_S)
    assert np.diff([pose.t_s for pose in poses]).max() < 0.1
    assert seen_hz(poses) == pytest.approx(12.0, abs=0.5)


def test_a_computer_that_is_held_up_again_and_again_is_told_of(robot: HardwareRobot, qik: MockProcess) -> None:
    tracker = Sleepy(robot.tracker, 0.15, None)

    with pytest.raises(
        DeviceTimeout, match=r"this computer was held up for 0\.\d+ s, again and again; end other programs"
    ):
        record_poses(robot.motors, tracker, GAIT, SETTLE_S, 0.4)

    assert qik.wait_until(lambda status: True).is_at_rest


def test_a_tracker_whose_poses_always_have_gaps_is_told_of(robot: HardwareRobot) -> None:
    class Gappy:
        """Shows what it saw last instead of the present, for 0.1 s of every 0.25 s."""

        def __init__(self) -> None:
            self._last = robot.tracker.pose()

        def pose(self) -> Pose:
            pose = robot.tracker.pose()
            if time.monotonic() % 0.25 > 0.1:
                self._last = pose
            return self._last

    with pytest.raises(TrackingLost, match=r"gaps of \d+\.\d+ s, too long for a spectrum"):
        record_poses(robot.motors, Gappy(), GAIT, SETTLE_S, 0.6)
