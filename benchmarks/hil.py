"""Hardware in the loop: latency of commands, gaps between commands, and time to rest after every kind of failure.

python -m benchmarks.hil --json
"""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.figures import make_parser
from benchmarks.observed import ObservedDevice
from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.protocols import Clock, MotorDriver, Tracker
from vvvaltr.controller.core.values import Pose, Structure
from vvvaltr.controller.loop.trial_runner import TrialCrashed, TrialSettings, run_trial
from vvvaltr.controller.robot.hardware import HardwareRobot, open_hardware
from vvvaltr.controller.robot.mock import DEVICES
from vvvaltr.controller.robot.robot_file import TrialTable, load_robot_file
from vvvaltr.drivers.mocking.faults import Fault, Kind

ON = Gait((9.0, -12.0, 15.0))
_VVVALTR = "from vvvaltr.entry import main; main()"
_CONTROLLER = """
import sys, time
from pathlib import Path
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.controller.robot.hardware import open_hardware
from vvvaltr.controller.core.signals import interrupt_on_signals
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.core.gaits import Gait
interrupt_on_signals()
robot = open_hardware(load_robot_file(Path(sys.argv[1])))
try:
    run_trial(robot, Gait((9.0, -12.0, 15.0)), TrialSettings(duration_s=60.0, heading_limit_rad=None))
finally:
    robot.close()
"""


@dataclass(frozen=True, slots=True)
class Counts:
    """Numbers of measurements.

    Args:
        commands: starts and stops of each device.
        repeats: repeats of each way to end.
    """

    commands: int
    repeats: int


def measure_latencies_ms(
    observed: ObservedDevice, robot: HardwareRobot, count: int, is_one_message: bool
) -> tuple[list[float], list[float]]:
    """Return the latencies from each command until all motors were on, and from each stop until all were off.

    Where one message commands all motors, the first motor that is on shows that it has arrived: a closed loop may hold
    another motor's output at 0 for a moment while that motor still runs down.
    """
    dice = random.Random(0)
    starts, stops = [], []
    for _ in range(count):
        observed.note()
        told_s = time.monotonic()
        robot.motors.drive(ON, 0.25)
        time.sleep(0.03 + 0.02 * dice.random())
        changes = [c for c in observed.note().changes if c.are_all_on or (is_one_message and not c.are_all_off)]
        starts += [change.t_s - told_s for change in changes[:1]]
        told_s = time.monotonic()
        robot.motors.stop()
        time.sleep(0.03 + 0.02 * dice.random())
        stops += [change.t_s - told_s for change in observed.note().changes if change.are_all_off]
    return [1000.0 * s for s in starts], [1000.0 * s for s in stops]


def measure_longest_gaps(
    observed: Sequence[ObservedDevice], robots: Sequence[HardwareRobot], duration_s: float
) -> dict[str, float]:
    """Return the longest time without a command to a device, while the learner computed its next trials.

    Beside it stands the longest time for which the machine did not run a device, though it has priority over the
    learner.
    """
    for robot in robots:
        robot.motors.drive(ON, duration_s + 10.0)
    time.sleep(0.1)
    for device in observed:
        device.note()
    _learn_until(time.monotonic() + duration_s)
    notes = [device.note() for device in observed]
    for robot in robots:
        robot.motors.state()  # raises a failure of the line
        robot.motors.stop()
    if any(note.changes or note.are_all_off for note in notes):
        raise RuntimeError("the motors did not run all the time")
    return {
        "set_point_longest_gap_ms": 1000.0 * max(note.longest_gap_s for note in notes),
        "device_longest_pause_ms": 1000.0 * max(note.longest_pause_s for note in notes),
        "set_point_duration_s": duration_s,
    }


def _learn_until(deadline_s: float) -> None:
    """Ask and tell without a pause, as the learner does between trials."""
    from vvvaltr.transfer.methods.plain_bo import PlainBO

    space = GaitSpace.over(3, 4.0, 16.0)
    dice = np.random.default_rng(0)
    while time.monotonic() < deadline_s:
        optimizer = PlainBO(space, seed=0)
        for _ in range(60):
            optimizer.tell(optimizer.ask().gait, float(dice.random()))
            if time.monotonic() > deadline_s:
                return


