"""NatNet's datagrams, as the stand-in for Motive builds them from the same tables of sections."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.drivers.trackers.natnet import mock
from vvvaltr.drivers.trackers.natnet.protocol import (
    COUNT,
    SERVER,
    Body,
    Message,
    bodies_in,
    frame_in,
    message,
    message_in,
    server_info_in,
)

VERSIONS = [(3, 0), (3, 1), (4, 0), (4, 1), (4, 2)]
BODIES = {101: (1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8, 0.5, 1), 102: (4.0, 5.0, 6.0, 0.0, 0.0, 0.0, 1.0, 0.25, 0)}


def frame(version, **more) -> bytes:
    return mock.frame(7, BODIES, 12.5, 12.25, version, **more)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_frame_tells_its_rigid_bodies_times_and_flags(version):
    seen = frame_in(frame(version), version)
    assert seen.number == 7
    assert seen.bodies[101] == Body((1.0, 2.0, 3.0), pytest.approx((0.0, 0.0, 0.6, 0.8)), 0.5, True)
    assert seen.bodies[102] == Body((4.0, 5.0, 6.0), (0.0, 0.0, 0.0, 1.0), 0.25, False)
    assert (seen.t_s, seen.exposure_ticks) == (12.5, 12.25 * mock.CLOCK_HZ)
    assert not seen.models_changed
    assert frame_in(frame(version, models_changed=True), version).models_changed


@pytest.mark.parametrize("t_s", [math.nan, math.inf])
def test_a_frame_whose_time_is_no_number_is_refused(t_s):
    with pytest.raises(ValueError, match="a frame whose time is"):
        frame_in(mock.frame(7, BODIES, t_s, 0.0, (3, 0)), (3, 0))


@pytest.mark.parametrize("version", VERSIONS)
def test_a_model_definition_names_the_rigid_bodies_among_all_other_things(version):
    assert bodies_in(mock.model(("wand", "robot"), version), version) == {"wand": 101, "robot": 102}


@pytest.mark.parametrize("version", VERSIONS)
def test_every_truncated_frame_is_refused(version):
    whole = frame(version)
    ends_without_tag = len(whole) - 4
    for length in range(len(whole)):
        if length != ends_without_tag:
            with pytest.raises(ValueError):
                frame_in(whole[:length], version)


@pytest.mark.parametrize("version", VERSIONS)
def test_every_truncated_model_definition_is_refused(version):
    whole = mock.model(("wand", "robot"), version)
    for length in range(len(whole)):
        with pytest.raises(ValueError):
            bodies_in(whole[:length], version)


@pytest.mark.parametrize(("version", "other"), [((3, 0), (4, 1)), ((4, 1), (3, 0)), ((4, 0), (4, 2))])
def test_a_frame_of_another_version_is_refused(version, other):
    with pytest.raises(ValueError):
        frame_in(frame(version), other)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_huge_count_is_refused_at_once(version):
    with pytest.raises(ValueError, match="things in"):
        frame_in(COUNT.pack(1) + COUNT.pack(2**32 - 1) * 20, version)
    with pytest.raises(ValueError, match="things in"):
        bodies_in(COUNT.pack(2**32 - 1) + bytes(10), version)


@given(st.binary(max_size=300), st.sampled_from(VERSIONS))
def test_what_is_no_frame_nor_model_is_refused_or_has_no_body(content, version):
    for read in (frame_in, bodies_in):
        try:
            read(content, version)
        except ValueError:
            continue


def test_a_datagram_must_be_as_long_as_it_says():
    assert message_in(message(Message.FRAME, b"abc")) == (Message.FRAME, b"abc")
    for wrong in (b"", b"\7\0\5", message(Message.FRAME, b"abc")[:-1], message(Message.FRAME, b"abc") + b"d"):
        with pytest.raises(ValueError):
            message_in(wrong)


def test_an_old_server_tells_its_version_and_no_more():
    info = server_info_in(SERVER.pack(b"Tracking Tools", 1, 0, 0, 0, 2, 10, 0, 0))
    assert (info.name, info.version, info.clock_hz, info.group) == ("Tracking Tools", (2, 10), 0, "")
    with pytest.raises(ValueError):
        server_info_in(struct.pack("<4s", b"abcd"))
