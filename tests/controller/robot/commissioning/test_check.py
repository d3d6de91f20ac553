"""`vvvaltr check` on devices in processes of their own."""

from __future__ import annotations

import re
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calling import answer
from relayed import relayed
from robot_files import changed

import vvvaltr.controller.robot.commissioning.rotation
from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.values import MotorState, Pose
from vvvaltr.controller.robot.commissioning.check import _check_link
from vvvaltr.controller.robot.commissioning.rotation import RotationTest, Seeing
from vvvaltr.controller.robot.hardware import open_hardware
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.process import MockProcess
from vvvaltr.drivers.odrive.line import OdriveLine
from vvvaltr.drivers.odrive.table import OdriveLineTable, OdriveMotorTable


def verdicts(data: dict[str, Any]) -> dict[str, bool]:
    return {check["name"]: check["passed"] for check in data["checks"]}


def test_a_sound_robot_passes_every_point(qik: MockProcess, capsys: pytest.CaptureFixture[str]) -> None:
    status, data = answer(capsys, "check", "--robot", qik.greeting.robot_file)

    assert [check for check in data["checks"] if not check["passed"]] == []
    assert (status, data["passed"]) == (0, True)
    assert set(verdicts(data)) == {
        *("line 1 link", "line 1 watchdog", "tracker", "poses in motion"),
        *(f"motor {number}{what}" for number in (1, 2, 3) for what in ("", " direction")),
    }


def test_what_a_line_itself_says_to_do_is_the_cure() -> None:
    motors = (OdriveMotorTable(node=0, max_hz=10.0),)

    finding = _check_link("line 1 link", OdriveLineTable(interface="slcn", channel="can0", motor=motors))

    assert finding.detail == "the CAN interface slcn is none of this computer"
    assert finding.cure.startswith("choose one of canalystii, ")


def test_a_stalled_motor_fails_with_a_cure(odrive: MockProcess, capsys: pytest.CaptureFixture[str]) -> None:
    odrive.inject(Fault(kind=Kind.STALL, at_s=0.0, motor=2, duration_s=25.0))

    status, data = answer(capsys, "check", "--robot", odrive.greeting.robot_file)

    assert status == 1
    failed = {name for name, passed in verdicts(data).items() if not passed}
    assert "motor 2" in failed and "motor 1" not in failed
    assert all(check["cure"] for check in data["checks"] if not check["passed"])


def test_a_motor_that_is_not_seen_is_told_of_with_what_the_noise_hides(
    qik: MockProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(0)
    noise = [Pose(t_s, (*rng.normal(0.0, 2e-4, 2), 0.04)) for t_s in np.arange(0.0, 6.8, 1.0 / 30.0)]
    monkeypatch.setattr(vvvaltr.controller.robot.commissioning.rotation, "record_poses", lambda *_: noise)
    with closing(open_hardware(load_robot_file(Path(qik.greeting.robot_file)))) as robot:
        test = RotationTest(robot.motors, Seeing(robot.tracker, 30.0), 1, 16.5, reverses=False)
        finding = next(test.findings("motor 2"))

    assert not finding.passed
    assert re.fullmatch(r"set to 11\.7 Hz, no shaking is seen; the poses' noise hides up to 0\.\d+ mm", finding.detail)
    assert "if it stands still, check its wiring" in finding.cure
    assert "if it turns, its shaking is too faint for this tracker" in finding.cure


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
    assert set(data) == {"serial_ports", "can_interfaces", "struts"}


def test_a_bad_file_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "robot.toml").write_text("[tracker]\n")

    assert main(["check", str(tmp_path / "robot.toml")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_tracker_of_30_hz_passes_with_a_warning_that_names_the_rate_it_would_take(
    spatial_qik: MockProcess, capsys: pytest.CaptureFixture[str]
) -> None:
    status, data = answer(capsys, "check", spatial_qik.greeting.robot_file)

    assert (status, data["passed"]) == (0, True)
    warnings = {check["name"]: check for check in data["checks"] if check["cure"]}
    assert set(warnings) == {"motor 1 speed", "motor 2 speed", "motor 3 speed"}
    assert re.match(r"(2[7-9]|30|31) poses/s show up to 1[234]\.\d Hz", warnings["motor 1 speed"]["detail"])
    assert "let the tracker send 37 poses/s" in warnings["motor 1 speed"]["cure"]


def test_poses_that_look_like_something_else_are_named_with_the_key_to_set(
    qik: MockProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def millimetres(_: int, message: dict[str, Any]) -> dict[str, Any]:
        return {**message, "position_m": [1000.0 * x_m for x_m in message["position_m"]]}

    with relayed(Path(qik.greeting.robot_file), tmp_path / "robot.toml", millimetres) as path:
        _, data = answer(capsys, "check", path)
    tracker = next(check for check in data["checks"] if check["name"] == "tracker")
    assert not tracker["passed"]
    assert tracker["cure"] == 'if it is millimetres, set unit = "mm"'

    with relayed(Path(qik.greeting.robot_file), tmp_path / "robot.toml", millimetres, 'unit = "mm"') as path:
        _, data = answer(capsys, "track", path, "--duration", "1")
    assert data["problems"] == []
    assert 0.0 < data["position_m"][2] < 0.2


def test_a_body_that_is_not_seen_any_more_is_found_while_the_motors_turn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with MockProcess("node", tmp_path / "node") as node:
        node.inject(Fault(kind=Kind.FREEZE, at_s=0.0, duration_s=60.0))
        status, data = answer(capsys, "check", node.greeting.robot_file)

    assert status == 1
    found = {check["name"]: check for check in data["checks"]}
    assert "show the robot to the tracker" in found["poses"]["cure"]
    assert not found["poses in motion"]["passed"]
    assert "to the last digit" in found["poses in motion"]["detail"]


def test_one_motor_whose_watchdog_is_off_fails_the_line(
    odrive: MockProcess, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def still_turning(line: OdriveLine) -> MotorState:
        return MotorState(time.monotonic(), (0.0, 8.0, 0.0))

    odrive.wait_until(lambda status: not status.faults, timeout_s=30.0)
    monkeypatch.setattr(OdriveLine, "state", still_turning)

    _, data = answer(capsys, "check", "--robot", odrive.greeting.robot_file)

    (finding,) = (check for check in data["checks"] if check["name"] == "line 1 watchdog")
    assert not finding["passed"]
    assert "had not stopped motor 2" in finding["detail"]
