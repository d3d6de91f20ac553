"""What is wrong with a line, and with the device on it, is told with cause and cure, by every command."""

from __future__ import annotations

import errno
import fcntl
import os
import pty
import re
import select
import threading
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest
import serial

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.errors import DeviceFault
from vvvaltr.controller.robot.hardware import open_motors
from vvvaltr.drivers.node.line import _CURES
from vvvaltr.drivers.node.protocol import Fault
from vvvaltr.drivers.node.table import NodeLineTable, NodeMotorTable
from vvvaltr.drivers.odrive.protocol import ERRORS as ODRIVE_ERRORS
from vvvaltr.drivers.odrive.protocol import describe_errors as describe_odrive_errors
from vvvaltr.drivers.odrive.table import Firmware, OdriveLineTable, OdriveMotorTable
from vvvaltr.drivers.qik.protocol import ERRORS as QIK_ERRORS
from vvvaltr.drivers.qik.protocol import describe_errors as describe_qik_errors
from vvvaltr.drivers.qik.table import QikLineTable, QikMotorTable
from vvvaltr.drivers.table import LineTable

ROBOT = """
[[line]]
driver = "qik"
port = "{port}"
[[line.motor]]
board = 0
output = 0
max_hz = 16
curve = [[14, 1.8], [127, 16.5]]
[tracker]
kind = "stream"
port = 0
"""

COMMANDS = {
    "check": ["check", "{robot}"],
    "calibrate": ["calibrate", "{robot}"],
    "trial": ["trial", "9", "--robot", "{robot}", "--out", "{out}"],
    "learn": ["learn", "--robot", "{robot}", "--trials", "1", "--out", "{out}"],
    "compare": ["compare", "9", "12", "--robot", "{robot}", "--out", "{out}"],
    "repertoire": ["repertoire", "--robot", "{robot}", "--out", "{out}"],
    "floor": ["floor", "{robot}", "--gait", "9", "--out", "{out}"],
}


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """Both ends of a serial line: the device's as a file number, the controller's as a port."""
    device, port = pty.openpty()
    tty.setraw(port)
    yield device, os.ttyname(port)
    os.close(device)
    os.close(port)


@pytest.fixture
def echo(terminal: tuple[int, str]) -> Iterator[str]:
    """A port on which everything that is sent comes back."""
    device, port = terminal
    over, wake = os.pipe()

    def repeat() -> None:
        while over not in (ready := select.select([device, over], [], [])[0]):
            if ready:
                os.write(device, os.read(device, 4096))

    thread = threading.Thread(target=repeat)
    thread.start()
    yield port
    os.write(wake, b".")
    thread.join()
    os.close(over)
    os.close(wake)


