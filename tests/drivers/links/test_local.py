"""A port names a device of this computer and nothing else; what is wrong with it is told with the cure."""

from __future__ import annotations

import errno
import fcntl
import os
import pty
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.errors import DeviceError, LinkLost, NotUnderstood
from vvvaltr.drivers.links.can import CanLink
from vvvaltr.drivers.links.local import PORTS, claim_bus
from vvvaltr.drivers.links.serial import SerialLink
from vvvaltr.drivers.links.trouble import explain

ADDRESSES = ("spy:///dev/null?file={victim}", "socket://127.0.0.1:9", "rfc2217://127.0.0.1:9", "loop://", "hwgrep://.")
QIK = """
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


@pytest.fixture
def terminal() -> Iterator[str]:
    ours, theirs = pty.openpty()
    yield os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    path = tmp_path / "victim.txt"
    path.write_text("precious")
    return path


@pytest.mark.parametrize("address", ADDRESSES)
@pytest.mark.parametrize("suffix", ["", "@115200"])
def test_an_address_is_no_port_and_touches_nothing(address: str, suffix: str, victim: Path) -> None:
    port = address.format(victim=victim)

    with pytest.raises(NotUnderstood, match=r"is an address, not a device of this computer.*--allow-url"):
        SerialLink(port, 19200)
    with pytest.raises(NotUnderstood, match=r"is an address, not a device of this computer.*--allow-url"):
        CanLink("slcan", port + suffix, 500_000)

    assert victim.read_text() == "precious"


@pytest.mark.parametrize("port", ["", "a\0b"])
def test_what_can_be_no_name_is_refused_as_such(port: str) -> None:
    for refused in (lambda: SerialLink(port, 19200), lambda: CanLink("slcan", port, 500_000)):
        with pytest.raises(NotUnderstood, match="names no device; write its name, as in /dev/ttyACM0"):
            refused()


def test_a_robots_file_with_an_address_leaves_the_readers_files_alone(
    victim: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vvvaltr.controller.robot.commissioning.check._LOOK_AT_REST_S", 0.05)
    robot = tmp_path / "other.toml"
    robot.write_text(QIK.format(port=f"spy:///dev/null?file={victim}"))

    for command in (["check", str(robot)], ["trial", "9", "--robot", str(robot)]):
        assert main(command) in (1, 2)

    assert victim.read_text() == "precious"
    assert "is an address" in capsys.readouterr().err


def test_who_needs_an_address_can_have_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PORTS, "allow_url", True)

    with closing(SerialLink("loop://", 19200)) as link:
        assert link.name == "loop://"


@pytest.mark.parametrize("port", ["/dev/zero", "/dev/null", "{tmp}", "{tmp}/victim.txt", "{tmp}/fifo"])
def test_a_port_that_is_another_kind_of_file_is_not_opened(port: str, victim: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")

    with pytest.raises(NotUnderstood, match="is not a serial port"):
        SerialLink(port.format(tmp=tmp_path), 19200)


@pytest.mark.parametrize(
    ("interface", "options"),
    [
        ("udp_multicast", {}),
        ("socketcand", {"host": "example.org", "port": 1}),
        ("virtual", {"url": "http://example.org"}),
        ("usb2can", {"dll": "evil"}),
        ("neovi", {"override_library_name": "evil"}),
    ],
)
def test_a_bus_of_another_computer_or_an_option_that_leads_elsewhere_is_refused(
    interface: str, options: dict[str, Any]
) -> None:
    with pytest.raises(NotUnderstood, match="--allow-url"):
        CanLink(interface, "0", 500_000, options)


def test_two_programs_cannot_have_one_can_adapter() -> None:
    claim = claim_bus("socketcan", "can77")
    assert claim is not None
    with closing(claim), pytest.raises(DeviceError, match="socketcan:can77 is in use by another vvvaltr"):
        CanLink("socketcan", "can77", 500_000)


@pytest.mark.parametrize("kind", ["serial", "slcan"])
def test_a_port_that_another_program_has_is_not_written_to(terminal: str, kind: str) -> None:
    other = os.open(terminal, os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(other, fcntl.LOCK_EX)

    with pytest.raises(LinkLost, match=f"{terminal}: in use by"):
        SerialLink(terminal, 19200) if kind == "serial" else CanLink("slcan", terminal, 500_000)

    os.close(other)


def test_a_port_that_is_gone_is_told_with_what_is_there_now(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vvvaltr.drivers.links.local.list_usb_ports", lambda: ["/dev/ttyACM1"])

    with pytest.raises(LinkLost, match=r"/dev/ttyACM77: there is no such port now \(there are /dev/ttyACM1\)"):
        SerialLink("/dev/ttyACM77", 19200)


@pytest.mark.parametrize(
    ("name", "number", "words"),
    [
        ("/dev/ttyACM0", errno.EACCES, "permission denied; join its group by sudo usermod -aG dialout"),
        ("/dev/ttyACM0", errno.EIO, "unplugged or switched off; check its cable and power"),
        ("socketcan:can7", errno.ENODEV, "there is no such CAN interface"),
        ("socketcan:can7", errno.ENETDOWN, "sudo ip link set can7 up"),
        ("socketcan:can7", errno.ENOBUFS, "power, bit rate and termination"),
        ("socketcan:can7", errno.EAFNOSUPPORT, "kernel has no SocketCAN"),
    ],
)
def test_what_the_system_says_is_told_as_cause_and_cure(name: str, number: int, words: str) -> None:
    error = RuntimeError("wrapped")
    error.__cause__ = OSError(number, os.strerror(number))

    told = explain(name, error)

    assert told.startswith(name)
    assert words in told
