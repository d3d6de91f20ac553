"""`vvvaltr check` and `vvvaltr calibrate` on devices in processes of their own."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from controller.cli import main
from controller.config import load_robot_file
from drivers.mock.faults import Fault, Kind
from drivers.mock.process import MockProcess
from drivers.mock.qik import CURVE


@pytest.fixture(scope="module")
def qik(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess("qik", tmp_path_factory.mktemp("qik") / "port") as mock:
        yield mock


@pytest.fixture(scope="module")
def odrive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess("odrive", tmp_path_factory.mktemp("odrive") / "port") as mock:
        yield mock


def answer(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict[str, Any]]:
    capsys.readouterr()
    status = main([*arguments, "--json"])
    last = capsys.readouterr().out.strip().splitlines()
    return status, json.loads(last[-1]) if last else {}


def verdicts(data: dict[str, Any]) -> dict[str, bool]:
    return {check["name"]: check["passed"] for check in data["checks"]}


def changed(mock: MockProcess, tmp_path: Path, old: str, new: str) -> str:
    text = Path(mock.greeting.robot_file).read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "robot.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return str(path)


def test_a_sound_robot_passes_every_point(qik: MockProcess, capsys: pytest.CaptureFixture[str]) -> None:
    status, data = answer(capsys, "check", "--robot", qik.greeting.robot_file)

    assert (status, data["passed"]) == (0, True), data
    assert set(verdicts(data)) == {
        *("line 1 link", "line 1 watchdog", "tracker"),
        *(f"motor {number}{what}" for number in (1, 2, 3) for what in ("", " direction")),
    }


def test_a_stalled_motor_fails_with_a_cure(odrive: MockProcess, capsys: pytest.CaptureFixture[str]) -> None:
    odrive.befall(Fault(kind=Kind.STALL, at_s=0.0, motor=2, duration_s=25.0))

    status, data = answer(capsys, "check", "--robot", odrive.greeting.robot_file)

    assert status == 1
    failed = {name for name, passed in verdicts(data).items() if not passed}
    assert "motor 2" in failed and "motor 1" not in failed
    assert all(check["cure"] for check in data["checks"] if not check["passed"])


def test_without_a_device_the_link_fails_and_the_tracker_is_tested_all_the_same(
    qik: MockProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = changed(qik, tmp_path, f'port = "{qik.greeting.port}"', 'port = "/dev/none"')

    status, data = answer(capsys, "check", "--robot", path)

    assert status == 1
    assert verdicts(data) == {"line 1 link": False, "tracker": True}
    assert "/dev/none" in data["checks"][0]["detail"]


def test_without_a_tracker_motors_without_sensors_cannot_pass(
    qik: MockProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    port = qik.greeting.tracker.partition(":")[2]
    path = changed(qik, tmp_path, f"port = {port}", "port = 0")

    status, data = answer(capsys, "check", "--robot", path)

    assert status == 1
    assert verdicts(data)["tracker"] is False
    assert verdicts(data)["line 1 watchdog"] is True
    assert verdicts(data)["motor 1"] is False


def test_without_a_file_ports_and_interfaces_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    status, data = answer(capsys, "check")

    assert status == 0
    assert set(data) == {"serial_ports", "can_interfaces"}


def test_a_bad_file_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "robot.toml").write_text("[tracker]\n")

    assert main(["check", "--robot", str(tmp_path / "robot.toml")]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_the_curve_of_a_motor_without_a_sensor_is_what_the_tracker_sees(
    qik: MockProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = "curve = [[14.0, 1.0], [127.0, 20.0]]"
    right = "curve = [[14.0, 1.8], [40.0, 6.0], [80.0, 11.5], [127.0, 16.5]]"
    path = changed(qik, tmp_path, right, wrong)

    status, data = answer(capsys, "calibrate", "--robot", path, "--points", "2", "--seconds", "1.5")

    assert status == 0
    for motor, shown in zip(load_robot_file(Path(path)).motors, data["curves"], strict=True):
        assert [list(point) for point in motor.curve] == shown
        assert motor.curve[-1][1] == pytest.approx(CURVE.frequency_hz(127.0), abs=0.2)
        assert motor.max_hz <= motor.curve[-1][1]


def test_the_curve_of_a_motor_with_a_sensor_is_what_it_measures(
    odrive: MockProcess, capsys: pytest.CaptureFixture[str]
) -> None:
    odrive.wait_until(lambda status: not status.faults, timeout_s=30.0)

    status, data = answer(
        capsys, "calibrate", "--robot", odrive.greeting.robot_file, "--points", "2", "--seconds", "0.6"
    )

    assert status == 0
    assert len(data["curves"]) == 3
    assert all(command == pytest.approx(hz, abs=0.05) for curve in data["curves"] for command, hz in curve)
