"""The motor node's driver against the node's own firmware, on the other end of a pseudo-terminal."""

import itertools
import threading
import time

import pytest

from vvvaltr.controller.core.errors import DeviceError, DeviceFault, DeviceTimeout, LinkLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.drivers.held_motors import HeldMotors
from vvvaltr.drivers.links.serial import SerialLink
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.plugged import PluggedDevice
from vvvaltr.drivers.mocking.port import PtyPort
from vvvaltr.drivers.node.firmware import core
from vvvaltr.drivers.node.line import open_line, open_node
from vvvaltr.drivers.node.mock import NodeDevice
from vvvaltr.drivers.node.table import NodeLineTable, NodeMotorTable

MOTORS = (NodeMotorTable(max_hz=16.7),) * 3
GAIT = Gait((12.0, -9.0, 4.0))
REST = (0.0, 0.0, 0.0)
BEFORE_WATCHDOG_S = 0.15  # the node's own is 0.2 s, and a busy computer sees late what was at once


class Node:
    """A mock node, running in a thread of its own."""

    def __init__(self, link):
        boots = itertools.count(1)
        self.device = NodeDevice(3, 16.7, lambda: next(boots), time.monotonic())
        self.port = str(link)
        self._plugged = PluggedDevice(self.device, PtyPort(link, is_paced=True))
        self._over = threading.Event()
        self._thread = threading.Thread(target=lambda: self._plugged.run(lambda _: self._over.is_set()))
        self._thread.start()

    def inject(self, kind, **details):
        self._plugged.inject(Fault(kind, at_s=0.0, **details))

    @property
    def applied_hz(self):
        return self._plugged.applied_hz

    def open(self):
        return open_line(NodeLineTable(port=self.port, motor=MOTORS))

    def close(self):
        self._over.set()
        self._thread.join()
        self._plugged.close()


@pytest.fixture
def node(tmp_path):
    node = Node(tmp_path / "node0")
    yield node
    node.close()


@pytest.fixture
def motors(node):
    motors = HeldMotors(node.open)
    yield motors
    motors.close()


def until(condition, within_s=3.0):
    """Wait for a condition; return how long it took."""
    begin_s = time.monotonic()
    while not condition():
        assert time.monotonic() - begin_s < within_s, "it did not happen in time"
        time.sleep(0.002)
    return time.monotonic() - begin_s


def drive_for(motors, duration_s):
    """Drive as a trial does, looking at the motors."""
    for _ in range(round(duration_s / 0.05)):
        motors.drive(GAIT, 0.25)
        time.sleep(0.05)
        motors.state()


def drive_until_reached(motors, within_s=5.0):
    """Drive until the motors turn as they are told: at once, but for a busy computer."""
    wanted = pytest.approx(GAIT.frequency_hz, rel=0.05)
    begin_s = time.monotonic()
    while (state := motors.state()).frequency_hz != wanted:
        assert time.monotonic() - begin_s < within_s, f"they turn at {state.frequency_hz}"
        drive_for(motors, 0.05)
    return state


def problem_of(motors, within_s=3.0, cause=lambda: None):
    """Drive, with the cause again and again, until the driver says what is wrong."""
    begin_s = time.monotonic()
    while time.monotonic() - begin_s < within_s:
        cause()
        try:
            drive_for(motors, 0.05)
        except DeviceError as error:
            return error
    raise AssertionError("nothing went wrong")


def test_it_knows_the_node_that_it_greeted(node):
    line = node.open()
    assert (line.motor_count, line.welcome.firmware, line.welcome.max_hz) == (3, core.VERSION, 16.7)
    line.close()


def test_the_node_turns_at_what_it_is_told_and_measures_it(motors):
    state = drive_until_reached(motors)
    assert state.measured
    assert len(state.current_a) == len(state.temperature_c) == 3
    assert 0.0 <= time.monotonic() - state.t_s < 0.25


def test_a_set_point_is_kept_alive_for_its_hold_and_no_longer(motors, node):
    begin_s = time.monotonic()
    motors.drive(GAIT, 0.6)
    until(lambda: all(node.applied_hz))
    until(lambda: node.applied_hz == REST)
    assert 0.55 < time.monotonic() - begin_s < 1.0
    motors.state()


def test_a_stop_is_applied_at_once(motors, node):
    drive_for(motors, 0.3)
    motors.stop()
    assert until(lambda: node.applied_hz == REST) < BEFORE_WATCHDOG_S
    motors.stop()


def test_closing_stops_first_and_may_be_done_twice(motors, node):
    drive_for(motors, 0.2)
    motors.close()
    until(lambda: node.applied_hz == REST, within_s=BEFORE_WATCHDOG_S)
    motors.close()


