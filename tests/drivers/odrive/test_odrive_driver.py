"""The ODrive driver over slcan, with the axes in a process of their own; and on a virtual bus."""

from __future__ import annotations

import itertools
import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import can
import msgspec
import pytest
from can.interfaces.virtual import VirtualBus

from vvvaltr.controller.core.errors import DeviceFault, DeviceTimeout, LinkLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.drivers.held_motors import HeldMotors
from vvvaltr.drivers.links.can import CanLink, Frame
from vvvaltr.drivers.mocking.can_adapter import BusPort, SlcanAdapter
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.plugged import PluggedDevice
from vvvaltr.drivers.mocking.process import MockProcess
from vvvaltr.drivers.motor_line import WATCHDOG
from vvvaltr.drivers.odrive.line import OdriveLine, open_line
from vvvaltr.drivers.odrive.mock import OdriveAxis, OdriveDevice
from vvvaltr.drivers.odrive.protocol import AxisState, Message, encode
from vvvaltr.drivers.odrive.table import Firmware, OdriveLineTable, OdriveMotorTable

MOTORS = tuple(OdriveMotorTable(node=node, max_hz=16.5) for node in range(3))
GAIT = Gait((6.0, -11.5, 16.5))
CHANNELS = map(str, itertools.count())


def table(interface: str, channel: str, **settings: Any) -> OdriveLineTable:
    return OdriveLineTable(interface=interface, channel=channel, **{"motor": MOTORS, **settings})


@pytest.fixture
def motors(odrive: MockProcess) -> Iterator[HeldMotors]:
    with closing(HeldMotors(lambda: open_line(table("slcan", odrive.greeting.port)))) as motors:
        yield motors


def hold(motors: HeldMotors, gait: Gait, duration_s: float) -> None:
    end_s = time.monotonic() + duration_s
    while time.monotonic() < end_s:
        motors.drive(gait, 0.25)
        time.sleep(0.02)
        motors.state()


def test_the_axes_turn_as_told_and_say_so(odrive: MockProcess, motors: HeldMotors) -> None:
    hold(motors, GAIT, 0.4)

    state = motors.state()
    assert state.frequency_hz == pytest.approx(GAIT.frequency_hz)
    assert state.measured
    assert len(state.current_a) == 3
    assert odrive.wait_until(lambda status: not status.is_at_rest).applied_hz == pytest.approx(GAIT.frequency_hz)


def test_a_stop_leaves_the_axes_idle(odrive: MockProcess, motors: HeldMotors) -> None:
    hold(motors, GAIT, 0.2)

    motors.stop()

    odrive.wait_until(lambda status: status.is_at_rest)
    time.sleep(0.5)
    motors.state()


def test_a_velocity_beyond_the_curve_of_an_axis_is_refused(odrive: MockProcess) -> None:
    curved = tuple(msgspec.structs.replace(motor, curve=((1.0, 1.0), (16.5, 16.5))) for motor in MOTORS)
    line_table = table("slcan", odrive.greeting.port, motor=curved)

    with (
        closing(HeldMotors(lambda: open_line(line_table))) as motors,
        pytest.raises(ValueError, match=r"motor 3 of the line: 17 Hz is beyond the calibrated 16.5 Hz"),
    ):
        motors.drive(Gait((5.0, 5.0, 17.0)), 0.25)


def test_an_axis_that_is_not_there_is_named(odrive: MockProcess) -> None:
    with pytest.raises(DeviceTimeout, match=r"no heartbeat from axis 9; check power, wiring"):
        open_line(table("slcan", odrive.greeting.port, motor=(OdriveMotorTable(node=9, max_hz=10.0),)))


@pytest.mark.parametrize("interface", ["slcan", "socketcan"])
def test_a_bus_that_is_not_there_is_a_lost_link(interface: str) -> None:
    with pytest.raises(LinkLost, match=f"{interface}:none"):
        open_line(table(interface, "none"))


