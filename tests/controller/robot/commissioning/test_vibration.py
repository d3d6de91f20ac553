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


def noisy(seed: int, duration_s: float, shaking_m: float = 0.0, markers: int = 0) -> list[Pose]:
    """Return poses as of a camera: 30 a second, with a noise of 0.2 mm, of a robot that shakes at 11.7 Hz."""
    rng = np.random.default_rng(seed)
    poses = []
    for t_s in np.arange(0.0, duration_s, 1.0 / 30.0):
        x_m, y_m, yaw_rad = rng.normal(0.0, 2e-4, 3)
        x_m += shaking_m * np.sin(2.0 * np.pi * 11.7 * t_s)
        around = tuple((x_m + d_m, y_m, 0.04) for d_m in 2e-4 * rng.normal(size=markers))
        poses.append(Pose(float(t_s), (x_m, y_m, 0.04), yaw_rad, markers_m=around))
    return poses


@pytest.mark.parametrize("markers", [0, 10])
def test_noise_alone_is_seldom_a_vibration_however_few_coordinates_scatter(markers: int) -> None:
    looks = [find_peak(measure_spectrum(noisy(seed, 1.7, markers=markers)), 7.0, 16.4) for seed in range(60)]

    assert sum(peak.is_clear for peak in looks) <= 4


def test_a_vibration_as_faint_as_the_noise_is_found_by_a_longer_look() -> None:
    looks = [find_peak(measure_spectrum(noisy(seed, 6.8, 2e-4)), 7.0, 16.4) for seed in range(20)]

    assert all(peak.is_clear and peak.frequency_hz == pytest.approx(11.7, abs=0.1) for peak in looks)
    assert all(5e-5 < peak.least_m < 2e-4 for peak in looks)


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
