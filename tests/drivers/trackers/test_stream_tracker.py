"""The stream tracker: fresh poses or a reason, never a made-up one."""

import json
import socket
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.stream.tracker import PoseSender, StreamTracker, decode_pose, encode_lost, encode_pose

AGE_LIMIT_S = 0.15
finite = st.floats(allow_nan=False, allow_infinity=False)
vectors = st.tuples(finite, finite, finite)


@pytest.fixture
def tracker():
    tracker = StreamTracker(age_limit_s=AGE_LIMIT_S)
    yield tracker
    tracker.close()


@pytest.fixture
def wire(tracker):
    """A socket that can send anything to the tracker."""
    host, port = tracker.address.split(":")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.connect((host, int(port)))
        yield wire


def pose_at(x_m: float, t_s: float | None = None) -> Pose:
    return Pose(time.monotonic() if t_s is None else t_s, (x_m, 0.0, 0.03), yaw_rad=0.1, markers_m=((0.0, 1.0, 2.0),))


def until(tracker: StreamTracker, wanted) -> Pose | str:
    """Return the first pose, or reason for none, for which ``wanted`` holds."""
    deadline_s = time.monotonic() + 5.0
    while time.monotonic() < deadline_s:
        try:
            seen = tracker.pose()
        except TrackingLost as lost:
            seen = str(lost)
        if wanted(seen):
            return seen
        time.sleep(0.002)
    raise AssertionError(f"still {seen}")


def is_pose(seen) -> bool:
    return isinstance(seen, Pose)


poses = st.builds(
    Pose, finite, vectors, finite, finite, finite, st.tuples(vectors, vectors), uncertainty_m=st.none() | finite
)


@given(st.integers(0, 2**40), poses)
def test_a_pose_survives_the_wire(sequence, pose):
    assert decode_pose(encode_pose(sequence, pose)) == (sequence, pose)


@given(
    st.binary() | st.text().map(str.encode) | st.recursive(st.none() | finite, st.lists).map(json.dumps).map(str.encode)
)
def test_what_is_no_pose_is_refused_with_a_reason(datagram):
    with pytest.raises(ValueError, match="malformed pose"):
        decode_pose(datagram)


@pytest.mark.parametrize("wrong", ["NaN", "Infinity", "1e999", "null", '"1"', "[]"])
def test_a_coordinate_that_is_no_number_is_refused(wrong):
    datagram = f'{{"sequence": 1, "t_s": 0.0, "position_m": [0.0, {wrong}, 0.0]}}'
    with pytest.raises(ValueError, match="malformed pose"):
        decode_pose(datagram.encode())


def test_a_robot_that_is_not_seen_has_no_pose():
    assert decode_pose(encode_lost(3, 1.0)) == (3, None)


def test_before_the_first_pose_the_reason_names_the_address(tracker):
    with pytest.raises(TrackingLost, match=tracker.address):
        tracker.pose()


def test_it_tells_the_newest_pose_on_its_own_clock(tracker):
    host, port = tracker.address.split(":")
    sender = PoseSender(host, int(port))
    before_s = time.monotonic()
    sender.send(pose_at(0.1, t_s=1e6))
    sender.send(pose_at(0.2, t_s=1e6 + 0.001))
    seen = until(tracker, lambda seen: is_pose(seen) and seen.position_m[0] == 0.2)
    assert before_s <= seen.t_s <= time.monotonic()
    assert (seen.yaw_rad, seen.markers_m) == (0.1, ((0.0, 1.0, 2.0),))
    sender.send_lost(1e6 + 0.002)
    assert until(tracker, lambda seen: not is_pose(seen)) == "the tracker does not see the robot"
    sender.close()


def test_an_old_pose_is_not_the_robots(tracker, wire):
    wire.send(encode_pose(0, pose_at(0.1)))
    until(tracker, is_pose)
    assert "s old; the limit is 0.15 s" in until(tracker, lambda seen: not is_pose(seen))


def test_a_pose_that_was_long_under_way_is_old(tracker, wire):
    t_s = time.monotonic()
    wire.send(encode_pose(0, pose_at(0.1, t_s)))
    until(tracker, is_pose)
    wire.send(encode_pose(1, pose_at(0.2, t_s - 1.0)))
    assert "s old" in until(tracker, lambda seen: not is_pose(seen))


@pytest.mark.parametrize(
    "datagram", [b"noise", b"", b"{}", b'{"x":' + b"[" * 5000, b'{"sequence": 1, "t_s": 0, "position_m": [0, NaN, 0]}']
)
def test_a_malformed_pose_loses_the_robot_until_the_next_good_one(tracker, wire, datagram):
    wire.send(encode_pose(0, pose_at(0.1)))
    until(tracker, is_pose)
    wire.send(datagram)
    assert "malformed" in until(tracker, lambda seen: not is_pose(seen))
    wire.send(encode_pose(1, pose_at(0.2)))
    assert until(tracker, is_pose).position_m[0] == 0.2


def test_repeated_and_overtaken_poses_change_nothing(tracker, wire):
    wire.send(encode_pose(5, pose_at(0.5)))
    until(tracker, is_pose)
    wire.send(encode_pose(5, pose_at(0.1)))
    wire.send(encode_pose(4, pose_at(0.1)))
    wire.send(encode_pose(6, pose_at(0.6)))
    seen = set()
    until(tracker, lambda pose: seen.add(pose.position_m[0]) or pose.position_m[0] == 0.6)
    assert seen <= {0.5, 0.6}


@pytest.mark.parametrize(("first", "next_"), [(1000, 0), (1, 1000)])
def test_after_a_silence_a_sender_whose_numbers_or_clock_begin_anew_is_believed(tracker, wire, first, next_):
    wire.send(encode_pose(first, pose_at(0.1, t_s=5000.0)))
    until(tracker, is_pose)
    until(tracker, lambda seen: not is_pose(seen))
    wire.send(encode_pose(next_, pose_at(0.2, t_s=1.0)))
    assert until(tracker, is_pose).position_m[0] == 0.2


def test_a_tracker_that_hangs_and_repeats_itself_is_lost(tracker, wire):
    datagram, seen = encode_pose(1, pose_at(0.1)), []
    deadline_s = time.monotonic() + 4.0 * AGE_LIMIT_S
    while time.monotonic() < deadline_s:
        wire.send(datagram)
        time.sleep(0.01)
        try:
            seen.append((time.monotonic(), tracker.pose()))
        except TrackingLost:
            continue
    assert seen and seen[-1][0] - seen[0][0] < 1.5 * AGE_LIMIT_S


def test_an_address_that_is_taken_is_refused_with_its_name(tracker):
    host, port = tracker.address.split(":")
    with pytest.raises(ValueError, match=tracker.address):
        StreamTracker(host, int(port))


def test_it_can_be_closed_twice(tracker):
    tracker.close()
    tracker.close()