@pytest.mark.parametrize(
    ("fault", "error", "code"),
    [
        (Fault(kind=Kind.ERROR, at_s=0.0, motor=2), DeviceFault, "supply voltage too low"),
        (Fault(kind=Kind.ERROR, at_s=0.0, motor=1, code=0x01000000), DeviceFault, WATCHDOG),
        (Fault(kind=Kind.STALL, at_s=0.0, motor=3, duration_s=0.4), DeviceFault, "stall"),
        (Fault(kind=Kind.SILENCE, at_s=0.0, duration_s=0.6), DeviceTimeout, None),
        (Fault(kind=Kind.BROWN_OUT, at_s=0.0, duration_s=0.6), DeviceTimeout, None),
        (Fault(kind=Kind.BROWN_OUT, at_s=0.0, duration_s=0.05), DeviceFault, "stall"),
        (Fault(kind=Kind.UNPLUG, at_s=0.0, duration_s=0.3), LinkLost, None),
    ],
    ids=lambda value: str(value.kind) if isinstance(value, Fault) else "",
)
def test_every_fault_is_a_typed_error_stops_the_motors_and_can_be_recovered_from(
    odrive: MockProcess, motors: HeldMotors, fault: Fault, error: type[Exception], code: str | None
) -> None:
    hold(motors, GAIT, 0.2)
    odrive.inject(fault)

    with pytest.raises(error) as caught:
        hold(motors, GAIT, 1.5)

    assert code is None or getattr(caught.value, "code", None) == code
    odrive.wait_until(lambda status: status.is_at_rest, timeout_s=0.5)
    motors.ready(patience_s=5.0)
    hold(motors, GAIT, 0.2)
    motors.stop()


@pytest.mark.parametrize("kind", [Kind.CORRUPT, Kind.DUPLICATE, Kind.DROP])
def test_a_few_lost_or_garbled_frames_of_a_hundred_a_second_do_no_harm(
    odrive: MockProcess, motors: HeldMotors, kind: Kind
) -> None:
    hold(motors, GAIT, 0.2)

    odrive.inject(Fault(kind=kind, at_s=0.0, replies=2))
    try:
        hold(motors, GAIT, 0.5)
    except DeviceFault as fault:
        assert kind is Kind.CORRUPT, fault  # a wrong bit of a heartbeat can be an error


@contextmanager
def on_a_virtual_bus(device: OdriveDevice) -> Iterator[str]:
    channel = next(CHANNELS)
    plugged = PluggedDevice(SlcanAdapter(device, is_open=True), BusPort("virtual", channel, 500_000))
    is_over = threading.Event()

    def run() -> None:
        while not is_over.is_set():
            plugged.step(time.monotonic())
            plugged.wait()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield channel
    finally:
        is_over.set()
        thread.join()
        plugged.close()


@pytest.mark.parametrize("firmware", list(Firmware))
def test_a_virtual_bus_and_both_firmware_generations_do_as_well(firmware: Firmware) -> None:
    device = OdriveDevice(firmware=firmware)
    with (
        on_a_virtual_bus(device) as channel,
        closing(HeldMotors(lambda: open_line(table("virtual", channel, firmware=firmware)))) as motors,
    ):
        hold(motors, GAIT, 0.3)
        assert device.applied_hz == pytest.approx(GAIT.frequency_hz)
        device.axes[1].fail(device.axes[1].bit(WATCHDOG))
        with pytest.raises(DeviceFault) as caught:
            hold(motors, GAIT, 0.5)

    assert caught.value.code == WATCHDOG
    assert device.applied_hz == (0.0, 0.0, 0.0)


def test_an_emergency_stop_disarms_until_a_new_start() -> None:
    device = OdriveDevice()
    with on_a_virtual_bus(device) as channel, closing(open_line(table("virtual", channel))) as line:
        line.send(GAIT)
        line.estop()
        time.sleep(0.05)
        line.send(GAIT)
        time.sleep(0.05)

        assert device.applied_hz == (0.0, 0.0, 0.0)
        assert all(axis.error == 0x02000000 for axis in device.axes)


