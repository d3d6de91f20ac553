"""The driver of radio struts, on boards with our firmware and the laboratory's in the air of a mock."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from vvvaltr.controller.core.errors import DeviceError, DeviceFault, DeviceTimeout, LinkLost, NotUnderstood
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.robot.hardware import open_motors
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.held_motors import HeldMotors
from vvvaltr.drivers.links.air import AirLink
from vvvaltr.drivers.links.gatt import Wanted, find_addresses
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.process import MockProcess
from vvvaltr.drivers.motor_line import WATCHDOG
from vvvaltr.drivers.struts import scan
from vvvaltr.drivers.struts.line import StrutsLine, open_line
from vvvaltr.drivers.struts.protocol import decode
from vvvaltr.drivers.struts.strut import LaboratoryStrut
from vvvaltr.drivers.struts.table import StrutsLineTable, StrutTable

GAIT = Gait((9.0, -11.0, 6.0))
LABORATORY = "{:.2f},{:.2f},0,0,16384,0,0,0"


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess("struts", tmp_path_factory.mktemp("struts") / "port") as mock:
        yield mock


@pytest.fixture(scope="module")
def theirs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess("struts", tmp_path_factory.mktemp("lab") / "port", "--firmware", "laboratory") as mock:
        yield mock


def table_of(mock: MockProcess) -> StrutsLineTable:
    table = load_robot_file(Path(mock.greeting.robot_file)).line[0]
    assert isinstance(table, StrutsLineTable)
    return table


@pytest.fixture
def motors(own: MockProcess) -> Iterator[HeldMotors]:
    with closing(open_motors(table_of(own))) as motors:
        yield motors


def drive_for(motors: HeldMotors, duration_s: float, gait: Gait = GAIT) -> None:
    for _ in range(round(duration_s / 0.05)):
        motors.drive(gait, 0.25)
        time.sleep(0.05)
        motors.state()


def drive_until_it_fails(motors: HeldMotors, within_s: float = 3.0) -> DeviceError:
    with pytest.raises(DeviceError) as caught:
        drive_for(motors, within_s)
    return caught.value


def come_back(motors: HeldMotors) -> None:
    end_s = time.monotonic() + 5.0
    while True:
        motors.ready(patience_s=5.0)
        try:
            drive_for(motors, 0.1)
            return motors.stop()
        except DeviceError:  # what went wrong is not over yet
            assert time.monotonic() < end_s


def test_names_in_the_air_are_listed_with_their_addresses(own: MockProcess) -> None:
    assert scan(adapter=own.greeting.port)[0] == ("VVVALTR1", "24:0A:C4:00:00:01")


def test_a_strut_is_found_by_its_address_too(own: MockProcess) -> None:
    motor = StrutTable(strut="24:0a:c4:00:00:02", max_hz=16.0)
    with closing(open_line(StrutsLineTable(adapter=own.greeting.port, motor=(motor,)))) as line:
        assert line.motor_count == 1


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("VVVALTR1", "VVVALTR7"), r"strut VVVALTR7 not found in the air \(there are VVVALTR1, .*VVVALTR3\)"),
        (("A", "B"), "struts A and B not found in the air .*; charge the battery"),
    ],
)
def test_missing_struts_are_named_and_nothing_is_started(
    own: MockProcess, names: tuple[str, ...], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vvvaltr.drivers.links.air._SCAN_S", 0.2)
    with pytest.raises(DeviceTimeout, match=message):
        AirLink(own.greeting.port, [Wanted(name) for name in names])


def test_two_struts_with_one_name_are_told_apart_by_their_addresses() -> None:
    seen = {"24:0A:C4:00:00:01": "S", "24:0A:C4:00:00:02": "S"}
    with pytest.raises(DeviceFault, match=r"two struts have the name S \(24:.*01 and 24:.*02\); put the address"):
        find_addresses([Wanted("S")], seen)

    assert find_addresses([Wanted("24:0a:c4:00:00:02")], seen) == ("24:0A:C4:00:00:02",)


def test_names_from_the_air_cannot_act_on_a_terminal() -> None:
    with pytest.raises(DeviceTimeout) as caught:
        find_addresses([Wanted("S")], {"24:0A:C4:00:00:01": "\x1b[2Jevil"})

    assert "\x1b" not in str(caught.value)


def test_nothing_is_written_to_a_socket_that_is_no_mocks(tmp_path: Path) -> None:
    import socket

    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as other:
        other.bind(str(tmp_path / "other"))
        other.listen()
        with pytest.raises(LinkLost, match="no mock of struts answers there"):
            AirLink(str(tmp_path / "other"), [Wanted("S")])
        connection, _ = other.accept()
        with connection:
            assert connection.recv(100) == b""


def test_a_strut_that_leaves_is_named_the_others_stop_and_it_can_be_driven_again(
    own: MockProcess, motors: HeldMotors
) -> None:
    drive_for(motors, 0.3)
    own.inject(Fault(Kind.DROP_OUT, at_s=0.0, motor=2, duration_s=0.6))

    problem = drive_until_it_fails(motors)

    assert isinstance(problem, DeviceError) and "VVVALTR2" in str(problem)
    own.wait_until(lambda status: status.is_at_rest, timeout_s=0.6)
    come_back(motors)


def test_commands_expire_when_the_program_is_killed_though_the_links_stay_up(own: MockProcess) -> None:
    line = open_line(table_of(own))
    assert isinstance(line, StrutsLine)
    line.send(GAIT)
    own.wait_until(lambda status: all(status.applied_hz))

    line._link._air.close()  # type: ignore[attr-defined]  # as the system does for a program that was killed

    own.wait_until(lambda status: status.is_at_rest and status.watchdog, timeout_s=0.8)
    with closing(open_motors(table_of(own))) as motors:  # and the links are taken over
        drive_for(motors, 0.2)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (Fault(Kind.STALL, at_s=0.0, motor=3, duration_s=0.5), "motor 3 of the line turns at"),
        (Fault(Kind.SILENCE, at_s=0.0, duration_s=0.8), "no message from the device"),
        (Fault(Kind.BROWN_OUT, at_s=0.0, duration_s=0.2), "is lost|has rebooted|no message"),
        (Fault(Kind.ERROR, at_s=0.0, motor=1, duration_s=0.4), "strut VVVALTR1: its battery is down to 2.90 V; charge"),
        (Fault(Kind.SLOW, at_s=0.0, delay_s=0.7, duration_s=0.8), "no message|watchdog stopped"),
        (Fault(Kind.UNPLUG, at_s=0.0, duration_s=0.3), "the adapter is gone"),
    ],
)
def test_what_goes_wrong_ends_the_drive_in_one_line_and_can_be_put_right(
    own: MockProcess, motors: HeldMotors, fault: Fault, message: str
) -> None:
    drive_for(motors, 0.2)
    own.inject(fault)

    with pytest.raises(DeviceError, match=message):
        drive_for(motors, 3.0)

    own.wait_until(lambda status: status.is_at_rest, timeout_s=1.0)
    come_back(motors)


@pytest.mark.parametrize(
    "fault",
    [
        Fault(Kind.DROP, at_s=0.0, replies=4),
        Fault(Kind.DUPLICATE, at_s=0.0, replies=10),
        Fault(Kind.SLOW, at_s=0.0, delay_s=0.1, duration_s=0.5),
        Fault(Kind.DROP_OUT, at_s=0.0, motor=1, duration_s=0.1),
    ],
)
def test_what_a_radio_does_every_day_is_borne(own: MockProcess, motors: HeldMotors, fault: Fault) -> None:
    drive_for(motors, 0.2)
    own.inject(fault)

    drive_for(motors, 0.6)

    assert motors.state().frequency_hz == pytest.approx(GAIT.frequency_hz, abs=0.2)


@pytest.mark.flaky(reruns=2)  # in real time
def test_a_strut_that_hears_the_stop_late_spoils_the_drive(own: MockProcess, motors: HeldMotors) -> None:
    drive_for(motors, 0.3)
    own.inject(Fault(Kind.DROP_OUT, at_s=0.0, motor=2, duration_s=0.28))
    time.sleep(0.02)

    with pytest.raises(DeviceTimeout, match=r"VVVALTR2 took 0\.[23]\d s to stop, so its motor ran on; bring it nearer"):
        motors.stop()

    come_back(motors)


def test_struts_of_the_laboratory_are_refused_with_the_reason_and_the_cure(theirs: MockProcess) -> None:
    with pytest.raises(
        DeviceFault, match=r"no watchdog in SPVVVECTR1, SPVVVECTR2 and SPVVVECTR3, .* set allow_no_watchdog = true"
    ) as caught:
        open_motors(table_of(theirs))

    assert caught.value.code == "no_watchdog"
    assert theirs.statuses[-1].is_at_rest


def test_where_they_are_allowed_they_are_warned_of_and_run_on_after_a_kill(
    theirs: MockProcess, caplog: pytest.LogCaptureFixture
) -> None:
    table = msgspec.structs.replace(table_of(theirs), allow_no_watchdog=True)
    line = open_line(table)
    assert isinstance(line, StrutsLine)
    assert len(caplog.messages) == 1 and "runs on when the radio link is lost" in caplog.messages[0]
    line.send(GAIT)
    theirs.wait_until(lambda status: all(status.applied_hz))

    line._link._air.close()  # type: ignore[attr-defined]  # as the system does for a program that was killed
    time.sleep(1.0)

    assert all(theirs.statuses[-1].applied_hz)
    open_line(table).close()  # the next opening stops them
    theirs.wait_until(lambda status: status.is_at_rest)


def test_a_strut_of_theirs_that_left_runs_on_until_it_is_found_again_which_waits_for_no_trial(
    theirs: MockProcess, caplog: pytest.LogCaptureFixture
) -> None:
    table = msgspec.structs.replace(table_of(theirs), allow_no_watchdog=True)
    with closing(HeldMotors(lambda: open_line(table))) as motors:
        drive_for(motors, 0.3)
        theirs.inject(Fault(Kind.DROP_OUT, at_s=0.0, motor=2, duration_s=0.5))
        assert isinstance(drive_until_it_fails(motors), LinkLost)
        rests = theirs.wait_until(lambda status: status.applied_hz[0] == 0.0 == status.applied_hz[2])
        assert rests.applied_hz[1] != 0.0
        theirs.wait_until(lambda status: status.is_at_rest, timeout_s=2.0)

    assert caplog.messages[-1] == "strut SPVVVECTR2 was found again and stopped"


def laboratory_strut(average_rpm: float = 0.0) -> LaboratoryStrut:
    strut = LaboratoryStrut("S", decode(LABORATORY.format(0, average_rpm).encode()), 10.0)
    strut.take(decode(LABORATORY.format(0, average_rpm).encode()), 10.2)
    return strut


def report(strut: LaboratoryStrut, target_rpm: float, average_rpm: float, heard_s: float) -> None:
    strut.take(decode(LABORATORY.format(target_rpm, average_rpm).encode()), heard_s)


def test_the_laboratorys_stall_is_told_by_a_target_of_0_alone() -> None:
    strut = laboratory_strut()
    assert strut.tell(900, 1, 10.3) == b"900"
    assert strut.tell(900, 2, 10.35) is None  # a repeat would start the motor again, and hide the stall

    report(strut, 0, 0, 10.4)  # it has not heard the command yet
    report(strut, 900, 300, 10.6)
    with pytest.raises(DeviceFault, match="its motor stalled") as caught:
        report(strut, 0, 0, 11.6)
    assert caught.value.code == "stall"


def test_a_strut_that_another_program_commands_is_noticed() -> None:
    strut = laboratory_strut()
    strut.tell(900, 1, 10.3)

    with pytest.raises(DeviceFault, match="regulates to 300 turns a minute instead of 900"):
        report(strut, 300, 100, 11.2)


def test_the_laboratorys_firmware_for_pulse_widths_is_told_by_a_speed_that_does_not_follow() -> None:
    strut = laboratory_strut()
    strut.tell(-750, 1, 10.3)
    for step in range(17):
        report(strut, -750, 200, 10.4 + 0.2 * step)

    with pytest.raises(DeviceFault, match=r"set to 12.5 Hz, its motor turns at 3.3 Hz .* pulse widths \(BLE-PWM\)"):
        report(strut, -750, 200, 14.0)


def test_the_laboratorys_speed_has_the_sign_of_its_target_and_the_time_of_its_mean() -> None:
    strut = laboratory_strut()
    strut.tell(-600, 1, 10.3)
    report(strut, -600, 590, 10.6)

    assert strut.frequency_hz == pytest.approx(-9.83, abs=0.01)
    assert strut.measured_s == pytest.approx(10.35)
    assert strut.patience(0.5).stale_s == pytest.approx(0.7)
    assert strut.patience(0.5).settle_s == 4.0


def test_a_robots_file_with_rfduinos_is_refused_unless_it_allows_no_watchdog(tmp_path: Path) -> None:
    motor = {"strut": "R", "max_hz": 16.0, "curve": [[23, 1.7], [255, 16.0]]}
    for allowed, search, message in (
        (False, [0.0, 16.0], r"line\[1\].allow_no_watchdog is false, and an RFduino has no watchdog"),
        (True, [-16.0, 16.0], "search.low_hz is -16; allowed: 0 or more, since a motor of the robot turns one way"),
    ):
        content = {
            "line": [{"driver": "struts", "firmware": "rfduino", "allow_no_watchdog": allowed, "motor": [motor]}],
            "tracker": {"kind": "stream", "port": 5005},
            "search": dict(zip(("low_hz", "high_hz"), search, strict=True)),
        }
        path = tmp_path / "robot.json"
        path.write_bytes(msgspec.json.encode(content))
        with pytest.raises(NotUnderstood, match=message):
            load_robot_file(path)


@pytest.mark.parametrize("name", ["struts", "struts-laboratory", "struts-rfduino"])
def test_the_examples_of_robots_files_are_complete(name: str) -> None:
    robot = load_robot_file(Path(__file__).parents[3] / "examples" / "robots" / f"{name}.toml")

    assert isinstance(robot.line[0], StrutsLineTable)
    assert len(robot.motors) == 3


def test_a_speed_beyond_the_boards_is_refused_in_the_robots_file() -> None:
    table = StrutsLineTable(motor=(StrutTable(strut="S", max_hz=17.0),))
    with pytest.raises(ValueError, match=r"motor\[1\].max_hz is 17; allowed: up to 16.68"):
        table.check()


def test_rfduinos_are_driven_one_way_by_acknowledged_bytes(
    tmp_path_factory: pytest.TempPathFactory, caplog: pytest.LogCaptureFixture
) -> None:
    with MockProcess("struts", tmp_path_factory.mktemp("rf") / "port", "--firmware", "rfduino") as mock:
        path = Path(mock.greeting.robot_file)
        path.write_text(path.read_text().replace("allow_no_watchdog = false", "allow_no_watchdog = true"))
        with closing(open_motors(table_of(mock))) as motors:
            assert "RFduino has no watchdog" in caplog.text
            with pytest.raises(ValueError, match="turns one way"):
                motors.drive(GAIT, 0.25)
            drive_for(motors, 0.3, Gait((9.0, 11.0, 6.0)))
            state = motors.state()
            assert not state.measured
            assert state.frequency_hz == pytest.approx((9.0, 11.0, 6.0), abs=0.05)
            mock.wait_until(lambda s: s.applied_hz == pytest.approx((9.0, 11.0, 6.0), abs=0.1))
            motors.stop()
            mock.wait_until(lambda status: status.is_at_rest)


def test_the_watchdog_is_heard_of(own: MockProcess) -> None:
    with closing(open_line(table_of(own))) as line:
        line.send(GAIT)
        with pytest.raises(DeviceFault) as caught:
            line.listen(time.monotonic() + 1.0)
    assert caught.value.code == WATCHDOG