def rest_after_signal_ms(observed: ObservedDevice, number: signal.Signals) -> float:
    """Return how long the motors kept running after the controller received a signal in the middle of a trial."""
    command = [sys.executable, "-c", _CONTROLLER, str(observed.robot_file)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as controller:
        _wait_until_on(observed)
        time.sleep(0.5)
        sent_s = time.monotonic()
        os.kill(controller.pid, number)
        rested_s = observed.rested_s(2.0)
        controller.wait(10.0)
    return 1000.0 * (rested_s - sent_s)


def _wait_until_on(observed: ObservedDevice) -> None:
    deadline_s = time.monotonic() + 20.0
    while observed.note().are_all_off:
        if time.monotonic() > deadline_s:
            raise TimeoutError("the controller did not start the motors")
        time.sleep(0.02)


class Watched:
    """A tracker that records when the robot was lost, and can be made to raise another failure."""

    def __init__(self, robot: HardwareRobot, failure: Exception | None = None, after_s: float = 1.0) -> None:
        self._robot = robot
        self._failure = failure
        self._fails_s = time.monotonic() + after_s
        self._is_over = threading.Event()
        self.failed_s = 0.0
        self._thread = threading.Thread(target=self._watch)
        self._thread.start()

    def pose(self) -> Pose:
        """Return the pose, or raise the failure."""
        if self._failure is not None and time.monotonic() > self._fails_s:
            self.failed_s = time.monotonic()
            raise self._failure
        return self._robot.tracker.pose()

    def close(self) -> None:
        """Stop watching."""
        self._is_over.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._is_over.wait(0.001):
            try:
                self._robot.tracker.pose()
            except TrackingLost:
                self.failed_s = time.monotonic()
                return


@dataclass(frozen=True, slots=True)
class Substituted:
    """A robot with another tracker."""

    motors: MotorDriver
    clock: Clock
    tracker: Tracker
    structure: Structure | None = None

    def place(self, trial: int) -> None:
        """Do nothing: the robot stays where it is."""

    def carry_on(self, trial: int) -> None:
        """Is where it is."""

    def close(self) -> None:
        """Do nothing: the robot is closed where it was opened."""


def rest_after_ms(observed: ObservedDevice, robot: HardwareRobot, failure: Exception | None) -> float:
    """Return how long the motors kept running after a failure in the trial, or after the tracker lost the robot."""
    robot.place(1)
    observed.note()
    with closing(Watched(robot, failure)) as tracker, suppress(TrialCrashed):
        if failure is None:
            threading.Timer(1.0, observed.inject, (Fault(kind=Kind.BLIND, at_s=0.0, duration_s=0.4),)).start()
        run_trial(
            Substituted(robot.motors, robot.clock, tracker),
            ON,
            TrialSettings(duration_s=4.0, period_s=TrialTable().period_s, heading_limit_rad=None),
        )
    return 1000.0 * (observed.rested_s(2.0) - tracker.failed_s)


def rest_after_full_disk_ms(observed: ObservedDevice, directory: Path) -> float:
    """Return how long the motors kept running after learning ended on a full disk; 0 where they were off before."""
    command = [sys.executable, "-c", _VVVALTR, "learn", "--robot", str(observed.robot_file), "--trials", "9"]
    command += ["--duration", "1", "--out", str(directory / f"{observed.robot_file.stem}-run")]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, preexec_fn=_with_small_files) as learner:
        _wait_until_on(observed)
        if learner.wait(60.0) == 0:
            raise RuntimeError("the disk was never full")
        ended_s = time.monotonic()
    return 1000.0 * max(0.0, observed.rested_s(2.0) - ended_s)


def _with_small_files() -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(
        resource.RLIMIT_FSIZE, (90_000, 90_000)
    )  # more than the head of a log, less than the log of a trial or two


def measure_device(name: str, directory: Path, counts: Counts) -> dict[str, float]:
    """Return all figures of one device except the gaps."""
    figures: dict[str, float] = {}
    with ObservedDevice(name, directory / name) as observed:
        robot_file = load_robot_file(observed.robot_file)
        with closing(open_hardware(robot_file)) as robot:
            starts, stops = measure_latencies_ms(observed, robot, counts.commands, is_one_message=name == "node")
            figures |= _spread(f"{name}_command_to_applied", starts) | _spread(f"{name}_stop_to_rest", stops)
            for cause, failure in (("exception", RuntimeError()), ("enospc", OSError(28, "")), ("lost_tracker", None)):
                rests = [rest_after_ms(observed, robot, failure) for _ in range(counts.repeats)]
                figures[f"{name}_{cause}_to_rest_worst_ms"] = max(rests)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            rests = [rest_after_signal_ms(observed, number) for _ in range(counts.repeats)]
            figures[f"{name}_{number.name.lower()}_to_rest_worst_ms"] = max(rests)
        figures[f"{name}_full_disk_to_rest_worst_ms"] = rest_after_full_disk_ms(observed, directory)
    return figures


def measure_gaps(directory: Path, duration_s: float) -> dict[str, float]:
    """Return the longest gaps over all devices, driven by one process at the same time."""
    with ExitStack() as stack:
        observed = [stack.enter_context(ObservedDevice(name, directory / f"{name}-gap")) for name in DEVICES]
        files = [load_robot_file(device.robot_file) for device in observed]
        robots = [stack.enter_context(closing(open_hardware(robot_file))) for robot_file in files]
        return measure_longest_gaps(observed, robots, duration_s)


def _spread(name: str, values_ms: list[float]) -> dict[str, float]:
    p50, p99 = np.percentile(values_ms, [50, 99])
    return {f"{name}_p50_ms": float(p50), f"{name}_p99_ms": float(p99), f"{name}_worst_ms": max(values_ms)}


def _show(figures: dict[str, float]) -> dict[str, float]:
    for key, figure in figures.items():
        print(f"{key:44} {figure:8.2f}", flush=True)
    return figures


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument("--duration", type=float, default=600.0, help="seconds of steady set-points (default 600)")
    parser.add_argument("--commands", type=int, default=500, help="starts and stops of each device (default 500)")
    parser.add_argument("--repeats", type=int, default=5, help="repeats of each way to end (default 5)")
    arguments = parser.parse_args()
    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as directory:
        for name in DEVICES:
            figures |= _show(measure_device(name, Path(directory), Counts(arguments.commands, arguments.repeats)))
        figures |= _show(measure_gaps(Path(directory), arguments.duration))
    figures |= _show({"load_average_of_15_minutes": os.getloadavg()[2]})
    if arguments.json:
        print(json.dumps({key: round(figure, 3) for key, figure in figures.items()}))


if __name__ == "__main__":
    main()