class Stubborn(OdriveAxis):
    """Arms and never disarms."""

    def _request(self, state: int, now_s: float) -> None:
        if state == AxisState.CLOSED_LOOP:
            super()._request(state, now_s)


class HeldUpLink(CanLink):
    """Falls asleep between arming the first axis and arming the second, while the other thread listens on."""

    line: OdriveLine

    def send(self, frame: Frame) -> None:
        if frame == encode(1, Message.SET_STATE, AxisState.CLOSED_LOOP):
            self.line.listen(time.monotonic() + 0.12)  # a heartbeat or two
        super().send(frame)


def test_an_axis_that_is_armed_before_the_next_one_is_told_is_no_cause_for_an_emergency_stop() -> None:
    device = OdriveDevice()
    with on_a_virtual_bus(device) as channel:
        link = HeldUpLink("virtual", channel, 500_000)
        with closing(OdriveLine(link, table("virtual", channel))) as line:
            link.line = line
            line.arm()
            rested_s = time.monotonic()
            while time.monotonic() < rested_s + 0.4:
                line.rest()
                line.listen(time.monotonic() + 0.02)

            line.send(GAIT)
            line.listen(time.monotonic() + 0.05)

            assert device.applied_hz == pytest.approx(GAIT.frequency_hz)


def test_an_axis_that_stays_armed_is_stopped_by_force() -> None:
    device = OdriveDevice()
    device.axes[1] = Stubborn(1, Firmware.NEW)
    with on_a_virtual_bus(device) as channel, closing(open_line(table("virtual", channel))) as line:
        line.send(GAIT)
        with pytest.raises(DeviceFault) as caught:
            for _ in range(50):
                line.rest()
                line.listen(time.monotonic() + 0.02)
        time.sleep(0.05)

    assert caught.value.code == "disobedient"
    assert device.axes[1].state == AxisState.IDLE


class SocketBus(VirtualBus):
    """After its end it does what a socketcan bus does: it waits for a socket that is closed."""

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self._is_shutdown:
            with socket.socket() as closed:
                closed.close()
                select.select([], [closed], [], timeout)
        super().send(msg, timeout)


@pytest.fixture
def socket_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can, "Bus", lambda interface, channel, bitrate, ignore_config: SocketBus(channel=channel))


@pytest.mark.usefixtures("socket_bus")
def test_sending_on_a_closed_bus_is_a_lost_link() -> None:
    link = CanLink("socketcan", next(CHANNELS), 500_000)
    link.close()
    link.close()

    with pytest.raises(LinkLost, match="socketcan:"):
        link.send(Frame(0x21))


@pytest.mark.usefixtures("socket_bus")
def test_a_bus_that_is_not_back_yet_is_opened_again_and_closed_twice() -> None:
    device = OdriveDevice()
    absences = iter([False, True, True])

    def open_or_not() -> OdriveLine:
        if next(absences, False):
            raise LinkLost("not plugged in yet")
        return open_line(table("virtual", channel))

    with on_a_virtual_bus(device) as channel:
        motors = HeldMotors(open_or_not)
        device.axes[1].fail(device.axes[1].bit(WATCHDOG))
        with pytest.raises(DeviceFault):
            hold(motors, GAIT, 0.5)
        motors.ready(patience_s=5.0)
        hold(motors, GAIT, 0.1)
        motors.close()
        motors.close()


def test_error_frames_on_the_bus_and_other_traffic_are_passed_over() -> None:
    with closing(CanLink("virtual", "noisy", 500_000)) as link, can.Bus(interface="virtual", channel="noisy") as other:
        other.send(can.Message(is_error_frame=True))
        other.send(can.Message(arbitration_id=0x12345, is_extended_id=True))
        other.send(can.Message(arbitration_id=0x21, data=b"\1\2", is_extended_id=False))

        frames = list(link.frames(time.monotonic() + 0.05))

    assert frames == [Frame(0x21, b"\1\2")]
