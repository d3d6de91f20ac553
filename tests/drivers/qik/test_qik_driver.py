"""The qik driver on a pty, with the boards in a process of their own."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import Any, Literal

import msgspec
import pytest

from vvvaltr.controller.core.errors import DeviceFault, DeviceTimeout, LinkLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.robot.hardware import open_motors
from vvvaltr.drivers.held_motors import HeldMotors
from vvvaltr.drivers.links.curve import Curve
from vvvaltr.drivers.links.serial import SerialLink
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.process import MockProcess
from vvvaltr.drivers.motor_line import WATCHDOG
from vvvaltr.drivers.qik.line import QikLine, open_line
from vvvaltr.drivers.qik.mock import CURVE, QikDevice
from vvvaltr.drivers.qik.protocol import Opcode, Parameter, encode_packet, least_baud
from vvvaltr.drivers.qik.table import QikLineTable, QikMotorTable

GAIT = Gait((6.0, -11.5, 16.5))


def motor(board: int, output: Literal[0, 1], curve: Curve = CURVE, max_hz: float | None = None) -> QikMotorTable:
    return QikMotorTable(board=board, output=output, curve=curve.points, max_hz=max_hz or curve.highest_hz)


MOTORS = (motor(0, 0), motor(0, 1), motor(1, 0))


def table(port: str = "/dev/none", motors: Sequence[QikMotorTable] = MOTORS, **settings: Any) -> QikLineTable:
    return QikLineTable(port=port, motor=tuple(motors), **settings)


@pytest.fixture
def motors(qik: MockProcess) -> Iterator[HeldMotors]:
    with closing(HeldMotors(lambda: open_line(table(qik.greeting.port)))) as motors:
        yield motors


def hold(motors: HeldMotors, gait: Gait, duration_s: float) -> None:
    end_s = time.monotonic() + duration_s
    while time.monotonic() < end_s:
        motors.drive(gait, 0.25)
        time.sleep(0.02)
        motors.state()


class DirectLine:
    """Leads to boards in this process, without delay, and counts what is written."""

    name = "boards"

    def __init__(self) -> None:
        self.device = QikDevice()
        self.written = 0
        self._said = b""

    def write(self, data: bytes) -> None:
        self.written += len(data)
        self._said += self.device.on_bytes(data, 0.0)

    def read(self, size: int, watchdog_timeout_s: float) -> bytes:
        self._said += self.device.tick(1.0)
        said, self._said = self._said[:size], self._said[size:]
        return said

    def close(self) -> None:
        """Nothing is to be let go of."""


def armed(link: DirectLine, motors: Sequence[QikMotorTable], **settings: Any) -> QikLine:
    line = QikLine(link, table(motors=motors, **settings))
    link.write(b"\xaa")
    line.rest()
    return line


def test_watchdog_and_shutdown_are_switched_on_and_stay_so(qik: MockProcess, motors: HeldMotors) -> None:
    motors.close()
    link = SerialLink(qik.greeting.port, 19200)
    try:
        while link.read(10, 0.3):
            pass  # what was asked before the motors were closed may be answered late
        for board in (0, 1):
            for parameter in (Parameter.TIMEOUT, Parameter.SHUT_DOWN):
                link.write(encode_packet(board, Opcode.GET, parameter))
                assert link.read(10, 2.0) == b"\x01"
    finally:
        link.close()


def test_the_boards_apply_what_the_curve_says(qik: MockProcess, motors: HeldMotors) -> None:
    hold(motors, GAIT, 0.4)

    assert motors.state().frequency_hz == pytest.approx(GAIT.frequency_hz, abs=0.1)
    assert not motors.state().measured
    assert qik.wait_until(lambda status: not status.is_at_rest).applied_hz == pytest.approx(GAIT.frequency_hz, abs=0.1)


def test_a_frequency_beyond_the_curve_is_refused_and_nothing_is_sent(qik: MockProcess, motors: HeldMotors) -> None:
    with pytest.raises(ValueError, match=r"motor 2 of the line: 17 Hz is beyond the calibrated 16.5 Hz"):
        motors.drive(Gait((5.0, 17.0, 5.0)), 0.25)

    time.sleep(0.1)
    assert qik.wait_until(lambda status: True).is_at_rest


def test_a_slow_start_is_pushed(qik: MockProcess, motors: HeldMotors) -> None:
    slow = Gait((2.0, 0.0, 0.0))

    hold(motors, slow, 0.1)
    assert motors.state().frequency_hz[0] == pytest.approx(16.5)
    hold(motors, slow, 0.4)

    assert motors.state().frequency_hz[0] == pytest.approx(2.0, abs=0.1)
    assert qik.wait_until(lambda status: not status.is_at_rest).applied_hz[0] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(("max_hz", "command"), [(10.0, 69), (6.0, 40), (2.05, 16), (16.5, 127), (None, 127)])
def test_a_push_keeps_to_the_motors_limit(max_hz: float | None, command: int) -> None:
    motors = [motor(0, 0, max_hz=max_hz)]
    link = DirectLine()

    armed(link, motors).send(Gait((-2.05,)))

    assert link.device.boards[0].speeds[0] == -command


def test_the_limit_in_the_robots_file_holds_for_a_push(qik: MockProcess) -> None:
    with closing(open_motors(table(qik.greeting.port, [motor(0, 0, max_hz=10.0)]))) as motors:
        began_s = time.monotonic()
        hold(motors, Gait((2.0,)), 0.5)
        seen_hz = [status.applied_hz[0] for status in qik.statuses if status.t_s > began_s]

    assert 9.5 < max(seen_hz) <= 10.0
    assert seen_hz[-1] == pytest.approx(2.0, abs=0.1)


def test_a_motor_is_pushed_no_further_than_its_curve_goes() -> None:
    link = DirectLine()
    curve = Curve(((14.0, 1.8), (80.0, 11.5)))

    armed(link, [motor(0, 0, curve)]).send(Gait((2.0,)))

    assert link.device.boards[0].speeds[0] == 80


def test_a_changed_gait_goes_out_motor_by_motor() -> None:
    link = DirectLine()
    line = armed(link, MOTORS, spin_up_s=0.0)
    line.send(Gait((6.0, 6.0, 6.0)))
    before, changed = link.written, Gait((11.5, -11.5, 0.0))

    line.send(changed)
    assert link.written == before
    for repeats in (1, 2, 3):
        line.repeat(changed)
        assert link.written == before + 4 * repeats

    assert link.device.applied_hz == pytest.approx(changed.frequency_hz, abs=0.1)


def test_a_slow_start_among_turning_motors_is_pushed() -> None:
    link = DirectLine()
    line = armed(link, [msgspec.structs.replace(each, max_hz=10.0) for each in MOTORS], spin_up_s=0.05)
    line.send(Gait((6.0, 0.0, 6.0)))
    changed = Gait((6.0, 2.0, 6.0))

    for _ in MOTORS:
        line.repeat(changed)
    assert link.device.applied_hz == pytest.approx((6.0, 10.0, 6.0), abs=0.15)
    time.sleep(0.06)
    for _ in MOTORS:
        line.repeat(changed)

    assert link.device.applied_hz == pytest.approx((6.0, 2.0, 6.0), abs=0.1)


def test_a_stop_tells_all_motors_at_once_also_in_the_middle_of_a_change() -> None:
    link = DirectLine()
    line = armed(link, MOTORS)
    line.send(GAIT)
    line.repeat(GAIT.scaled(0.5))

    line.rest()

    assert link.device.applied_hz == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("timeout", [0, 4, 16, 32, 48, 64, 80, 96, 112, 127])
def test_there_are_no_boards_without_a_quick_watchdog(timeout: int) -> None:
    with pytest.raises(ValueError, match=rf"timeout is {timeout}, which means .*; allowed: 1 \(0\.262 s\), 2"):
        open_line(table("/dev/none", timeout=timeout))


def test_commands_that_the_boards_have_not_are_refused() -> None:
    motors = [motor(0, 0, Curve(((14.0, 1.8), (255.0, 16.5))))]

    with pytest.raises(ValueError, match="its commands reach 255; allowed: up to 127"):
        open_line(table("/dev/none", motors))


@pytest.mark.parametrize(
    ("motor_count", "has_crc", "baud"),
    [(1, False, 4800), (3, False, 9600), (3, True, 12000), (6, False, 16800), (6, True, 21000)],
)
def test_more_motors_need_a_faster_line(motor_count: int, has_crc: bool, baud: int) -> None:
    assert least_baud(motor_count, has_crc) == baud

    motors = [motor(number // 2, number % 2, CURVE) for number in range(motor_count)]
    with pytest.raises(ValueError, match=f"baud is {baud - 1}; allowed: {baud} or more"):
        open_line(table("/dev/none", motors, baud=baud - 1, crc=has_crc))
    with pytest.raises(LinkLost):
        open_line(table("/dev/none", motors, baud=baud, crc=has_crc))


@pytest.mark.parametrize("ramp_hz_s", [(), (8.0, 8.0, 8.0)], ids=["at once", "ramp"])
def test_on_the_slowest_line_a_stop_waits_for_nothing(qik: MockProcess, ramp_hz_s: tuple[float, ...]) -> None:
    baud = least_baud(len(MOTORS), has_crc=False)
    with closing(HeldMotors(lambda: open_line(table(qik.greeting.port, baud=baud)), ramp_hz_s)) as held:
        for step in range(160):  # another gait every 5 ms
            held.drive(Gait((6.0 + 0.05 * step, -8.0, 14.0 - 0.05 * step)), 0.25)
            time.sleep(0.005)
        assert any(held.state().frequency_hz)
        stopped_s = time.monotonic()
        held.stop()
        qik.wait_until(lambda status: status.t_s > stopped_s + 0.5)

    late_s = [status.t_s - stopped_s for status in qik.statuses if not status.is_at_rest]
    assert -0.2 < max(late_s) < 0.15


def test_a_board_that_is_not_there_is_named(qik: MockProcess) -> None:
    with pytest.raises(DeviceTimeout, match=r"no board answers as number 5; check power, wiring"):
        HeldMotors(lambda: open_line(table(qik.greeting.port, [motor(5, 0, CURVE)])))


@pytest.mark.parametrize("kind", [Kind.CORRUPT, Kind.DROP])
def test_a_board_whose_first_answers_are_spoilt_is_found_all_the_same(qik: MockProcess, kind: Kind) -> None:
    qik.inject(Fault(kind=kind, at_s=0.0, replies=2))
    time.sleep(0.1)

    open_line(table(qik.greeting.port)).close()


def test_a_port_that_is_not_there_is_a_lost_link() -> None:
    with pytest.raises(LinkLost, match="/dev/none"):
        open_line(table("/dev/none"))


def test_eight_bit_speeds_are_finer(qik: MockProcess) -> None:
    points = tuple((round(command * 255.0 / 127.0), hz) for command, hz in CURVE.points)
    motors = [msgspec.structs.replace(each, curve=points) for each in MOTORS]
    fine_table = table(qik.greeting.port, motors, eight_bit=True, spin_up_s=0.0)
    fine = Gait((11.56, 11.5, 11.45))

    with closing(HeldMotors(lambda: open_line(fine_table))) as held:
        hold(held, fine, 0.3)
        applied = qik.wait_until(lambda status: not status.is_at_rest).applied_hz

    assert applied == pytest.approx(fine.frequency_hz, abs=0.05)


@pytest.mark.parametrize(
    ("fault", "error", "code"),
    [
        (Fault(kind=Kind.ERROR, at_s=0.0, motor=1), DeviceFault, "frame error"),
        (Fault(kind=Kind.ERROR, at_s=0.0, motor=3, code=0x20), DeviceFault, "CRC error"),
        (Fault(kind=Kind.ERROR, at_s=0.0, motor=2, code=0x80), DeviceFault, WATCHDOG),
        (Fault(kind=Kind.DUPLICATE, at_s=0.0), DeviceFault, "sequence"),
        (Fault(kind=Kind.CORRUPT, at_s=0.0), DeviceFault, None),
        (Fault(kind=Kind.DROP, at_s=0.0), DeviceTimeout, None),
        (Fault(kind=Kind.DELAY, at_s=0.0, delay_s=0.22), DeviceTimeout, None),
        (Fault(kind=Kind.SILENCE, at_s=0.0, duration_s=0.3), DeviceTimeout, None),
        (Fault(kind=Kind.BROWN_OUT, at_s=0.0, duration_s=0.3), DeviceTimeout, None),
        (Fault(kind=Kind.UNPLUG, at_s=0.0, duration_s=0.3), LinkLost, None),
    ],
    ids=lambda value: str(value.kind) if isinstance(value, Fault) else "",
)
def test_every_fault_is_a_typed_error_stops_the_motors_and_can_be_recovered_from(
    qik: MockProcess, motors: HeldMotors, fault: Fault, error: type[Exception], code: str | None
) -> None:
    hold(motors, GAIT, 0.1)
    qik.inject(fault)

    with pytest.raises(error) as caught:
        hold(motors, GAIT, 1.0)

    assert code is None or getattr(caught.value, "code", None) == code
    with pytest.raises(error):
        motors.drive(GAIT, 0.25)
    qik.wait_until(lambda status: status.is_at_rest, timeout_s=0.5)
    motors.ready(patience_s=5.0)
    hold(motors, GAIT, 0.2)
    motors.stop()
