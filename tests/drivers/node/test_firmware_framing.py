"""Frames: the firmware's few lines against the libraries of the host, and both against noise."""

import binascii

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.drivers.node import protocol as host
from vvvaltr.drivers.node.firmware import framing as firmware

payloads = st.binary(min_size=1, max_size=firmware.MAX_PAYLOAD)


def test_the_check_sum_is_that_of_the_standard():
    assert firmware.crc16(b"123456789") == 0x29B1


@given(st.binary())
def test_the_firmwares_check_sum_is_the_librarys(data):
    assert firmware.crc16(data) == binascii.crc_hqx(data, 0xFFFF)


@given(payloads)
def test_both_ends_build_the_same_frame(payload):
    frame = firmware.encode(payload)
    assert frame == host.encode_frame(payload)
    assert frame.index(0) == len(frame) - 1


@given(payloads)
def test_each_end_reads_the_others_frame(payload):
    assert firmware.FrameReader().feed(host.encode_frame(payload)) == [payload]
    assert host.decode_frame(firmware.encode(payload)[:-1]) == payload


@given(st.lists(payloads, max_size=4), st.integers(1, 9))
def test_frames_may_come_in_pieces(sent, size):
    line = b"".join(map(host.encode_frame, sent))
    reader = firmware.FrameReader()
    came = [payload for start in range(0, len(line), size) for payload in reader.feed(line[start : start + size])]
    assert came == sent
    assert reader.bad_frames == 0


@given(st.binary(max_size=400), payloads)
def test_a_frame_after_noise_is_found(noise, payload):
    reader = firmware.FrameReader()
    reader.feed(noise + b"\0")
    assert reader.feed(host.encode_frame(payload)) == [payload]


@given(payloads, st.data())
def test_a_wrong_bit_is_noticed_by_both_ends(payload, data):
    frame = bytearray(host.encode_frame(payload))
    bit = data.draw(st.integers(0, 8 * (len(frame) - 1) - 1))
    frame[bit // 8] ^= 1 << bit % 8
    reader = firmware.FrameReader()
    assert reader.feed(bytes(frame)) == []
    assert reader.bad_frames >= 1
    with pytest.raises(ValueError, match=r"COBS|check sum"):
        host.decode_frame(bytes(frame[:-1]))


def test_an_endless_frame_is_thrown_away_once():
    reader = firmware.FrameReader()
    assert reader.feed(b"\x01" * 10000) == []
    assert reader.feed(b"\0" + host.encode_frame(b"next")) == [b"next"]
    assert reader.bad_frames == 1


@given(st.binary(max_size=300))
def test_both_ends_agree_on_what_is_a_frame(noise):
    reader = firmware.FrameReader()
    ours = []
    for frame in filter(None, (noise + b"\0").split(b"\0")[:-1]):
        try:
            ours.append(host.decode_frame(frame))
        except ValueError:
            ours.append(None)
    theirs = reader.feed(noise + b"\0")
    assert theirs == [payload for payload in ours if payload is not None and len(payload) <= firmware.MAX_PAYLOAD]
