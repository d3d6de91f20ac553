"""The qik driver on a pty, with the boards in a process of their own."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import pytest

from controller.interface import DeviceFault, DeviceTimeout, LinkLost
from controller.types import Gait
from drivers.keepalive import WATCHDOG, HeldMotors
from drivers.mock.faults import Fault, Kind
from drivers.mock.process import MockProcess
from drivers.mock.qik import CURVE
from drivers.qik import Command, Parameter, QikMotor, QikSettings, open_line, packet
from drivers.serial_link import SerialLink

MOTORS = [QikMotor(0, 0, CURVE), QikMotor(0, 1, CURVE), QikMotor(1, 0, CURVE)]
GAIT = Gait((6.0, -11.5, 16.5))


@pytest.fixture
def motors(qik: MockProcess) -> Iterator[HeldMotors]:
    with closing(HeldMotors(lambda: open_line(qik.greeting.port, 19200, MOTORS, QikSettings()))) as motors:
        yield motors


def hold(motors: HeldMotors, gait: Gait, duration_s: float) -> None:
    end_s = time.monotonic() + duration_s
    while time.monotonic() < end_s:
        motors.drive(gait, 0.25)
        time.sleep(0.02)
        motors.state()


def test_watchdog_and_shutdown_are_switched_on_and_stay_so(qik: MockProcess, motors: HeldMotors) -> None:
    motors.close()
    link = SerialLink(qik.greeting.port, 19200)
    try:
        for board in (0, 1):
            for parameter in (Parameter.TIMEOUT, Parameter.SHUT_DOWN):
                link.write(packet(board, Command.GET, parameter))
                time.sleep(0.1)
                assert link.read(10, 0.0) == b"\x01"
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


def test_a_board_that_is_not_there_is_named(qik: MockProcess) -> None:
    with pytest.raises(DeviceTimeout, match=r"no board answers as number 5; check power, wiring"):
        HeldMotors(lambda: open_line(qik.greeting.port, 19200, [QikMotor(5, 0, CURVE)], QikSettings()))


def test_a_port_that_is_not_there_is_a_lost_link() -> None:
    with pytest.raises(LinkLost, match="/dev/none"):
        open_line("/dev/none", 19200, MOTORS, QikSettings())


def test_eight_bit_speeds_are_finer(qik: MockProcess) -> None:
    points = tuple((round(command * 255.0 / 127.0), hz) for command, hz in CURVE.points)
    motors = [replace(motor, curve=type(CURVE)(points)) for motor in MOTORS]
    settings = QikSettings(eight_bit=True, spin_up_s=0.0)
    fine = Gait((11.56, 11.5, 11.45))

    with closing(HeldMotors(lambda: open_line(qik.greeting.port, 19200, motors, settings))) as held:
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
    qik.befall(fault)

    with pytest.raises(error) as caught:
        hold(motors, GAIT, 1.0)

    assert code is None or getattr(caught.value, "code", None) == code
    with pytest.raises(error):
        motors.drive(GAIT, 0.25)
    qik.wait_until(lambda status: status.is_at_rest, timeout_s=0.5)
    motors.ready(patience_s=5.0)
    hold(motors, GAIT, 0.2)
    motors.stop()
