"""What is plugged in, and what it probably is."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from vvvaltr.controller.robot.commissioning.plugged_in import find_can, identify, lasting_name, name_struts


@dataclass
class Port:
    vid: int | None
    pid: int | None
    device: str = "/dev/ttyUSB7"
    description: str = "a port"


@pytest.mark.parametrize(
    ("vid", "pid", "driver", "kind"),
    [
        (0x0403, 0x6001, "qik", "serial"),
        (0x0403, 0x6015, "qik", "serial"),
        (0x2E8A, 0x0005, "", "serial"),
        (0x16D0, 0x117E, "odrive", "slcan"),
        (0x1209, 0x0D32, "", "serial"),
        (0x1209, 0x0001, "", "serial"),
        (None, None, "", "serial"),
    ],
)
def test_usb_numbers_tell_the_likely_driver(vid: int | None, pid: int | None, driver: str, kind: str) -> None:
    found = identify(Port(vid, pid))

    assert (found.driver, found.kind, found.address) == (driver, kind, "/dev/ttyUSB7")


def test_a_port_has_the_name_that_stays(tmp_path: Path) -> None:
    port, folder = tmp_path / "ttyUSB0", tmp_path / "by-id"
    port.touch()
    folder.mkdir()
    (folder / "usb-FTDI_A1").symlink_to(port)

    assert lasting_name(str(port), folder) == str(folder / "usb-FTDI_A1")
    assert lasting_name(str(tmp_path / "ttyS0"), folder) == str(tmp_path / "ttyS0")
    assert lasting_name(str(port), tmp_path / "none") == str(port)


def test_can_interfaces_are_found_among_the_networks(tmp_path: Path) -> None:
    for name, kind in (("can0", "280"), ("eth0", "1")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n")

    assert [(it.address, it.driver, it.kind) for it in find_can(tmp_path)] == [("can0", "odrive", "socketcan")]


def test_the_laboratorys_struts_are_known_by_their_names() -> None:
    found = name_struts([("VVVALTR2", "AA:BB"), ("headphones", "CC:DD")])

    assert [(it.address, it.driver) for it in found] == [("VVVALTR2", "struts"), ("headphones", "")]
