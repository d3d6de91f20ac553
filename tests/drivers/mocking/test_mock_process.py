"""`vvvaltr mock` as a process: what it prints, how it ends, what it leaves behind, what its fault scripts do."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import pairwise
from pathlib import Path

import pytest

from vvvaltr.controller.core.errors import DeviceError, NotUnderstood
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.hardware import open_hardware
from vvvaltr.controller.robot.mock import DEVICES, open_mock
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.links.serial import SerialLink
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.port import PtyPort
from vvvaltr.drivers.mocking.process import MockProcess

VVVALTR = (sys.executable, "-c", "from vvvaltr.entry import main; main()")
GAIT = Gait((9.0, -12.0, 15.0))
CONTROLLER = """
import sys
from pathlib import Path
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.controller.robot.hardware import open_hardware
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.core.gaits import Gait
robot = open_hardware(load_robot_file(Path(sys.argv[1])))
run_trial(robot, Gait((9.0, -12.0, 15.0)), TrialSettings(duration_s=30.0, heading_limit_rad=None))
"""


@pytest.fixture(scope="module", params=DEVICES)
def mock(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess(request.param, tmp_path_factory.mktemp(request.param) / "port") as mock:
        yield mock


@pytest.mark.parametrize("device", ["node", "odrive"])
def test_motors_are_as_fast_as_they_are_asked_to_be(tmp_path: Path, device: str) -> None:
    with MockProcess(device, tmp_path / "fast", "--max-hz", "50") as mock:
        file = load_robot_file(Path(mock.greeting.robot_file))
        with closing(open_hardware(file)) as robot:
            robot.motors.drive(Gait((50.0, -50.0, 30.0)), 5.0)
            reached = pytest.approx((50.0, -50.0, 30.0), abs=2.0)  # a node controls them
            assert mock.wait_until(lambda status: status.applied_hz == reached)

    assert file.search.high_hz == 50.0


def test_a_mock_whose_motors_end_where_they_do_says_so(tmp_path: Path) -> None:
    with pytest.raises(NotUnderstood, match="leave out --max-hz"):
        open_mock("qik", tmp_path / "slow", max_hz=50.0)


@contextmanager
def started(*arguments: str, cwd: Path) -> Iterator[subprocess.Popen[str]]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [*VVVALTR, "mock", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
        env=environment,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def test_it_says_where_it_is_and_twenty_times_a_second_what_it_does(mock: MockProcess) -> None:
    robot = load_robot_file(Path(mock.greeting.robot_file))
    time.sleep(0.5)
    statuses = mock.statuses[-10:]

    port = Path(mock.greeting.port)
    assert port.is_symlink() or port.is_socket()
    assert mock.greeting.tracker == f"127.0.0.1:{robot.tracker.port}"
    assert all(status.applied_hz == (0.0, 0.0, 0.0) and not status.faults for status in statuses)
    assert sum(after.t_s - before.t_s for before, after in pairwise(statuses)) / 9 == pytest.approx(0.05, abs=0.02)


def test_the_controllers_death_stops_the_motors(mock: MockProcess) -> None:
    command = [sys.executable, "-c", CONTROLLER, mock.greeting.robot_file]
    with subprocess.Popen(command) as controller:
        mock.wait_until(lambda status: all(status.applied_hz), timeout_s=20.0)
        time.sleep(0.3)
        controller.send_signal(signal.SIGKILL)
        killed_s = time.monotonic()

    at_rest = mock.wait_until(lambda status: status.is_at_rest, timeout_s=2.0)

    assert at_rest.t_s - killed_s < 0.3 + 0.05 + 0.1  # statuses are 0.05 s apart, and the machine may be busy
    assert at_rest.watchdog


@pytest.fixture
def ending(request: pytest.FixtureRequest) -> signal.Signals:
    """Return a signal, another one for each device."""
    place = DEVICES.index(request.node.callspec.params["mock"])
    return (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[place % 3]


def test_a_signal_that_ends_learning_stops_the_motors_at_once(
    mock: MockProcess, ending: signal.Signals, tmp_path: Path
) -> None:
    robot = ("--robot", mock.greeting.robot_file, "--duration", "20", "--out", str(tmp_path / "run"))
    with subprocess.Popen([*VVVALTR, "learn", *robot], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as learning:
        mock.wait_until(lambda status: not status.is_at_rest, timeout_s=20.0)
        learning.send_signal(ending)
        at_rest = mock.wait_until(lambda status: status.is_at_rest, timeout_s=2.0)
        _, told = learning.communicate()

    assert not at_rest.watchdog
    assert learning.returncode == 130
    assert b"the run is saved" in told


def test_a_lost_tracker_ends_the_trial_and_stops_the_motors(mock: MockProcess) -> None:
    with closing(open_hardware(load_robot_file(Path(mock.greeting.robot_file)))) as robot:
        robot.place(1)
        mock.inject(Fault(kind=Kind.BLIND, at_s=0.0, duration_s=1.0))
        robot.clock.sleep(0.1)
        trial = run_trial(robot, GAIT, TrialSettings(duration_s=0.5, heading_limit_rad=None))
        assert trial.outcome is Outcome.COMPLETED  # placing waits until the robot is seen again

        mock.inject(Fault(kind=Kind.BLIND, at_s=0.0, duration_s=0.5))
        lost = run_trial(Placed(robot), GAIT, TrialSettings(duration_s=2.0, settle_s=0.0, heading_limit_rad=None))

    assert lost.outcome is Outcome.TRACKING_LOST
    mock.wait_until(lambda status: status.is_at_rest, timeout_s=0.5)


class Placed:
    """A robot that is ready as it is."""

    def __init__(self, robot: object) -> None:
        self._robot = robot

    def __getattr__(self, name: str) -> object:
        return getattr(self._robot, name)

    def place(self, trial: int) -> None:
        pass


def test_unplugging_ends_the_trial_and_the_next_one_runs_on_the_new_line(mock: MockProcess) -> None:
    settings = TrialSettings(duration_s=0.6, heading_limit_rad=None)
    with closing(open_hardware(load_robot_file(Path(mock.greeting.robot_file)))) as robot:
        mock.inject(Fault(kind=Kind.UNPLUG, at_s=0.0, duration_s=1.5))
        lost = run_trial(robot, GAIT, settings)
        mock.wait_until(lambda status: status.is_at_rest, timeout_s=1.0)
        again = run_trial(robot, GAIT, settings)

    assert lost.outcome in (Outcome.LINK_LOST, Outcome.COMPLETED)
    assert again.outcome is Outcome.COMPLETED


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGQUIT, signal.SIGHUP])
def test_a_signal_ends_it_and_link_and_file_are_gone(tmp_path: Path, number: signal.Signals) -> None:
    with started("odrive", "--link", "axes", cwd=tmp_path) as process:
        assert process.stdout is not None
        greeting = json.loads(process.stdout.readline())
        assert greeting == {
            "port": str(tmp_path / "axes"),
            "robot_file": str(tmp_path / "axes.toml"),
            "tracker": greeting["tracker"],
        }
        process.send_signal(number)
        assert process.wait(20.0) == 0

    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_ends_it_in_a_shells_background_too(tmp_path: Path) -> None:
    script = f"{sys.executable} -c '{VVVALTR[2]}' mock node --link here > said & echo $!; wait"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        ["sh", "-c", script], stdout=subprocess.PIPE, text=True, cwd=tmp_path, env=environment
    ) as shell:
        assert shell.stdout is not None
        mock = int(shell.stdout.readline())
        deadline_s = time.monotonic() + 20.0
        while not (tmp_path / "here.toml").exists() and time.monotonic() < deadline_s:
            time.sleep(0.05)
        os.kill(mock, signal.SIGINT)
        shell.wait(20.0)

    assert [path.name for path in tmp_path.iterdir()] == ["said"]


def test_it_ends_when_nobody_reads_on(tmp_path: Path) -> None:
    with started("qik", "--link", "here", cwd=tmp_path) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.wait(20.0) == 0


def test_a_reader_that_falls_asleep_does_not_hold_up_the_device(tmp_path: Path) -> None:
    with started("qik", "--link", "here", cwd=tmp_path) as process:
        assert process.stdout is not None
        robot_file = Path(json.loads(process.stdout.readline())["robot_file"])
        os.set_blocking(process.stdout.fileno(), False)
        time.sleep(0.2)
        with closing(open_hardware(load_robot_file(robot_file))) as robot:
            assert run_trial(robot, GAIT, TrialSettings(duration_s=0.3)).outcome is Outcome.COMPLETED


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["qik", "--link", "taken"], 2, "taken exists already; choose another --link or remove it"),
        (["qik", "--link", "mine"], 1, "mine.toml is not a mock's file and would be overwritten"),
        (["qik", "--faults", "nowhere.toml"], 1, "nowhere.toml: there is no such file"),
        (["qik", "--faults", "bad.toml"], 2, "bad.toml: fault[1].kind is 'melt'; allowed: 'drop'"),
        (["qik", "--faults", "far.toml"], 2, "motor is 4; allowed: 1 to 3"),
        (["qik", "--faults", "never.toml"], 2, "at_s is nan, but must be 0 or more, and finite"),
        (["qik", "--link", "no/where"], 2, "no/where cannot be made: No such file or directory; choose another --link"),
        (["qik", "--link", "taken/here"], 2, "taken/here"),
        (["qik", "--link", "picture"], 1, "picture.toml is not a mock's file and would be overwritten"),
        (["odrive", "--interface", "virtual"], 2, "--interface and --channel go together"),
        (["qik", "--interface", "virtual", "--channel", "x"], 2, "qik has no CAN bus: leave out --interface"),
        (["odrive", "--interface", "slcn", "--channel", "x"], 2, "unknown CAN interface 'slcn' (did you mean slcan?)"),
        (["quick"], 2, "unknown driver 'quick' (did you mean qik?); choose one of qik, odrive, node"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_left_behind(
    tmp_path: Path, arguments: list[str], status: int, message: str
) -> None:
    (tmp_path / "taken").write_text("")
    (tmp_path / "mine.toml").write_text("# my robot\n")
    (tmp_path / "bad.toml").write_text('[[fault]]\nkind = "melt"\nat_s = 1.0\n')
    (tmp_path / "far.toml").write_text('[[fault]]\nkind = "stall"\nat_s = 1.0\nmotor = 4\n')
    (tmp_path / "never.toml").write_text('[[fault]]\nkind = "drop"\nat_s = nan\n')
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG")
    before = sorted(tmp_path.iterdir())

    with started(*arguments, cwd=tmp_path) as process:
        said, complaint = process.communicate(timeout=20.0)

    assert process.returncode == status
    assert said == ""
    assert message in complaint and complaint.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


def test_the_link_of_a_killed_mock_is_taken_over(tmp_path: Path) -> None:
    with started("odrive", "--link", "here", cwd=tmp_path) as killed:
        assert killed.stdout is not None
        killed.stdout.readline()
        killed.kill()
        killed.wait()
    with started("odrive", "--link", "here", cwd=tmp_path) as process:
        assert process.stdout is not None
        assert json.loads(process.stdout.readline())["port"] == str(tmp_path / "here")


def test_the_link_of_a_killed_mock_whose_terminal_is_another_programs_by_now_is_taken_over(tmp_path: Path) -> None:
    with started("odrive", "--link", "here", cwd=tmp_path) as killed:
        assert killed.stdout is not None
        killed.stdout.readline()
        killed.kill()
        killed.wait()
    master, terminal = os.openpty()
    (tmp_path / "here").unlink()
    (tmp_path / "here").symlink_to(os.ttyname(terminal))

    with started("odrive", "--link", "here", cwd=tmp_path) as process:
        assert process.stdout is not None
        assert json.loads(process.stdout.readline())["port"] == str(tmp_path / "here")
    os.close(master)
    os.close(terminal)


def test_a_fault_script_acts_at_its_time_after_the_motors_began(tmp_path: Path) -> None:
    script = tmp_path / "faults.json"
    script.write_text(json.dumps({"fault": [{"kind": "error", "after_motion_s": 0.4, "motor": 2}]}))
    with started("odrive", "--link", "here", "--faults", "faults.json", cwd=tmp_path) as process:
        assert process.stdout is not None
        robot_file = Path(json.loads(process.stdout.readline())["robot_file"])
        with closing(open_hardware(load_robot_file(robot_file))) as robot:
            trial = run_trial(robot, GAIT, TrialSettings(duration_s=3.0, heading_limit_rad=None))

    assert trial.outcome is Outcome.FAULTED
    assert "axis 1 reports supply voltage too low" in trial.reason
    assert 0.3 < trial.duration_s < 1.0


def test_a_pty_is_as_slow_as_the_line_that_it_stands_for(tmp_path: Path) -> None:
    port = PtyPort(tmp_path / "line", is_paced=True)
    with closing(port), closing(SerialLink(str(tmp_path / "line"), 2400)) as link:
        begun_s = time.monotonic()
        link.write(b"x" * 12)
        arrived = b""
        while len(arrived) < 12 and time.monotonic() < begun_s + 1.0:
            port.wait(time.monotonic() + 0.01)
            arrived += port.receive(time.monotonic())
        taken_s = time.monotonic() - begun_s

    assert arrived == b"x" * 12
    assert 0.6 * 12 * 10 / 2400 < taken_s < 0.5  # a busy computer sees it later


def test_two_programs_cannot_have_one_robot(mock: MockProcess) -> None:
    robot_file = load_robot_file(Path(mock.greeting.robot_file))
    with closing(open_hardware(robot_file)), pytest.raises((DeviceError, ValueError)):
        open_hardware(robot_file)
