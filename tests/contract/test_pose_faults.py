"""What a tracker shows wrongly is dropped or loses the trial, with the reason and its cure: never a number."""

import math
import re
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.hardware import HardwareRobot, open_hardware
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.process import MockProcess

GAIT = Gait((12.0, -14.0, 9.0))
SETTINGS = TrialSettings(duration_s=1.0)
BEFORE_S, DURING_S = 0.0, 0.8  # the drive begins 0.3 s after the trial
LONG_S, SHORT_S = 2.5, 0.03
NEAR_M = 0.004

pytestmark = pytest.mark.flaky(reruns=2)  # in real time


@pytest.fixture(scope="module")
def mock(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess("node", tmp_path_factory.mktemp("mock") / "port") as mock:
        yield mock


@pytest.fixture
def robot(mock: MockProcess) -> Iterator[HardwareRobot]:
    with closing(open_hardware(load_robot_file(Path(mock.greeting.robot_file)))) as robot:
        yield robot


@contextmanager
def fault_after(mock: MockProcess, delay_s: float, fault: Fault) -> Iterator[None]:
    """Let a fault happen after a while, and wait until it is over."""
    began_s = time.monotonic()
    timer = threading.Timer(delay_s, mock.inject, (fault,))
    timer.start()
    try:
        yield
    finally:
        timer.join()
        time.sleep(max(0.0, began_s + delay_s + fault.duration_s + 0.2 - time.monotonic()))


def place_m(mock: MockProcess) -> tuple[float, float]:
    """Return where the robot truly is."""
    place = mock.wait_until(lambda status: status.place_m is not None).place_m
    assert place is not None
    return place[:2]


@pytest.mark.parametrize(
    ("kind", "delay_s", "reason"),
    [
        (Kind.JUMP, DURING_S, r"jumped by 0\.[45]\d* m .*one body alone"),
        (Kind.UNIT, BEFORE_S, 'set unit = "mm"'),
        (Kind.UNIT, DURING_S, 'set unit = "mm"'),
        (Kind.SECOND_BODY, BEFORE_S, "robot alone|one body alone"),
        (Kind.SECOND_BODY, DURING_S, "robot alone|one body alone"),
        (Kind.FREEZE, BEFORE_S, "to the last digit .*show the robot to the tracker"),
        (Kind.FREEZE, DURING_S, "to the last digit .*show the robot to the tracker"),
        (Kind.FREEZE, DURING_S + 0.3, "to the last digit .*show the robot to the tracker"),
        (Kind.ORIGIN, BEFORE_S, "to the last digit.*show the robot to the tracker"),
        (Kind.ORIGIN, DURING_S, "to the last digit.*show the robot to the tracker"),
        (Kind.BLIND, DURING_S, "does not see the robot"),
    ],
)
def test_what_persists_loses_the_trial_with_reason_and_cure(
    mock: MockProcess, robot: HardwareRobot, kind: Kind, delay_s: float, reason: str
) -> None:
    with fault_after(mock, delay_s, Fault(kind=kind, at_s=0.0, duration_s=LONG_S)):
        trial = run_trial(robot, GAIT, SETTINGS)

    assert trial.outcome is Outcome.TRACKING_LOST
    assert re.search(reason, trial.reason)


@pytest.mark.parametrize("kind", [Kind.JUMP, Kind.UNIT, Kind.ORIGIN])
@pytest.mark.parametrize("delay_s", [BEFORE_S + 0.1, DURING_S, DURING_S + 0.9])
def test_outliers_now_and_then_are_dropped_and_the_score_is_that_of_the_robot(
    mock: MockProcess, robot: HardwareRobot, kind: Kind, delay_s: float
) -> None:
    start_m = place_m(mock)
    with fault_after(mock, delay_s, Fault(kind=kind, at_s=0.0, duration_s=SHORT_S)):
        trial = run_trial(robot, GAIT, SETTINGS)

    assert trial.outcome is Outcome.COMPLETED
    assert score(trial) * trial.duration_s == pytest.approx(math.dist(start_m, place_m(mock)), abs=NEAR_M)


@pytest.mark.parametrize("step_s", [-3600.0, -0.5, -0.19, -0.16, -0.05, 0.19, 3600.0])
def test_a_trackers_clock_that_is_set_costs_one_trial_at_most(
    mock: MockProcess, robot: HardwareRobot, step_s: float
) -> None:
    start_m = place_m(mock)
    with fault_after(mock, DURING_S, Fault(kind=Kind.CLOCK_STEP, at_s=0.0, duration_s=LONG_S, step_s=step_s)):
        trials = [run_trial(robot, GAIT, SETTINGS), run_trial(robot, GAIT, SETTINGS)]

    assert sum(trial.outcome is not Outcome.COMPLETED for trial in trials) <= 1
    if all(trial.outcome is Outcome.COMPLETED for trial in trials):
        walked_m = sum(score(trial) * trial.duration_s for trial in trials)
        assert walked_m == pytest.approx(math.dist(start_m, place_m(mock)), abs=2.0 * NEAR_M)