def test_a_frequency_that_the_node_cannot_reach_is_refused_before_it_is_sent(motors, node):
    with pytest.raises(ValueError, match=r"motor 2 of the line: -17 Hz is beyond the 16\.7 Hz of the node's firmware"):
        motors.drive(Gait((1.0, -17.0, 1.0)), 0.2)
    assert node.applied_hz == REST


def test_a_stall_is_a_fault_that_stays_until_the_motors_are_made_ready(motors, node):
    drive_for(motors, 0.3)
    node.inject(Kind.STALL, motor=2, duration_s=1.5)
    error = problem_of(motors)
    assert isinstance(error, DeviceFault) and error.code == "stall"
    assert "motor 2" in str(error)
    until(lambda: node.applied_hz == REST, within_s=BEFORE_WATCHDOG_S)
    with pytest.raises(DeviceFault, match="motor 2"):
        motors.state()
    with pytest.raises(DeviceFault, match="motor 2"):
        motors.drive(GAIT, 0.2)
    motors.ready(patience_s=1.0)
    drive_for(motors, 0.2)


def test_a_hot_motor_is_a_fault_that_cannot_be_cleared_while_it_is_hot(motors, node):
    node.inject(Kind.ERROR, motor=3, duration_s=0.8)
    error = problem_of(motors)
    assert isinstance(error, DeviceFault) and error.code == "over_temperature"
    with pytest.raises(DeviceFault, match="motor 3 reports over temperature"):
        motors.ready()
    motors.ready(patience_s=3.0)
    drive_for(motors, 0.2)


def test_a_node_that_has_rebooted_is_a_lost_link_until_it_is_greeted_again(motors, node):
    drive_for(motors, 0.2)
    node.inject(Kind.BROWN_OUT, duration_s=0.05)
    assert isinstance(problem_of(motors), LinkLost)
    motors.ready(patience_s=2.0)
    drive_until_reached(motors)


def test_an_unplugged_node_is_a_lost_link_until_it_is_plugged_in_again(motors, node):
    drive_for(motors, 0.2)
    node.inject(Kind.UNPLUG, duration_s=0.4)
    assert isinstance(problem_of(motors), LinkLost)
    motors.ready(patience_s=3.0)
    drive_for(motors, 0.2)


def test_a_node_that_says_nothing_is_a_timeout(motors, node):
    drive_for(motors, 0.2)
    node.inject(Kind.SILENCE, duration_s=0.8)
    assert isinstance(problem_of(motors), DeviceTimeout)
    until(lambda: node.applied_hz == REST, within_s=BEFORE_WATCHDOG_S)
    motors.ready(patience_s=2.0)


@pytest.mark.parametrize("kind", [Kind.DROP, Kind.CORRUPT, Kind.DUPLICATE])
def test_a_few_lost_damaged_or_repeated_messages_do_no_harm(motors, node, kind):
    drive_for(motors, 0.2)
    node.inject(kind, replies=5)
    drive_for(motors, 0.4)
    drive_until_reached(motors)


def test_telemetry_that_arrives_after_its_successor_is_a_fault(motors, node):
    drive_for(motors, 0.2)
    error = problem_of(motors, cause=lambda: node.inject(Kind.DELAY, replies=1, delay_s=0.2))
    assert isinstance(error, DeviceFault) and error.code == "sequence"
    time.sleep(0.3)  # until all that is delayed has come
    motors.ready()
    drive_for(motors, 0.2)


def test_lasting_delay_is_told_by_the_nodes_own_clock(motors, node):
    drive_for(motors, 0.2)
    node.inject(Kind.DELAY, replies=200, delay_s=0.4)
    assert isinstance(problem_of(motors), DeviceTimeout)


def test_a_gap_in_the_set_points_is_told(node):
    line = node.open()
    line.send(GAIT)
    until(lambda: node.device.watchdog)
    line.send(GAIT)
    with pytest.raises(DeviceFault, match="no command came in time") as caught:
        line.listen(time.monotonic() + 0.2)
    assert caught.value.code == "watchdog"
    line.close()


def test_a_node_of_another_version_is_refused_with_the_cure(node, monkeypatch):
    monkeypatch.setattr(core, "PROTOCOL", 9)
    with pytest.raises(DeviceFault, match=r"version 9 of the protocol.*flash the firmware"):
        node.open()


def test_a_line_without_a_node_is_a_timeout_with_the_cure(tmp_path):
    port = PtyPort(tmp_path / "nothing", is_paced=True)
    with pytest.raises(DeviceTimeout, match="no motor node answers; check power"):
        open_line(NodeLineTable(port=port.name, motor=MOTORS))
    port.close()


def test_noise_before_the_greeting_does_no_harm(node):
    link = SerialLink(node.port, 460_800)
    link.write(bytes(range(1, 200)))
    line = open_node(link, MOTORS)
    line.close()
