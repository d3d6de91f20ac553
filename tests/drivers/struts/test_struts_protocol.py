"""The text of radio struts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.drivers.struts.firmware import core
from vvvaltr.drivers.struts.protocol import check_bytes, check_sum, decode, encode_held, encode_target, to_byte, to_rpm

LABORATORY = b"982.00,979.13,120,-4,16384,-262,0,131"
WORDS = st.integers(0, 65535)


def own(*added: object) -> bytes:
    text = LABORATORY + b",v1," + ",".join(map(str, added)).encode()
    return text + b",%02x" % check_sum(text)


def test_a_report_of_the_laboratory_gives_target_speed_and_motion_in_their_units() -> None:
    report = decode(LABORATORY)

    assert (report.target_rpm, report.average_rpm) == (982.0, 979.13)
    assert report.acceleration_g == pytest.approx((0.00732, -0.000244, 1.0), abs=1e-5)
    assert report.rotation_deg_s == (-2.0, 0.0, 1.0)
    assert report.added is None


def test_what_our_firmware_adds_tells_it_apart() -> None:
    added = decode(own(7, 123456, 77, 12, 1, 2, 3700)).added

    assert added is not None
    assert (added.sequence, added.device_ms, added.boot_id, added.command) == (7, 123456, 77, 12)
    assert (added.expiries, added.stalls, added.battery_v) == (1, 2, 3.7)
    assert decode(own(7, 123456, 77, 12, 1, 2, "")).added.battery_v is None  # type: ignore[union-attr]


@pytest.mark.parametrize("length", range(1, len(own(7, 123456, 77, 12, 1, 2, 3700))))
def test_a_report_that_was_cut_short_by_a_small_mtu_is_never_taken_for_another(length: int) -> None:
    whole = own(7, 123456, 77, 12, 1, 2, 3700)
    try:
        report = decode(whole[:length])
    except ValueError:
        return
    assert report.added is None and whole[:length].count(b",") == 7  # no more than the laboratory's, and their last


@given(st.binary(max_size=250))
def test_any_bytes_are_a_report_or_a_value_error(text: bytes) -> None:
    try:
        report = decode(text)
    except ValueError:
        return
    assert abs(report.target_rpm) <= 100_000.0 and abs(report.average_rpm) <= 100_000.0


@pytest.mark.parametrize("speed", [b"nan", b"inf", b"-inf", b"1e99", b""])
def test_a_speed_that_is_no_number_is_refused(speed: bytes) -> None:
    with pytest.raises(ValueError):
        decode(speed + LABORATORY[6:])


@given(st.tuples(WORDS, st.integers(0, (1 << 30) - 1), WORDS, WORDS, WORDS, WORDS, WORDS))
def test_all_numbers_of_our_firmware_come_through(numbers: tuple[int, ...]) -> None:
    added = decode(own(*numbers)).added

    assert added is not None and added.battery_v is not None
    assert (added.sequence, added.device_ms, added.boot_id, added.command, added.expiries, added.stalls) == numbers[:6]
    assert added.battery_v == numbers[6] / 1000.0


def test_frequencies_become_turns_a_minute_with_their_sign() -> None:
    assert [to_rpm(hz) for hz in (16.37, -5.02, 0.0)] == [982, -301, 0]
    assert encode_target(-301) == b"-301"
    assert encode_held(982, 0.4, 17) == b"982,400,17"
    assert len(encode_held(-core.MAX_RPM, 60.0, 65535)) <= 20  # what fits without a greater MTU


def test_an_rfduinos_motor_stands_still_below_its_least_byte() -> None:
    assert [to_byte(command) for command in (0.0, 22.4, 23.0, 254.6)] == [0, 0, 23, 255]
    with pytest.raises(ValueError, match="22; allowed: 23 to 255"):
        check_bytes([(22.0, 1.0), (255.0, 16.0)])
