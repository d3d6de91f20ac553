"""A run as a service: systemd's notices, the unit, and what a night without anybody must get over."""

import configparser
import json
import shlex
import shutil
import socket
from collections import namedtuple
from pathlib import Path

import pytest

from benchmarks.soak import soak
from vvvaltr.controller.cli.main import main, make_parser
from vvvaltr.controller.runs.attended import find_lack_of_room
from vvvaltr.controller.runs.log import read_run

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


def test_the_units_command_is_understood_and_hardened() -> None:
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str  # type: ignore[assignment, method-assign]
    unit.read(UNIT)
    service = unit["Service"]
    program, *words = shlex.split(service["ExecStart"])

    arguments = make_parser().parse_args(words)

    assert Path(program).name == "vvvaltr"
    assert arguments.or_resume
    assert (service["Type"], service["Restart"]) == ("notify", "on-failure")
    assert service["WatchdogSec"]
    assert {service[key] for key in ("NoNewPrivileges", "ProtectHome", "PrivateTmp", "LockPersonality")} == {"yes"}


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
