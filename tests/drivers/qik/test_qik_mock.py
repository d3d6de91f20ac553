"""The mock boards, as other programs than ours talk to them: byte for byte from the controller's user's guide."""

from __future__ import annotations

import pytest

from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.qik.mock import CURVE, QikDevice
from vvvaltr.drivers.qik.protocol import compute_crc7, watchdog_timeout_s

FULL_HZ = CURVE.highest_hz


def awake(**options: bool) -> QikDevice:
    device = QikDevice(**options)
    device.on_bytes(b"\xaa", 0.0)
    return device


def alone() -> QikDevice:
    """One board with its two outputs, for programs that speak the compact protocol."""
    device = QikDevice(((9, 0), (9, 1)))
    device.on_bytes(b"\xaa", 0.0)
    return device


def test_the_published_robots_program_turns_all_three_motors() -> None:
    device = QikDevice()
    # Spin-up at full speed, then the speeds; its packets are five bytes long and end with a zero.
    spin_up = bytes.fromhex("AA00097F00 AA000E7F00 AA01097F00")
    speeds = bytes.fromhex("AA00092800 AA000E5000 AA01091400")

    device.on_bytes(spin_up, 0.0)
    assert device.applied_hz == pytest.approx((FULL_HZ, -FULL_HZ, FULL_HZ))
    device.on_bytes(speeds, 0.2)

    assert device.applied_hz == pytest.approx((6.0, -11.5, CURVE.frequency_hz(20.0)))
    assert device.faults == ()


def test_the_published_robots_program_stops_all_motors() -> None:
    device = QikDevice()
    device.on_bytes(bytes.fromhex("AA00097F00 AA000C7F00 AA01097F00"), 0.0)

    device.on_bytes(bytes.fromhex("AA00090000 AA000C0000 AA01090000"), 1.0)

    assert device.applied_hz == (0.0, 0.0, 0.0)
    assert device.faults == ()


def test_the_arduino_librarys_start_and_speeds_are_understood() -> None:
    device = QikDevice(((9, 0), (9, 1)))

    assert device.on_bytes(b"\xaa", 0.0) == b""
    assert device.on_bytes(b"\x81", 0.0) == b"2"
    assert device.on_bytes(b"\x82", 0.0) == b"\0"
    device.on_bytes(bytes((0x88, 127, 0x8E, 40)), 0.0)

    assert device.applied_hz == pytest.approx((FULL_HZ, -6.0))


def test_the_arduino_library_reads_and_sets_parameters() -> None:
    device = alone()

    assert device.on_bytes(bytes((0x83, 3)), 0.0) == b"\0"
    assert device.on_bytes(bytes((0x84, 3, 1, 0x55, 0x2A)), 0.0) == b""
    assert device.tick(0.01) == b"\0"
    assert device.on_bytes(bytes((0x83, 3)), 0.02) == b"\x01"


def test_coasting_stops_one_motor() -> None:
    device = alone()
    device.on_bytes(bytes((0x88, 127, 0x8C, 127)), 0.0)

    device.on_bytes(b"\x86", 0.1)

    assert device.applied_hz == pytest.approx((0.0, FULL_HZ))


def test_before_the_byte_that_tells_the_baud_rate_nothing_is_understood() -> None:
    device = QikDevice()

    assert device.on_bytes(bytes((0x88, 127, 0x81)), 0.0) == b""
    assert device.applied_hz == (0.0, 0.0, 0.0)


def test_with_a_fixed_baud_rate_no_such_byte_is_needed() -> None:
    device = QikDevice(((9, 0),), has_fixed_baud=True)

    assert device.on_bytes(b"\x81", 0.0) == b"2"


def test_a_packet_for_another_board_is_ignored() -> None:
    device = awake()

    assert device.on_bytes(bytes((0xAA, 5, 0x01)), 0.0) == b""
    device.on_bytes(bytes((0xAA, 5, 0x08, 127)), 0.0)

    assert device.applied_hz == (0.0, 0.0, 0.0)
    assert device.faults == ()


def test_in_eight_bit_mode_two_commands_share_the_speeds() -> None:
    device = alone()
    device.on_bytes(bytes((0x84, 1, 1, 0x55, 0x2A)), 0.0)
    device.tick(0.01)

    device.on_bytes(bytes((0x89, 127, 0x8C, 127)), 0.02)

    assert device.applied_hz == pytest.approx((FULL_HZ, CURVE.frequency_hz(127.0 * 127.0 / 255.0)))


def test_in_seven_bit_mode_the_upper_speeds_are_the_lower_ones() -> None:
    device = alone()

    device.on_bytes(bytes((0x89, 40)), 0.0)

    assert device.applied_hz[0] == pytest.approx(6.0)


