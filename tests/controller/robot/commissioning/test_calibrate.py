"""`vvvaltr calibrate` on devices in processes of their own, and on what a person reads from an instrument."""

from __future__ import annotations

import errno
import io
import itertools
import json
import os
import re
import shutil
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import cast

import msgspec
import numpy as np
import pytest
from calling import answer
from robot_files import changed

import vvvaltr.controller.robot.commissioning.calibrate
from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.document import to_toml
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.robot.commissioning.calibrate import Reach, Reading, _Measurement, fit_curve, remove_curves
from vvvaltr.controller.robot.commissioning.vibration import Peak
from vvvaltr.controller.robot.hardware import HardwareRobot
from vvvaltr.controller.robot.robot_file import load_robot_file, robot_file_from
from vvvaltr.drivers.mocking.process import MockProcess
from vvvaltr.drivers.qik.mock import CURVE


def with_one_motor(path: str) -> str:
    """Leave a robot's file its first motor alone: what holds for one holds for three, in a third of the time."""
    robot = load_robot_file(Path(path))
    line = msgspec.structs.replace(robot.line[0], motor=robot.line[0].motor[:1])
    Path(path).write_text(to_toml(msgspec.to_builtins(msgspec.structs.replace(robot, line=(line,)))))
    return path


def copied(mock: MockProcess, tmp_path: Path, name: str = "mine.toml") -> Path:
    return Path(shutil.copy(mock.greeting.robot_file, tmp_path / name))


