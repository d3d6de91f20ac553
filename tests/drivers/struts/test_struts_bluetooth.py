"""The radio links as they are: bleak's own code, on a private D-Bus with a stand-in for BlueZ behind it.

What no test here can reach is the radio: how late a text comes, and how soon a lost link is noticed.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager

import pytest
from stand_in_bluez import StandInBluez

from vvvaltr.controller.core.errors import DeviceError, DeviceFault, DeviceTimeout, LinkLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.drivers.held_motors import HeldMotors
from vvvaltr.drivers.links import bluetooth
from vvvaltr.drivers.links.gatt import Wanted
from vvvaltr.drivers.struts import scan
from vvvaltr.drivers.struts.line import open_line
from vvvaltr.drivers.struts.table import StrutsLineTable, StrutTable

NAMES = ("VVVALTR1", "VVVALTR2", "VVVALTR3")
GAIT = Gait((9.0, -11.0, 6.0))
TABLE = StrutsLineTable(motor=tuple(StrutTable(strut=name, max_hz=16.0) for name in NAMES))


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (
        ("_SCAN_S", 0.3),
        ("_DOUBLES_S", 0.05),
        ("_CONNECT_S", 1.0),
        ("_WRITE_S", 0.5),
        ("_CLOSE_S", 1.0),
    ):
        monkeypatch.setattr(bluetooth, name, value)


Air = Callable[..., StandInBluez]


@pytest.fixture
def air(monkeypatch: pytest.MonkeyPatch) -> Iterator[Air]:
    opened = []

    def make(*names: str, **options: object) -> StandInBluez:
        opened.append(StandInBluez(*names, **options))  # type: ignore[arg-type]
        monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", opened[-1].address)
        return opened[-1]

    yield make
    for one in opened:
        one.__exit__()


@contextmanager
def held() -> Iterator[HeldMotors]:
    with closing(HeldMotors(lambda: open_line(TABLE))) as motors:
        yield motors


def drive_for(motors: HeldMotors, duration_s: float) -> None:
    for _ in range(round(duration_s / 0.05)):
        motors.drive(GAIT, 0.25)
        time.sleep(0.05)
        motors.state()


def until(condition: Callable[[], bool], within_s: float = 2.0) -> None:
    end_s = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < end_s, "it did not happen in time"
        time.sleep(0.01)


def test_three_struts_are_found_connected_driven_and_stopped(air: Air) -> None:
    bluez = air(*NAMES)
    with held() as motors:
        drive_for(motors, 0.6)
        assert motors.state().frequency_hz == pytest.approx(GAIT.frequency_hz, abs=0.3)
        motors.stop()

        assert all(one.board.strut.target_rpm == 0 for one in bluez.peripherals)

    for one in bluez.peripherals:
        assert not one.is_connected
        assert {kind for text, kind in one.writes if text.startswith(b"0")} == {"request"}
        assert {kind for text, kind in one.writes if not text.startswith(b"0")} == {"command"}


def test_closing_in_the_middle_of_a_drive_stops_the_motors_before_the_links_end(air: Air) -> None:
    bluez = air(*NAMES)
    with held() as motors:
        drive_for(motors, 0.2)

    assert [one.writes[-1][0][:2] for one in bluez.peripherals] == [b"0,"] * 3


def test_a_lost_link_names_the_strut_stops_the_others_and_is_made_anew(air: Air) -> None:
    bluez = air(*NAMES)
    with held() as motors:
        drive_for(motors, 0.2)
        bluez.drop(bluez.peripherals[1])
        with pytest.raises(LinkLost, match="the radio link to strut VVVALTR2 is lost"):
            drive_for(motors, 1.0)
        for other in (bluez.peripherals[0], bluez.peripherals[2]):
            until(lambda other=other: other.writes[-1] == (b"0", "request"))  # type: ignore[misc]

        motors.ready(patience_s=2.0)
        drive_for(motors, 0.2)


def test_a_strut_that_is_away_for_a_while_is_looked_for_again_and_again(air: Air) -> None:
    bluez = air(*NAMES)
    with held() as motors:
        away = bluez.peripherals[1]
        bluez.drop(away)
        with pytest.raises(LinkLost):
            drive_for(motors, 1.0)
        bluez.peripherals.remove(away)
        threading.Timer(0.5, bluez.peripherals.insert, (1, away)).start()

        motors.ready(patience_s=5.0)
        drive_for(motors, 0.1)


def test_links_that_a_killed_program_has_left_up_are_taken_over(air: Air) -> None:
    bluez = air(*NAMES)
    left = open_line(TABLE)
    for one in bluez.peripherals:
        assert one.is_connected
    with held() as motors:
        drive_for(motors, 0.1)
    left.close()


def test_a_strut_that_never_answers_a_write_is_given_up(air: Air) -> None:
    bluez = air(*NAMES)
    with held() as motors:
        drive_for(motors, 0.1)
        bluez.peripherals[2].is_deaf = True
        with pytest.raises(DeviceError, match=r"VVVALTR3"):
            drive_for(motors, 1.0)


def test_the_names_in_the_air_are_listed(air: Air) -> None:
    air("VVVALTR2", "Kettle")

    assert scan(timeout_s=0.1) == [("Kettle", "24:0A:C4:00:00:02"), ("VVVALTR2", "24:0A:C4:00:00:01")]


def test_a_missing_strut_and_two_of_one_name_are_named(air: Air) -> None:
    air("VVVALTR1", "VVVALTR2", "VVVALTR2")

    with pytest.raises(DeviceTimeout, match=r"strut VVVALTR3 not found in the air \(there are VVVALTR1, VVVALTR2\)"):
        bluetooth.BluetoothLink("", [Wanted("VVVALTR1"), Wanted("VVVALTR3")], reports=True)
    with pytest.raises(DeviceFault, match="two struts have the name VVVALTR2"):
        bluetooth.BluetoothLink("", [Wanted("VVVALTR1"), Wanted("VVVALTR2")], reports=True)
    with closing(bluetooth.BluetoothLink("", [Wanted("24:0a:c4:00:00:03")], reports=True)):
        pass


def test_what_is_no_strut_is_refused(air: Air) -> None:
    bluez = air("VVVALTR1")
    bluez.peripherals[0].uuid = "00001800-0000-1000-8000-00805f9b34fb"  # what every device has

    with pytest.raises(DeviceFault, match="VVVALTR1 has no characteristic of a strut; put the UUID"):
        bluetooth.BluetoothLink("", [Wanted("VVVALTR1")], reports=True)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"has_adapter": False}, "this computer has no Bluetooth adapter; plug one in"),
        ({"is_powered": False}, "the Bluetooth adapter is off; switch it on by bluetoothctl power on"),
        ({"is_there": False}, "no Bluetooth service runs here; sudo apt install bluez"),
        ({"refusal": "org.freedesktop.DBus.Error.AccessDenied"}, "you may not use Bluetooth here; join its group"),
    ],
)
def test_what_is_wrong_with_bluetooth_is_said_with_its_cure(air: Air, options: dict[str, object], message: str) -> None:
    air(*NAMES, **options)

    with pytest.raises(DeviceError, match=message):
        open_line(TABLE)


def test_a_computer_without_a_bus_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nowhere/bus")

    with pytest.raises(DeviceError, match="this computer has no D-Bus, which Bluetooth needs; sudo apt install"):
        scan(timeout_s=0.1)


def test_an_adapter_that_is_not_there_is_named(air: Air) -> None:
    air(*NAMES)

    with pytest.raises(DeviceError, match="hci7"):
        open_line(StrutsLineTable(adapter="hci7", motor=TABLE.motor))
