"""What all drivers share, on a line that does as the test says."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field

import pytest

from vvvaltr.controller.core.errors import DeviceError, DeviceFault, DeviceTimeout, LinkLost
from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState
from vvvaltr.drivers.held_motors import HeldMotors
from vvvaltr.drivers.motor_line import Patience

GAIT = Gait((10.0,))


@dataclass
class Line:
    """A line to one motor that follows at once, unless told otherwise."""

    name: str = "line"
    motor_count: int = 1
    quantities: frozenset[Quantity] = frozenset({Quantity.FREQUENCY})
    period_s: float = 0.01
    watchdog_s: float = 0.25
    heard_s: float = field(default_factory=time.monotonic)
    sent: list[tuple[float, float]] = field(default_factory=list)
    error: Exception | None = None
    is_silent: bool = False
    is_stalled: bool = False
    measured: bool = True
    slack_hz: float = 0.0
    patience: Patience = Patience(stale_s=0.15)  # noqa: RUF009
    is_closed: bool = False

    def check(self, gait: Gait) -> None:
        if abs(gait.frequency_hz[0]) > 20.0:
            raise ValueError("20 Hz at most")

    def send(self, gait: Gait) -> None:
        self.sent.append((time.monotonic(), gait.frequency_hz[0]))

    repeat = send

    def rest(self) -> None:
        self.sent.append((time.monotonic(), 0.0))

    def listen(self, until_s: float) -> None:
        time.sleep(max(0.0, until_s - time.monotonic()))
        if self.error is not None:
            raise self.error
        if not self.is_silent:
            self.heard_s = time.monotonic()

    def state(self) -> MotorState:
        applied_hz = 0.0 if self.is_stalled else max(0.0, self.sent[-1][1] - self.slack_hz)
        return MotorState(self.heard_s, (applied_hz,), self.measured)

    def close(self) -> None:
        self.is_closed = True

    def sent_since(self, t_s: float) -> list[float]:
        return [value for sent_s, value in self.sent if sent_s >= t_s]


def raising(error: BaseException) -> Callable[..., None]:
    def act(*_: float) -> None:
        raise error

    return act


@contextmanager
def held(ramp_hz_s: tuple[float, ...] = ()) -> Iterator[tuple[HeldMotors, list[Line]]]:
    lines: list[Line] = []

    def open_line() -> Line:
        lines.append(Line())
        return lines[-1]

    with closing(HeldMotors(open_line, ramp_hz_s=ramp_hz_s)) as motors:
        yield motors, lines


def test_a_set_point_is_repeated_until_its_hold_has_run_out_and_then_the_motors_rest() -> None:
    with held() as (motors, (line,)):
        begun_s = time.monotonic()
        motors.drive(GAIT, 0.1)
        time.sleep(0.2)

        driven = [sent_s - begun_s for sent_s, value in line.sent if value == 10.0]
        assert len(driven) >= 6
        assert 0.05 < max(driven) <= 0.101
        assert set(line.sent_since(begun_s + 0.12)) == {0.0}


def test_a_stop_is_sent_at_once_and_waits_for_the_devices_next_word() -> None:
    with held() as (motors, (line,)):
        motors.drive(GAIT, 1.0)
        stopped_s = time.monotonic()
        motors.stop()

        rested_s = next(sent_s for sent_s, value in line.sent if sent_s >= stopped_s and value == 0.0)
        assert rested_s < stopped_s + 0.05
        assert line.heard_s > rested_s


@pytest.mark.parametrize("kind", [DeviceFault("hot", "too hot"), DeviceTimeout("late"), LinkLost("gone")])
def test_an_error_is_raised_by_everything_until_the_line_is_opened_afresh(kind: DeviceError) -> None:
    with held() as (motors, lines):
        motors.drive(GAIT, 1.0)
        lines[0].error = kind
        time.sleep(0.05)

        for call in (lambda: motors.drive(GAIT, 1.0), motors.state, motors.stop):
            with pytest.raises(type(kind), match=str(kind)):
                call()
        motors.ready()
        motors.drive(GAIT, 1.0)

        assert len(lines) == 2 and lines[0].is_closed
        assert lines[1].sent[-1][1] == 10.0


def test_a_lost_line_is_closed_at_once() -> None:
    with held() as (motors, (line,)):
        motors.drive(GAIT, 1.0)
        line.error = LinkLost("gone")
        time.sleep(0.05)

        assert line.is_closed


def test_a_line_that_has_been_closed_is_told_nothing_however_long_it_takes_to_open_it_again() -> None:
    lines: list[Line] = []
    refusals = [LinkLost("not plugged in"), LinkLost("not plugged in")]

    def open_line() -> Line:
        if lines and refusals:
            raise refusals.pop()
        lines.append(Line())
        return lines[-1]

    with closing(HeldMotors(open_line)) as motors:
        motors.park()
        parked = len(lines[0].sent)
        motors.ready(patience_s=1.0)
        motors.park()

    assert len(lines) == 2 and all(line.is_closed for line in lines)
    assert len(lines[0].sent) == parked


def test_after_a_fault_the_motors_are_told_to_rest_again_and_again() -> None:
    with held() as (motors, (line,)):
        motors.drive(GAIT, 1.0)
        line.error = DeviceFault("hot", "too hot")
        time.sleep(0.1)

        assert line.sent_since(time.monotonic() - 0.05).count(0.0) >= 3


def test_a_device_that_has_gone_quiet_is_a_timeout() -> None:
    with held() as (motors, (line,)):
        line.is_silent = True
        time.sleep(0.25)

        with pytest.raises(DeviceTimeout, match=r"no message from the device for 0\.\d+ s"):
            motors.state()


def test_a_motor_that_does_not_start_or_falls_behind_has_stalled() -> None:
    with held() as (motors, (line,)):
        motors.drive(GAIT, 5.0)
        time.sleep(0.1)
        line.is_stalled = True
        time.sleep(0.25)

        with pytest.raises(DeviceFault, match=r"motor 1 of the line turns at 0 Hz instead of 10 Hz") as caught:
            motors.state()

    assert caught.value.code == "stall"


def test_a_motor_that_fell_behind_just_before_the_stop_has_stalled() -> None:
    with held() as (motors, (line,)):
        motors.drive(GAIT, 5.0)
        time.sleep(0.1)
        line.is_stalled = True
        time.sleep(0.085)

        with pytest.raises(DeviceFault, match="turns at 0 Hz instead of 10 Hz"):
            motors.stop()
        assert line.sent[-1][1] == 0.0


def test_without_a_sensor_nothing_is_said_of_a_stall() -> None:
    with held() as (motors, (line,)):
        line.measured = False
        line.is_stalled = True
        motors.drive(GAIT, 5.0)
        time.sleep(0.8)

        motors.state()


def test_a_defect_in_a_protocol_rests_the_motors_and_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("threading.excepthook", lambda _: None)  # what pytest would report as a failure of its own
    with held() as (motors, (line,)):
        motors.drive(GAIT, 1.0)
        line.error = ZeroDivisionError("oops")
        time.sleep(0.05)

        with pytest.raises(DeviceFault, match="ZeroDivisionError: oops"):
            motors.drive(GAIT, 1.0)
        assert line.sent[-1][1] == 0.0


def test_a_system_without_real_time_priority_drives_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.EINVAL, "Invalid argument")

    monkeypatch.setattr("os.sched_setscheduler", refuse)
    with held() as (motors, (line,)):
        motors.drive(GAIT, 1.0)
        time.sleep(0.1)

        assert line.sent_since(0.0).count(10.0) >= 3


def test_a_slow_ramp_gives_the_motor_time_to_start() -> None:
    with held(ramp_hz_s=(4.0,)) as (motors, (line,)):
        line.slack_hz = 0.3
        motors.drive(GAIT, 5.0)
        time.sleep(0.6)

        assert motors.state().frequency_hz[0] < 3.0


def test_a_line_that_fails_at_once_is_told_to_rest_twice_a_period_at_most() -> None:
    with held() as (motors, (line,)):
        motors.drive(GAIT, 1.0)
        line.listen = raising(DeviceFault("noise", "noise"))  # type: ignore[method-assign]
        time.sleep(0.1)
        begun_s = time.monotonic()
        time.sleep(0.3)

        assert 10 <= len(line.sent_since(begun_s)) <= 62  # as the period begins, and when it fails


def test_a_ramp_limits_the_change_of_frequency_and_begins_from_rest() -> None:
    with held(ramp_hz_s=(50.0,)) as (motors, (line,)):
        begun_s = time.monotonic()
        motors.drive(GAIT, 5.0)
        time.sleep(0.35)
        rising = [(sent_s - begun_s, value) for sent_s, value in line.sent if sent_s >= begun_s]
        motors.stop()
        motors.drive(GAIT, 5.0)

        assert all(value <= 50.0 * after_s + 0.1 for after_s, value in rising)
        assert rising[-1][1] == 10.0
        assert line.sent[-1][1] < 2.0


def test_what_the_line_cannot_encode_is_refused_and_nothing_sent() -> None:
    with held() as (motors, (line,)):
        with pytest.raises(ValueError, match="at most"):
            motors.drive(Gait((21.0,)), 1.0)

        assert set(line.sent_since(0.0)) <= {0.0}


def test_an_interrupt_while_the_line_is_closed_leaves_it_closed() -> None:
    with held() as (motors, (line,)):
        motors.drive(GAIT, 1.0)
        motors.send_stop, stop = raising(KeyboardInterrupt("SIGINT")), motors.send_stop  # type: ignore[method-assign]
        with pytest.raises(KeyboardInterrupt):
            motors.close()
        motors.send_stop = stop  # type: ignore[method-assign]

        assert line.is_closed


def test_closing_twice_does_no_harm() -> None:
    with held() as (motors, (line,)):
        motors.close()
        motors.close()
        motors.stop()

        assert line.is_closed
        assert line.sent[-1][1] == 0.0
