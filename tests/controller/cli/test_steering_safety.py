"""`go` and `jog` on devices in real time: whatever happens, the motors are soon at rest."""

import json
import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from gliding import TABLE, GlidingRobot, tried

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.values import Outcome, Suggestion
from vvvaltr.controller.robot.opening import choose_robot, open_rig
from vvvaltr.controller.runs.log import read_run
from vvvaltr.controller.studies.steering_run import SteeringRun, steering_config
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.process import MockProcess

VVVALTR = (sys.executable, "-c", "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main())")
ENDINGS = {"qik": signal.SIGTSTP, "node": signal.SIGTERM, "odrive": signal.SIGHUP}
WATCHDOG_S = 0.5  # more than any device's, and than a busy machine needs to tell of it


@pytest.fixture(scope="module")
def moves(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a repertoire whose gaits every mock can drive."""
    path = tmp_path_factory.mktemp("runs") / "moves"
    table = {Gait((gait.frequency_hz[0], -9.0, 12.0)): velocity for gait, velocity in TABLE.items()}
    rig = open_rig(choose_robot({"name": "planar"}), 0)
    with closing(rig.robot):
        config = steering_config(choose_robot({"name": "planar"}), rig, "repertoire", 0, 10, 5.0)
    with closing(SteeringRun.create(path, config, Run())) as run:
        for trial in tried(GlidingRobot(table), 2):
            run.record(LoggedTrial(Suggestion(trial.gait, "tried"), trial, None, None))
    return path


@pytest.fixture(scope="module", params=list(ENDINGS))
def mock(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess(request.param, tmp_path_factory.mktemp(request.param) / "port", "--robot", "spatial") as mock:
        yield mock


@pytest.fixture
def ending(request: pytest.FixtureRequest) -> signal.Signals:
    """Return a signal, another one for each device."""
    return ENDINGS[request.node.callspec.params["mock"]]


@contextmanager
def going(mock: MockProcess, moves: Path, out: Path, *more: str) -> Iterator[subprocess.Popen[str]]:
    """Start ``go`` to a place far away; yields once the motors turn."""
    robot = ("--robot", mock.greeting.robot_file, "--repertoire", str(moves), "--out", str(out), "--json")
    command: Sequence[str] = [*VVVALTR, "go", "2", "1", *robot, *more]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        try:
            mock.wait_until(lambda status: not status.is_at_rest, timeout_s=30.0)
            yield program
        finally:
            program.kill()


@contextmanager
def jogging(mock: MockProcess, moves: Path, out: Path) -> Iterator[tuple[subprocess.Popen[bytes], Callable[[], None]]]:
    """Start ``jog`` at a terminal and hold a key; yields the program, and what holds on, once the motors turn."""
    master, terminal = pty.openpty()
    robot = ("--robot", mock.greeting.robot_file, "--repertoire", str(moves), "--out", str(out))
    command = [*VVVALTR, "jog", *robot]
    with subprocess.Popen(command, stdin=terminal, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as program:
        os.close(terminal)
        assert program.stderr is not None
        assert b"arrow keys" in program.stderr.readline()

        def hold() -> None:
            os.write(master, b"\x1b[A")

        try:
            _hold_until(hold, lambda: mock.wait_until(lambda status: not status.is_at_rest, timeout_s=0.1))
            yield program, hold
        finally:
            program.kill()
            program.stderr.read()
    os.close(master)


def _hold_until(hold: Callable[[], None], has_come: Callable[[], object]) -> None:
    for _ in range(100):
        hold()
        try:
            has_come()
            return
        except TimeoutError:
            continue
    raise TimeoutError("the motors never turned")


def rests_soon(mock: MockProcess, timeout_s: float = WATCHDOG_S) -> bool:
    return mock.wait_until(lambda status: status.is_at_rest, timeout_s).is_at_rest


def test_a_killed_go_leaves_the_motors_to_the_watchdog(mock: MockProcess, moves: Path, tmp_path: Path) -> None:
    with going(mock, moves, tmp_path / "g") as program:
        program.send_signal(signal.SIGKILL)

        assert rests_soon(mock)


def test_an_interrupted_go_stops_the_motors_and_says_how_to_go_on(
    mock: MockProcess, moves: Path, tmp_path: Path, ending: signal.Signals
) -> None:
    with going(mock, moves, tmp_path / "g") as program:
        program.send_signal(ending)

        assert rests_soon(mock)
        _, err = program.communicate(timeout=20)

    assert program.returncode == 130
    assert f"--resume {tmp_path / 'g'}" in err.splitlines()[-1]
    assert read_run(tmp_path / "g").trials[-1].trial.outcome is Outcome.INTERRUPTED


@pytest.mark.parametrize(("fault", "outcome"), [(Kind.BLIND, Outcome.TRACKING_LOST), (Kind.UNPLUG, Outcome.LINK_LOST)])
def test_what_is_lost_on_the_way_stops_the_motors_and_is_waited_for(
    mock: MockProcess, moves: Path, tmp_path: Path, fault: Kind, outcome: Outcome
) -> None:
    with going(mock, moves, tmp_path / "g") as program:
        mock.inject(Fault(kind=fault, at_s=0.0, duration_s=0.6))

        assert rests_soon(mock)
        mock.wait_until(lambda status: not status.is_at_rest, timeout_s=20.0)
        program.send_signal(signal.SIGINT)
        program.communicate(timeout=20)

    outcomes = [logged.trial.outcome for logged in read_run(tmp_path / "g").trials]
    assert outcome in outcomes
    assert outcomes[-1] is Outcome.INTERRUPTED


def test_a_device_with_a_flat_battery_ends_the_way(moves: Path, tmp_path: Path) -> None:
    with (
        MockProcess("odrive", tmp_path / "port", "--robot", "spatial") as mock,
        going(mock, moves, tmp_path / "g") as program,
    ):
        mock.inject(Fault(kind=Kind.ERROR, at_s=0.0, duration_s=1.0))  # of the supply's voltage

        assert rests_soon(mock)
        out, _ = program.communicate(timeout=20)

    assert program.returncode == 1
    assert json.loads(out)["reason"].startswith("battery: ")


def test_a_key_that_is_let_go_stops_the_motors(mock: MockProcess, moves: Path, tmp_path: Path) -> None:
    with jogging(mock, moves, tmp_path / "j"):
        assert rests_soon(mock, timeout_s=1.2)


def test_a_killed_jog_leaves_the_motors_to_the_watchdog(mock: MockProcess, moves: Path, tmp_path: Path) -> None:
    with jogging(mock, moves, tmp_path / "j") as (program, hold):
        hold()
        program.send_signal(signal.SIGKILL)

        assert rests_soon(mock)


@pytest.mark.parametrize("fault", [Kind.BLIND, Kind.UNPLUG])
def test_what_is_lost_while_a_key_is_held_stops_the_motors(
    mock: MockProcess, moves: Path, tmp_path: Path, fault: Kind
) -> None:
    with jogging(mock, moves, tmp_path / "j") as (_, hold):
        mock.inject(Fault(kind=fault, at_s=0.0, duration_s=0.8))
        begin_s = time.monotonic()
        while time.monotonic() - begin_s < 0.4:
            hold()
            time.sleep(0.03)

        assert rests_soon(mock)


def test_a_jog_whose_terminal_is_gone_ends(mock: MockProcess, moves: Path, tmp_path: Path) -> None:
    with jogging(mock, moves, tmp_path / "j") as (program, _):
        program.send_signal(signal.SIGHUP)

        assert rests_soon(mock)
        assert program.wait(20) == 130