def test_setting_the_pwm_mode_stops_the_motors() -> None:
    device = alone()
    device.on_bytes(bytes((0x88, 127)), 0.0)

    device.on_bytes(bytes((0x84, 1, 2, 0x55, 0x2A)), 0.0)

    assert device.applied_hz == (0.0, 0.0)


@pytest.mark.parametrize(("parameter", "value", "reply"), [(9, 0, b"\x01"), (1, 4, b"\x02"), (2, 2, b"\x02")])
def test_bad_parameters_are_refused_with_a_code(parameter: int, value: int, reply: bytes) -> None:
    device = alone()
    device.on_bytes(bytes((0x84, parameter, value, 0x55, 0x2A)), 0.0)

    assert device.tick(0.01) == reply


def test_an_unknown_parameter_is_read_as_255_and_is_an_error() -> None:
    device = alone()

    assert device.on_bytes(bytes((0x83, 7)), 0.0) == b"\xff"
    assert device.on_bytes(b"\x82", 0.0) == b"\x40"


@pytest.mark.parametrize("packet", [bytes((0x84, 3, 1, 0x55, 0x2B)), bytes((0x90,)), bytes((0x88, 0x82))])
def test_a_malformed_packet_is_a_format_error_that_stops_the_motors_and_is_cleared_by_reading(packet: bytes) -> None:
    device = alone()
    device.on_bytes(bytes((0x88, 127)), 0.0)

    said = device.on_bytes(packet + (b"" if packet[-1] == 0x82 else b"\x82"), 0.1)

    assert said == b"\x40"
    assert device.applied_hz == (0.0, 0.0)
    assert device.on_bytes(b"\x82", 0.1) == b"\0"


def test_a_wrong_crc_is_an_error_and_the_command_ignored() -> None:
    device = QikDevice(((9, 0),), has_crc=True)
    packet = bytes((0xAA, 9, 0x08, 127))
    device.on_bytes(b"\xaa" + packet + bytes((compute_crc7(packet) ^ 1,)), 0.0)

    assert device.applied_hz == (0.0,)
    assert device.faults == ("board 9: CRC error",)


def test_the_crc_is_the_one_of_the_users_guide() -> None:
    assert compute_crc7(bytes((0x83, 0x01))) == 0x17


def test_the_serial_timeout_stops_the_motors_and_sets_its_bit() -> None:
    device = alone()
    device.on_bytes(bytes((0x84, 3, 1, 0x55, 0x2A)), 0.0)
    device.on_bytes(bytes((0x88, 127)), 1.0)

    device.tick(1.26)
    assert device.applied_hz[0] > 0.0
    device.tick(1.27)

    assert device.applied_hz == (0.0, 0.0)
    assert device.watchdog
    assert device.on_bytes(b"\x82", 1.3)[-1:] == b"\x80"
    assert not device.watchdog


@pytest.mark.parametrize(("value", "expected_s"), [(0, 0.0), (1, 0.262), (0x5E, 117.4), (0x7F, 503.0)])
def test_timeout_values_mean_what_the_guide_says(value: int, expected_s: float) -> None:
    assert watchdog_timeout_s(value) == pytest.approx(expected_s, rel=0.01)


def test_a_slow_motor_starts_only_after_a_push() -> None:
    device = alone()
    device.on_bytes(bytes((0x88, 16)), 0.0)
    assert device.applied_hz[0] == 0.0

    device.on_bytes(bytes((0x88, 127, 0x88, 16)), 0.1)

    assert device.applied_hz[0] == pytest.approx(CURVE.frequency_hz(16.0))


def test_a_reboot_keeps_the_parameters_and_forgets_the_rest() -> None:
    device = alone()
    device.on_bytes(bytes((0x84, 3, 5, 0x55, 0x2A)), 0.0)
    device.on_bytes(bytes((0x88, 127)), 0.1)

    device.reboot(1.0)

    assert device.applied_hz == (0.0, 0.0)
    assert device.on_bytes(b"\x83\x03", 1.1) == b""
    assert device.on_bytes(b"\xaa\x83\x03", 1.1) == b"\x05"


def test_a_stalled_motor_does_not_turn_whatever_it_is_told() -> None:
    device = alone()
    device.on_bytes(bytes((0x88, 127)), 0.0)

    device.begin_fault(Fault(kind=Kind.STALL, at_s=0.0, motor=1), 0.0)
    assert device.applied_hz[0] == 0.0
    device.end_fault(Fault(kind=Kind.STALL, at_s=0.0, motor=1), 1.0)
    device.on_bytes(bytes((0x88, 127)), 1.0)

    assert device.applied_hz[0] == pytest.approx(FULL_HZ)
