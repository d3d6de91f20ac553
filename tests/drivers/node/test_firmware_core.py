"""The firmware's core on a simulated board, told the time: what a motor node does, millisecond by millisecond."""

import itertools
import struct
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.drivers.node import protocol as host
from vvvaltr.drivers.node.firmware import core
from vvvaltr.drivers.node.firmware.control import TICKS, SpeedLoop, SpeedMeter
from vvvaltr.drivers.node.firmware.simulated_board import COUNTS_PER_TURN, SimulatedBoard
from vvvaltr.drivers.node.protocol import Ack, Fault, Flag, Status, Telemetry, Welcome

MAX_HZ = 16.7
RAMP_HZ_S = 100.0
SETTINGS = {
    "motors": 3,
    "max_mhz": 16700,
    "no_load_mhz": 20000,
    "ramp_mhz_s": 100000,
    "counts_per_turn": COUNTS_PER_TURN,
    "sensors": core.CURRENT | core.MOTOR_TEMPERATURE,
}


@dataclass
class Bench:
    """A node on the bench, a host's words to it, and a clock that goes on when told."""

    start_ms: int = 1000
    sequence: int = 0
    heard: list[host.Message] = field(default_factory=list)

    def __post_init__(self):
        self.now_ms = self.start_ms
        self.board = SimulatedBoard(3, 20.0)
        self.node = core.Node(self.board, SETTINGS, 77, self.now_ms & TICKS)
        self.decoder = host.Decoder()

    def say(self, frame: bytes) -> list[host.Message]:
        answers = self.decoder.feed(self.node.on_bytes(frame, self.now_ms & TICKS))
        self.heard += answers
        return answers

    def greet(self) -> "Bench":
        self.sequence = 100
        self.say(host.encode_hello(self.sequence))
        return self

    def command(self, frame, *values) -> Status:
        self.sequence = (self.sequence + 1) % host.SEQUENCES
        (ack,) = self.say(frame(self.sequence, *values))
        assert isinstance(ack, Ack) and ack.sequence == self.sequence
        return ack.status

    def wait(self, duration_ms: int) -> list[Telemetry]:
        told = []
        for _ in range(duration_ms):
            self.now_ms += 1
            self.board.step(self.now_ms * 1000)
            told += self.decoder.feed(self.node.tick(self.now_ms & TICKS, self.now_ms * 1000 & TICKS))
        self.heard += told
        return told

    def drive(self, frequency_hz, duration_ms: int) -> list[Telemetry]:
        """Repeat a set-point at 50 Hz."""
        told = []
        for _ in range(duration_ms // 20):
            self.command(host.encode_drive, frequency_hz, 0.2)
            told += self.wait(20)
        return told

    @property
    def turning_hz(self):
        return [motor.frequency_hz for motor in self.board.motors]

    @property
    def outputs(self):
        return [motor.output for motor in self.board.motors]


@pytest.fixture
def bench():
    return Bench().greet()


def test_it_says_who_it_is():
    (welcome,) = Bench().say(host.encode_hello(7))
    assert isinstance(welcome, Welcome)
    assert (welcome.sequence, welcome.protocol, welcome.firmware) == (7, host.PROTOCOL, core.VERSION)
    assert (welcome.motor_count, welcome.max_hz, welcome.ramp_hz_s) == (3, MAX_HZ, RAMP_HZ_S)
    assert (welcome.watchdog_s, welcome.telemetry_s, welcome.boot_id) == (0.25, 0.02, 77)
    assert welcome.sensors == host.Sensor.CURRENT | host.Sensor.MOTOR_TEMPERATURE


def test_the_motors_reach_their_frequencies_under_load_and_the_node_measures_them(bench):
    wanted = (12.0, -16.7, 4.0)
    last = bench.drive(wanted, 1000)[-1]
    assert bench.turning_hz == pytest.approx(wanted, rel=0.01)
    assert [motor.measured_hz for motor in last.motors] == pytest.approx(wanted, rel=0.01)
    assert Flag.DRIVING in last.flags


def test_slow_motors_do_not_hunt_though_their_edges_are_rare(bench):
    bench.drive((1.0, -1.0, 2.0), 2000)
    for _ in range(50):
        bench.drive((1.0, -1.0, 2.0), 20)
        assert bench.turning_hz == pytest.approx((1.0, -1.0, 2.0), rel=0.2)


def test_set_points_rise_no_faster_than_the_ramp_and_within_the_supply(bench):
    told = bench.drive((MAX_HZ, -MAX_HZ, 0.0), 200) + bench.drive((-MAX_HZ, MAX_HZ, 0.0), 500)
    ramped = [motor.ramped_hz for telemetry in told for motor in telemetry.motors[:1]]
    steps = [abs(after - before) for before, after in itertools.pairwise(ramped)]
    assert max(steps) <= RAMP_HZ_S * 0.031  # between two telemetries, and the moment at which the loop acts
    assert ramped[-1] == -MAX_HZ
    assert all(abs(motor.output) <= 1.0 for telemetry in told for motor in telemetry.motors)


def test_a_new_set_point_is_acted_on_at_the_next_tick(bench):
    bench.wait(5)
    bench.command(host.encode_drive, (10.0, 10.0, 10.0), 0.2)
    bench.wait(1)
    assert min(bench.outputs) > 0


@pytest.mark.parametrize(("hold_s", "stopped_after_ms"), [(0.08, 80), (0.2, 200), (1.0, 250), (60.0, 250)])
def test_the_motors_stop_when_hold_or_watchdog_runs_out(bench, hold_s, stopped_after_ms):
    bench.drive((10.0, 10.0, 10.0), 500)
    bench.command(host.encode_drive, (10.0, 10.0, 10.0), hold_s)
    bench.wait(stopped_after_ms - 1)
    assert min(bench.outputs) > 0
    bench.wait(1)
    assert bench.outputs == [0, 0, 0]
    assert bench.node.is_expired
    last = bench.wait(40)[-1]
    assert (last.flags, last.expiries) == (Flag.GREETED, 1)
    bench.command(host.encode_drive, (10.0, 10.0, 10.0), 0.2)
    last = bench.wait(40)[-1]
    assert (last.flags, last.expiries) == (Flag.GREETED | Flag.DRIVING, 1)
    assert not bench.node.is_expired


def test_without_a_greeting_only_a_stop_is_obeyed():
    bench = Bench()
    assert bench.command(host.encode_drive, (10.0, 10.0, 10.0), 0.2) is Status.NOT_GREETED
    assert bench.command(host.encode_clear) is Status.NOT_GREETED
    assert bench.command(host.encode_stop) is Status.OK
    bench.wait(40)
    assert bench.outputs == [0, 0, 0]


def test_another_version_of_the_protocol_is_not_greeted():
    bench = Bench()
    bench.say(host.encode_frame(struct.pack("<BHB", 1, 0, host.PROTOCOL + 1)))
    assert bench.command(host.encode_drive, (10.0, 10.0, 10.0), 0.2) is Status.NOT_GREETED


def test_a_greeting_stops_the_motors_of_an_earlier_host(bench):
    bench.drive((10.0, 10.0, 10.0), 100)
    bench.greet()
    assert bench.outputs == [0, 0, 0]


def test_a_repeated_or_overtaken_set_point_is_not_applied(bench):
    bench.command(host.encode_drive, (5.0, 5.0, 5.0), 0.2)
    (repeated,) = bench.say(host.encode_drive(bench.sequence, (9.0, 9.0, 9.0), 0.2))
    (overtaken,) = bench.say(host.encode_drive(bench.sequence - 5, (9.0, 9.0, 9.0), 0.2))
    assert (repeated.status, overtaken.status) == (Status.REPEATED, Status.OUT_OF_ORDER)
    assert [motor.ramped_hz for motor in bench.wait(150)[-1].motors] == [5.0, 5.0, 5.0]


def test_missing_and_damaged_commands_are_counted(bench):
    bench.sequence += 3
    bench.command(host.encode_drive, (5.0, 5.0, 5.0), 0.2)
    assert bench.say(b"\x05noise\0") == []
    last = bench.wait(20)[-1]
    assert (last.lost, last.bad_frames, last.command) == (3, 1, bench.sequence)


def test_sequence_numbers_go_round(bench):
    bench.say(host.encode_hello(65534))
    bench.sequence = 65534
    assert [bench.command(host.encode_drive, (5.0, 5.0, 5.0), 0.2) for _ in range(3)] == [Status.OK] * 3
    assert bench.sequence == 1


@pytest.mark.parametrize("sequence", [100, 99, 101, 60000])
def test_a_stop_is_obeyed_whatever_its_sequence_number(bench, sequence):
    bench.sequence = 99
    bench.greet()
    bench.drive((10.0, 10.0, 10.0), 200)
    (ack,) = bench.say(host.encode_stop(sequence))
    assert ack.status is Status.OK
    assert bench.outputs == [0, 0, 0]


@pytest.mark.parametrize(
    ("frequency_hz", "hold_s"),
    [((16.8, 0.0, 0.0), 0.2), ((0.0, -16.8, 0.0), 0.2), ((1.0, 1.0), 0.2), ((1.0,) * 4, 0.2), ((1.0,) * 3, 0.0)],
)
def test_a_set_point_that_it_cannot_apply_is_refused_as_a_whole(bench, frequency_hz, hold_s):
    assert bench.command(host.encode_drive, frequency_hz, hold_s) is Status.BAD_VALUE
    bench.wait(50)
    assert bench.outputs == [0, 0, 0]


def test_a_stalled_motor_stops_all_and_the_fault_stays_until_cleared(bench):
    bench.drive((10.0, 10.0, 10.0), 500)
    bench.board.motors[1].is_jammed = True
    told = bench.drive((10.0, 10.0, 10.0), 900)
    assert told[-1].motors[1].fault is Fault.NONE
    bench.drive((10.0, 10.0, 10.0), 1000)
    assert bench.outputs == [0, 0, 0]
    bench.board.motors[1].is_jammed = False
    assert bench.command(host.encode_drive, (10.0, 10.0, 10.0), 0.2) is Status.FAULTED
    bench.greet()
    assert [motor.fault for motor in bench.wait(40)[-1].motors] == [Fault.NONE, Fault.STALL, Fault.NONE]
    assert bench.command(host.encode_clear) is Status.OK
    assert bench.command(host.encode_drive, (10.0, 10.0, 10.0), 0.2) is Status.OK
    assert bench.wait(40)[-1].motors[1].fault is Fault.NONE


def test_a_hot_motor_stops_all_and_cannot_be_cleared_while_it_is_hot(bench):
    bench.drive((10.0, 10.0, 10.0), 200)
    bench.board.motors[2].is_hot = True
    last = bench.drive((10.0, 10.0, 10.0), 60)[-1]
    assert (last.motors[2].fault, last.motors[2].temperature_c) == (Fault.OVER_TEMPERATURE, 95.0)
    assert bench.outputs == [0, 0, 0]
    assert bench.command(host.encode_clear) is Status.FAULTED
    bench.board.motors[2].is_hot = False
    assert bench.command(host.encode_clear) is Status.OK
    assert bench.command(host.encode_drive, (10.0, 10.0, 10.0), 0.2) is Status.OK


def test_telemetry_comes_every_20_ms_with_a_number_and_the_time(bench):
    told = bench.wait(1000)
    assert len(told) == 50
    assert [later.sequence - sooner.sequence for sooner, later in itertools.pairwise(told)] == [1] * 49
    assert {later.device_ms - sooner.device_ms for sooner, later in itertools.pairwise(told)} == {20}
    assert {telemetry.boot_id for telemetry in told} == {77}
    assert told[0].acceleration_m_s2 is None


def test_after_a_pause_telemetry_is_not_made_up_for(bench):
    bench.now_ms += 500
    assert len(bench.wait(100)) <= 6


def test_it_goes_on_when_its_clocks_begin_again():
    bench = Bench(start_ms=TICKS + 1 - 500).greet()
    told = bench.drive((10.0, -10.0, 5.0), 1000)
    assert len(told) == 50
    assert bench.turning_hz == pytest.approx((10.0, -10.0, 5.0), rel=0.01)
    bench.wait(250)
    assert bench.outputs == [0, 0, 0]


def test_the_integral_does_not_wind_up_while_the_supply_is_exhausted():
    loop = SpeedLoop(no_load_mhz=20000, ramp_mhz_s=1000000)
    loop.target_mhz = 16000
    for _ in range(90):
        loop.regulate(measured_mhz=1000, is_news=True, elapsed_ms=10)  # far too great a load, for 0.9 s
    assert loop.output == 1000
    loop.target_mhz = 8000
    assert loop.regulate(measured_mhz=9000, is_news=True, elapsed_ms=10) < 600


def test_a_load_that_vanishes_does_not_leave_the_motor_at_full_speed():
    loop = SpeedLoop(no_load_mhz=20000, ramp_mhz_s=10**6)
    loop.target_mhz = 8000
    for _ in range(90):
        loop.regulate(measured_mhz=6000, is_news=True, elapsed_ms=10)
    loop.target_mhz = 16000
    outputs = [loop.regulate(measured_mhz=20000, is_news=True, elapsed_ms=10) for _ in range(50)]
    assert outputs[0] == 1000
    assert outputs[-1] < 800


@pytest.mark.parametrize(("output_share", "stalls"), [(0.10, False), (0.14, False), (0.16, True), (-0.5, True)])
def test_a_motor_that_does_not_follow_a_considerable_output_for_a_second_is_stalled(output_share, stalls):
    loop = SpeedLoop(no_load_mhz=20000, ramp_mhz_s=10**6)
    loop.target_mhz = round(20000 * output_share)
    told = []
    for _ in range(100):
        loop.regulate(measured_mhz=loop.target_mhz, is_news=True, elapsed_ms=10)
        told.append(loop.is_stalled(edge_mhz=0, elapsed_ms=10))
    assert told == [False] * 99 + [stalls]
    assert loop.is_stalled(edge_mhz=-loop.target_mhz, elapsed_ms=10) == stalls
    assert not loop.is_stalled(edge_mhz=loop.target_mhz, elapsed_ms=10)


@given(st.floats(0.5, 300.0), st.integers(1, 50), st.booleans())
def test_the_meter_measures_a_steady_frequency(frequency_hz, counts_per_turn, backwards):
    meter = SpeedMeter(counts_per_turn)
    sense = -1 if backwards else 1
    for now_us in range(0, 6_000_000, 50_000):
        count = int(now_us * 1e-6 * frequency_hz * counts_per_turn)
        edge_us = int(count / (frequency_hz * counts_per_turn) * 1e6)
        meter.update(sense * count, edge_us, now_us)
    assert meter.mhz == pytest.approx(sense * 1000 * frequency_hz, rel=0.01)


def test_the_meter_reads_zero_at_a_standstill_and_after_it_begins_afresh():
    meter = SpeedMeter(7)
    for edge in range(10):
        meter.update(edge, edge * 10000, edge * 10000)
    assert meter.mhz == pytest.approx(14286, abs=2)
    meter.update(9, 90000, 1_500_000)
    assert meter.mhz == 0
    meter.update(10, 3_000_000, 3_000_000)
    assert meter.mhz == 0
    meter.update(11, 3_010_000, 3_010_000)
    assert meter.mhz == pytest.approx(14286, abs=2)


@given(st.lists(st.binary(min_size=1, max_size=60), max_size=20))
def test_well_framed_nonsense_moves_no_motor_and_breaks_nothing(nonsense):
    bench = Bench()
    for payload in nonsense:
        bench.say(host.encode_frame(payload))
        bench.wait(1)
    bench.say(host.encode_hello(0))
    bench.sequence = 0
    assert bench.command(host.encode_drive, (1.0, 1.0, 1.0), 0.2) is Status.OK
