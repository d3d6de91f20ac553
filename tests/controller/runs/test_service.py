"""A run as a service: systemd's notices, the unit, and what a night without anybody must get over."""

import configparser
import json
import os
import shlex
import shutil
import signal
import socket
import subprocess
import sys
from collections import namedtuple
from contextlib import ExitStack
from pathlib import Path

import pytest

from benchmarks.soak import soak
from vvvaltr.controller.cli.main import main, make_parser
from vvvaltr.controller.runs.attended import find_lack_of_room
from vvvaltr.controller.runs.log import read_run
from vvvaltr.drivers.mocking.process import MockProcess

UNIT = Path(__file__).parents[3] / "examples" / "systemd" / "vvvaltr.service"
TWIN = ["learn", "--robot", "planar", "--duration", "0.5", "--no-recording", "--method", "random"]


@pytest.mark.parametrize("is_abstract", [False, True])
def test_systemd_is_told_of_the_begin_of_each_trial_and_of_the_end(
    is_abstract: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"vvvaltr-{tmp_path.name}" if is_abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(f"\0{name}" if is_abstract else name)
        systemd.settimeout(1.0)
        monkeypatch.setenv("NOTIFY_SOCKET", f"@{name}" if is_abstract else name)

        assert main([*TWIN, "--trials", "2", "--out", str(tmp_path / "run")]) == 0

        notices = [systemd.recv(1000).decode() for _ in range(4)]
    assert notices[0].startswith("READY=1\nWATCHDOG=1\nSTATUS=0 trials made")
    assert [notice.startswith("WATCHDOG=1\nSTATUS=trial ") for notice in notices] == [False, True, True, False]
    assert notices[3] == "STOPPING=1\nWATCHDOG=1\nSTATUS=complete"


def test_a_systemd_that_is_gone_ends_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "nobody"))

    assert main([*TWIN, "--trials", "1", "--out", str(tmp_path / "run")]) == 0


def service() -> configparser.SectionProxy:
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str  # type: ignore[assignment, method-assign]
    unit.read(UNIT)
    return unit["Service"]


def test_the_units_command_is_understood_and_hardened() -> None:
    unit = service()
    program, *words = shlex.split(unit["ExecStart"])

    arguments = make_parser().parse_args(words)

    assert Path(program).name == "vvvaltr"
    assert arguments.or_resume
    assert (unit["Type"], unit["Restart"]) == ("notify", "on-failure")
    assert unit["WatchdogSec"]
    assert {unit[key] for key in ("NoNewPrivileges", "ProtectHome", "PrivateTmp", "LockPersonality")} == {"yes"}


class Systemd(ExitStack):
    """Starts the unit's own command line as systemd does, and hears its notices; robot and folder are a test's."""

    def __init__(self, folder: Path, robot_file: str) -> None:
        super().__init__()
        line = service()["ExecStart"].replace("/etc/vvvaltr/robot.toml", robot_file)
        _, *self._words = shlex.split(line.replace("/var/lib/vvvaltr", str(folder)))
        self._socket = self.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
        self._socket.bind(str(folder / "notify"))
        self._socket.settimeout(20.0)
        self._environment = {**os.environ, "NOTIFY_SOCKET": str(folder / "notify")}

    def start(self) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "vvvaltr", *self._words]
        started = subprocess.Popen(command, env=self._environment, stdin=subprocess.DEVNULL)
        self.enter_context(started)
        self.callback(started.kill)
        return started

    def hear(self, words: str) -> str:
        """Return the next notice that contains ``words``."""
        while words not in (notice := self._socket.recv(1000).decode()):
            pass
        return notice


@pytest.mark.flaky(reruns=2)  # in real time
def test_after_a_loss_of_power_the_units_command_goes_on_and_stops_when_systemd_wants_it(tmp_path: Path) -> None:
    with MockProcess("node", tmp_path / "port") as mock:
        robot = Path(mock.greeting.robot_file)
        patient = robot.read_text().replace("age_limit_s = 0.2", "age_limit_s = 2.0")  # this computer may be busy
        robot.write_text(patient.partition("\n[trial]")[0] + "\n[trial]\nduration_s = 0.3\n")
        with Systemd(tmp_path, str(robot)) as systemd:
            killed = systemd.start()
            assert "0 trials made" in systemd.hear("READY=1")
            assert "WATCHDOG=1" in systemd.hear("trial 1: completed")
            mock.wait_until(lambda it: not it.is_at_rest)
            killed.kill()
            killed.wait()
            assert mock.wait_until(lambda it: it.is_at_rest)

            again = systemd.start()
            begin = systemd.hear("READY=1")
            systemd.hear(": completed")
            mock.wait_until(lambda it: not it.is_at_rest)
            again.send_signal(getattr(signal, service()["KillSignal"]))
            systemd.hear("STOPPING=1")

            assert again.wait(timeout=30) == int(service()["SuccessExitStatus"])
        assert mock.wait_until(lambda it: it.is_at_rest)
    made = int(begin.partition("STATUS=")[2].split()[0])
    outcomes = [logged.trial.outcome.value for logged in read_run(tmp_path / "run").trials]
    assert made >= 1
    *before, last = outcomes
    assert set(before) == {"completed"}
    assert last in ("interrupted", "completed")  # the signal may come just after a trial
    assert outcomes.count("completed") >= made + 1


def test_the_same_command_begins_a_run_and_goes_on_with_it(tmp_path: Path) -> None:
    run = tmp_path / "run"

    assert main([*TWIN, "--trials", "2", "--out", str(run), "--or-resume"]) == 0
    assert main([*TWIN, "--trials", "3", "--out", str(run), "--or-resume"]) == 0

    assert len(read_run(run).trials) == 3


def test_the_disk_is_looked_at_before_each_trial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    usage = namedtuple("usage", "total used free")
    frees = iter([10**9, 10**9, 3_000_000])
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(1, 1, next(frees)))

    assert main([*TWIN, "--trials", "9", "--out", str(tmp_path / "run"), "--json"]) == 1

    assert "trial 3 cannot begin: the disk of" in capsys.readouterr().err
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["trials"] == 2


def test_a_folder_that_is_gone_is_left_to_the_log(tmp_path: Path) -> None:
    assert find_lack_of_room(tmp_path / "gone") == ""


@pytest.mark.flaky(reruns=2)  # in real time
def test_a_short_soak_accounts_for_every_trial_and_leaves_no_motor_on() -> None:
    counts = soak(4, warm=99)

    assert counts["trials"] == 4
    assert counts["motors_left_on"] == counts["told_but_not_logged"] == counts["missing_or_doubled"] == 0