def test_the_curve_of_a_motor_without_a_sensor_is_what_the_tracker_sees(
    qik: MockProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = "curve = [[14.0, 1.0], [127.0, 20.0]]"
    right = "curve = [[14.0, 1.8], [40.0, 6.0], [80.0, 11.5], [127.0, 16.5]]"
    path = with_one_motor(changed(qik, tmp_path, right, wrong))

    status, data = answer(capsys, "calibrate", "--robot", path, "--points", "2", "--seconds", "1.5")

    assert status == 0
    (motor,) = load_robot_file(Path(path)).motors
    assert [[list(point) for point in motor.curve]] == data["curves"]
    assert motor.curve[-1][1] == pytest.approx(CURVE.frequency_hz(127.0), abs=0.5)
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


def test_with_a_tracker_of_30_hz_a_qik_is_calibrated_and_searched_up_to_13_5_hz(
    spatial_qik: MockProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = with_one_motor(str(copied(spatial_qik, tmp_path)))

    status, data = answer(capsys, "calibrate", path, "--points", "2", "--seconds", "2")

    assert status == 0
    assert 12.0 < data["limit_hz"] < 13.8  # of 30 poses a second a busy computer may send fewer
    robot = load_robot_file(Path(path))
    (motor,) = robot.motors
    command, frequency_hz = motor.curve[-1]
    assert frequency_hz == pytest.approx(CURVE.frequency_hz(command), abs=0.3)
    assert motor.max_hz <= data["limit_hz"]
    assert robot.range_hz[1] == pytest.approx(data["limit_hz"], abs=0.3)
    assert robot.range_hz[1] <= data["limit_hz"]


def test_a_motor_that_would_be_taken_for_a_slower_one_is_refused_by_name(
    spatial_qik: MockProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its former curve says 13 Hz at full speed, and it turns at 16.5 Hz, which 30 poses a second show as 13.5 Hz."""
    path = copied(spatial_qik, tmp_path)
    text = (
        path.read_text(encoding="utf-8")
        .replace("[127.0, 16.5]]", "[127.0, 13.2]]")
        .replace("max_hz = 16.5", "max_hz = 13.2")
    )
    text = text.replace("[80.0, 11.5]", "[80.0, 9.2]").replace("[40.0, 6.0]", "[40.0, 4.8]")
    path.write_text(text.replace("high_hz = 16.0", "high_hz = 13.0"), encoding="utf-8")
    before = path.read_bytes()

    status = main(["calibrate", str(path), "--points", "2", "--seconds", "2"])

    assert status == 1
    assert re.search(r"motor 1 seems to turn faster than \d+ poses/s can show", capsys.readouterr().err)
    assert path.read_bytes() == before


def test_calibrating_again_asks_for_the_same_greatest_command(odrive: MockProcess) -> None:
    robot = load_robot_file(Path(odrive.greeting.robot_file))
    line = robot.line[0]
    curved = tuple(msgspec.structs.replace(it, curve=((2.0, 1.9), (16.5, 16.4)), max_hz=16.4) for it in line.motor)
    robot = msgspec.structs.replace(robot, line=(msgspec.structs.replace(line, motor=curved),))

    assert [motor.max_hz for motor in remove_curves(robot).motors] == pytest.approx([16.5] * 3)


ASKED = ("--ask", "--points", "2", "--seconds", "0.5")


@pytest.fixture
def prompt(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vvvaltr.controller.robot.commissioning.calibrate, "_SETTLE_S", 0.0)


@pytest.mark.usefixtures("prompt")
@pytest.mark.parametrize(
    ("answers", "complaint"),
    [
        ("inf\n" * 9, "'inf' is not a number of at least 0 and at most 1000; nothing was saved"),
        ("1e308\n" * 9, "'1e308' is not a number"),
        ("-3\n" * 9, "'-3' is not a number"),
        ("16\n", "the replies ended too early, nothing was saved"),
        ("", "the replies ended too early, nothing was saved"),
        ("3\n1\n" * 3, "nothing was saved: the curve does not fit the file: "),  # slower than the file's search begins
    ],
)
def test_answers_that_make_no_curve_leave_the_file_alone(
    answers: str,
    complaint: str,
    qik: MockProcess,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = copied(qik, tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO(answers))

    assert main(["calibrate", "--robot", str(path), *ASKED]) == 1

    assert complaint in capsys.readouterr().err.splitlines()[-1]
    assert path.read_text() == Path(qik.greeting.robot_file).read_text()
    assert [left.name for left in tmp_path.iterdir()] == [path.name]


@pytest.mark.usefixtures("prompt")
@pytest.mark.parametrize("name", ["mine.toml", "mine.json"])
def test_a_mistyped_answer_is_asked_for_again_and_the_output_is_one_object(
    name: str, qik: MockProcess, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    if path.suffix == ".json":
        path.write_text(json.dumps(msgspec.to_builtins(load_robot_file(Path(qik.greeting.robot_file)))))
    else:
        copied(qik, tmp_path)
    link = tmp_path / f"link{path.suffix}"
    link.symlink_to(path)
    monkeypatch.setattr(sys, "stdin", io.StringIO("inf\nfast\n16\n" + "3.5\n16\n4\n16\n4\n"))

    status = main(["calibrate", "--robot", str(link), *ASKED, "--json"])

    out, err = capsys.readouterr()
    assert status == 0
    assert json.loads(out)["curves"][0][-1] == [127.0, 16.0]
    assert "'fast' is not a number" in err
    assert [motor.curve[-1] for motor in load_robot_file(path).motors] == [(127.0, 16.0)] * 3
    assert link.is_symlink()


@pytest.mark.usefixtures("prompt")
def test_a_full_disk_leaves_the_robots_file(
    qik: MockProcess, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = copied(qik, tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO("16\n4\n" * 3))
    monkeypatch.setattr(os, "fsync", full)

    assert main(["calibrate", "--robot", str(path), *ASKED]) == 1

    assert path.read_text() == Path(qik.greeting.robot_file).read_text()


def test_readings_that_are_equal_when_rounded_make_one_point() -> None:
    seen = [Reading(0, 100.0, 5.0004), Reading(0, 80.0, 4.9996), Reading(0, 60.0, 3.0)]

    assert fit_curve(seen, ()) == ((60.0, 3.0), (100.0, 5.0))


def test_a_camera_of_30_hz_measures_and_searches_a_qik_up_to_13_5_hz() -> None:
    motors = [{"board": 0, "output": n, "max_hz": 16.5, "curve": [[14.0, 1.8], [127.0, 16.5]]} for n in (0, 1)]
    line = {"driver": "qik", "port": "/dev/none", "motor": motors}
    robot = robot_file_from({"line": [line], "tracker": {"kind": "stream", "port": 7599}}, "qik.toml")
    reach = Reach(30.0)

    commands = reach.greatest_commands(robot)

    assert reach.limit_hz == pytest.approx(13.5)
    for command, motor in zip(commands, robot.motors, strict=True):
        assert motor.calibration.frequency_hz(command) == pytest.approx(13.5)
    assert reach.explain(robot) == (
        "30 poses/s show up to 13.5 Hz: motors are measured and searched up to there; "
        "for 16.5 Hz let the tracker send 37 poses/s"
    )


@pytest.mark.parametrize(
    ("seen_hz", "told"),
    [
        ((13.0, 12.0), ""),
        ((12.0, 13.0), "motor 2 seems to turn faster than 30 poses/s can show"),
        (
            (13.0, None),
            r"motor 2 is seen to shake the robot at one of two commands alone.*calibrate again with a longer look",
        ),
    ],
)
def test_a_motor_that_is_seen_at_one_command_alone_is_not_said_to_be_too_fast(
    seen_hz: tuple[float | None, ...], told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks = itertools.cycle(None if hz is None else Peak(hz, 9.0, np.ones(1, complex), 3.2, 1e-4) for hz in seen_hz)
    monkeypatch.setattr(_Measurement, "_look", lambda *_: next(looks))
    measurement = _Measurement(cast(HardwareRobot, None), 1, 1.0, None)

    with pytest.raises(UserError, match=told) if told else nullcontext():
        measurement.find(127.0, Reach(30.0))