def refused(number: int) -> Callable[..., None]:
    def refuse(port: str, *_: object, **__: object) -> None:
        raise serial.SerialException(number, f"could not open port {port}: {os.strerror(number)}")

    return refuse


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("trouble", ["in use", "permission", "gone", "no power", "echo"])
def test_every_command_tells_cause_and_cure(
    command: str,
    trouble: str,
    terminal: tuple[int, str],
    request: pytest.FixtureRequest,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, port = terminal
    cause, cure = {
        "in use": (f"{port}: in use by", "end that one first"),
        "permission": (f"{port}: permission denied", r"sudo (usermod -aG|chmod a\+rw)"),
        "gone": ("/dev/gone: there is no such port now", "a run goes on by --resume DIR --robot FILE"),
        "no power": (f"{port}: no board answers as number 0", "check power, wiring, baud rate"),
        "echo": (f"{port}: what is sent comes back", "part the wires, or switch the echo off"),
    }[trouble]
    monkeypatch.setattr("vvvaltr.drivers.qik.line._ANSWER_S", 0.02)
    monkeypatch.setattr("vvvaltr.controller.robot.commissioning.check._LOOK_AT_REST_S", 0.05)
    other = os.open(port, os.O_RDWR | os.O_NOCTTY)
    match trouble:
        case "in use":
            fcntl.flock(other, fcntl.LOCK_EX)
        case "permission":
            monkeypatch.setattr(serial, "Serial", refused(errno.EACCES))
        case "gone":
            port = "/dev/gone"
        case "echo":
            request.getfixturevalue("echo")
    robot = tmp_path / "robot.toml"
    robot.write_text(ROBOT.format(port=port))

    status = main([word.format(robot=robot, out=tmp_path / "out") for word in COMMANDS[command]])

    os.close(other)
    said = "".join(capsys.readouterr())
    assert status == 1
    assert cause in said
    assert re.search(cure, said)
    assert "defect" not in said
    assert not (tmp_path / "out").exists()


LINES: dict[str, Callable[[str], LineTable]] = {
    "qik": lambda port: QikLineTable(
        port=port, motor=(QikMotorTable(board=0, output=0, max_hz=16.0, curve=((14.0, 1.8), (127.0, 16.5))),)
    ),
    "odrive": lambda port: OdriveLineTable(
        interface="slcan", channel=port, motor=(OdriveMotorTable(node=0, max_hz=16.0),)
    ),
    "node": lambda port: NodeLineTable(port=port, motor=(NodeMotorTable(max_hz=16.0),)),
}


@pytest.mark.parametrize("driver", LINES)
def test_an_echo_is_not_taken_for_a_device(driver: str, echo: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vvvaltr.drivers.node.line._GREETING_S", 0.15)
    monkeypatch.setattr("vvvaltr.drivers.odrive.line._GREETING_S", 0.15)

    with pytest.raises(
        DeviceFault, match=r"(comes back|come in): .*(or switch the echo off|or end that program)"
    ) as it:
        open_motors(LINES[driver](echo))

    assert it.value.code == "echo"


def test_another_program_that_drives_the_axes_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vvvaltr.drivers.odrive.line._GREETING_S", 0.15)
    table = OdriveLineTable(interface="virtual", channel="shared", motor=(OdriveMotorTable(node=0, max_hz=16.0),))
    velocity = can.Message(arbitration_id=0x0D, data=bytes(8), is_extended_id=False)

    with can.Bus(interface="virtual", channel="shared") as other:
        task = other.send_periodic(velocity, 0.02)
        with pytest.raises(DeviceFault, match="another program drives the axes; correct channel, or end that program"):
            open_motors(table)
        task.stop()


@pytest.mark.parametrize("bit", QIK_ERRORS)
def test_every_error_of_a_qik_has_its_cure(bit: int) -> None:
    name, told = describe_qik_errors(bit)

    assert name == QIK_ERRORS[bit]
    assert f"{name} ({bit:#04x}): " in told
    assert "; " in told


def test_of_several_errors_of_a_qik_the_gravest_has_its_cure() -> None:
    name, told = describe_qik_errors(0x90)

    assert name == "watchdog"
    assert told.startswith(
        "frame error, watchdog (0x90): no command came in time, so it stopped its motors; check cable"
    )


def test_what_is_no_error_of_a_qik_is_noise_or_an_echo() -> None:
    assert describe_qik_errors(0x03) == ("garbled", "0x03, which is no error of a qik; check the wiring for noise")
    assert "which is what was sent: the receiving wire" in describe_qik_errors(0xAA)[1]


@pytest.mark.parametrize("firmware", Firmware)
def test_every_error_of_an_odrive_has_a_cure(firmware: Firmware) -> None:
    for bit, name in ODRIVE_ERRORS[firmware].items():
        told_name, told = describe_odrive_errors(firmware, bit)

        assert told_name == name
        assert told.startswith(f"{name} ({bit:#x}); ")
        assert len(told.partition("; ")[2]) > 10


def test_every_fault_of_a_node_has_a_cure() -> None:
    assert set(_CURES) == set(Fault) - {Fault.NONE}
