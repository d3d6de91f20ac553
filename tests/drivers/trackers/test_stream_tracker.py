"""The stream tracker: fresh poses or a reason, never a made-up one."""

import json
import math
import socket
import subprocess
import sys
import time
from contextlib import closing

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.stream.message import Axes, decode_pose, encode_lost, encode_pose
from vvvaltr.drivers.trackers.stream.table import StreamTable
from vvvaltr.drivers.trackers.stream.tracker import PoseSender, StreamTracker, find_free_port

AGE_LIMIT_S = 0.15
finite = st.floats(allow_nan=False, allow_infinity=False)
vectors = st.tuples(finite, finite, finite)


@pytest.fixture
def tracker():
    tracker = StreamTracker(StreamTable(port=0, age_limit_s=AGE_LIMIT_S))
    yield tracker
    tracker.close()


@pytest.fixture
def wire(tracker):
    with wire_to(tracker) as wire:
        yield wire


def udp_socket() -> socket.socket:
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM)


def wire_to(tracker) -> socket.socket:
    """Return a socket that can send anything to the tracker."""
    host, port = tracker.address.split(":")
    wire = udp_socket()
    wire.connect((host, int(port)))
    return wire


def seen_of(tracker) -> Pose | str:
    try:
        return tracker.pose()
    except TrackingLost as lost:
        return str(lost)


def pose_at(x_m: float, t_s: float | None = None) -> Pose:
    return Pose(time.monotonic() if t_s is None else t_s, (x_m, 0.0, 0.03), yaw_rad=0.1, markers_m=((0.0, 1.0, 2.0),))


def until(tracker: StreamTracker, wanted) -> Pose | str:
    """Return the first pose, or reason for none, for which ``wanted`` holds."""
    deadline_s = time.monotonic() + 5.0
    while time.monotonic() < deadline_s:
        seen = seen_of(tracker)
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
    told = decode_pose(encode_pose(sequence, pose))
    assert (told.sequence, told.pose, told.keys) == (sequence, pose, ())


@given(
    st.binary() | st.text().map(str.encode) | st.recursive(st.none() | finite, st.lists).map(json.dumps).map(str.encode)
)
def test_what_is_no_pose_is_refused_with_a_reason(datagram):
    with pytest.raises(ValueError, match="malformed pose"):
        decode_pose(datagram)


@pytest.mark.parametrize("wrong", ['"1"', "[]", "{}", "1" + 400 * "0"])
def test_a_coordinate_that_is_no_number_is_refused(wrong):
    datagram = f'{{"sequence": 1, "t_s": 0.0, "position_m": [0.0, {wrong}, 0.0]}}'
    with pytest.raises(ValueError, match="malformed pose"):
        decode_pose(datagram.encode())


def test_a_robot_that_is_not_seen_has_no_pose():
    told = decode_pose(encode_lost(3, 1.0))
    assert (told.sequence, told.pose, told.missing) == (3, None, "")


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
    time.sleep(2.0 * AGE_LIMIT_S)
    wire.send(encode_pose(1, pose_at(0.2, t_s + 0.01)))
    assert "s old" in until(tracker, lambda seen: not is_pose(seen))


@pytest.mark.parametrize(
    "datagram", [b"noise", b"", b"{}", b'{"x":' + b"[" * 5000, b'{"sequence": 1, "t_s": 0, "position_m": [0, 0]}']
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
        StreamTracker(StreamTable(host=host, port=int(port)))


def test_it_says_what_a_sender_means_by_its_numbers_and_turns_them_to_metres_and_radians_with_z_up():
    datagram = b'{"sequence": 1, "t_s": 0.5, "position_m": [100, 60, -20], "yaw_rad": 90, "markers_m": [[10, 20, 30]]}'

    pose = decode_pose(datagram, Axes("mm", "y", "deg")).pose

    assert pose.position_m == pytest.approx((0.1, 0.02, 0.06))
    assert pose.markers_m[0] == pytest.approx((0.01, -0.03, 0.02))
    assert pose.yaw_rad == pytest.approx(math.pi / 2.0)


@pytest.mark.parametrize("missing", ["NaN", "null", "Infinity", "1e999"])
@pytest.mark.parametrize("place", ['"position_m": [0.2, {}, 0.0]', '"position_m": [0.2, 0.0, 0.0], "yaw_rad": {}'])
def test_a_missing_number_is_a_gap_and_the_pose_before_it_counts_until_it_is_too_old(tracker, wire, missing, place):
    wire.send(encode_pose(0, pose_at(0.1)))
    until(tracker, is_pose)
    gap = f'{{"sequence": 1, "t_s": {time.monotonic()}, {place.format(missing)}}}'.encode()
    wire.send(gap)
    assert decode_pose(gap).missing
    assert until(tracker, is_pose).position_m[0] == 0.1
    assert f"{place.split(chr(34))[-2]} is NaN or null" in until(tracker, lambda seen: not is_pose(seen))


@pytest.mark.parametrize("marker", ["[NaN, 0.0, 0.0]", "[null, 0.0, 0.0]", "null"])
def test_a_missing_marker_does_not_spoil_a_good_pose(marker):
    datagram = f'{{"sequence": 1, "t_s": 0, "position_m": [0.1, 0.2, 0.3], "markers_m": [[0, 0, 0], {marker}]}}'
    pose = decode_pose(datagram.encode()).pose
    assert (pose.position_m, pose.markers_m) == ((0.1, 0.2, 0.3), ())


@pytest.mark.parametrize("step_s", [-0.05, -0.16, -0.19, -0.5, -3600.0, 0.19, 3600.0])
def test_a_senders_clock_that_is_set_costs_nothing(tracker, wire, step_s):
    begin_s = time.monotonic()
    for number in range(40):
        t_s = time.monotonic()
        wire.send(encode_pose(number, pose_at(0.01 * number, t_s + (step_s if number > 15 else 0.0))))
        seen = until(tracker, lambda seen, x_m=0.01 * number: is_pose(seen) and seen.position_m[0] == x_m)
        assert begin_s <= seen.t_s <= time.monotonic()
        assert time.monotonic() - seen.t_s < AGE_LIMIT_S
        time.sleep(0.01)


@pytest.mark.parametrize("modulus", [2**8, 2**16, 2**32])
def test_sequence_numbers_that_wrap_cost_nothing(tracker, wire, modulus):
    for number in range(modulus - 3, modulus + 3):
        wire.send(encode_pose(number % modulus, pose_at(0.1 + number - modulus)))
        until(tracker, lambda seen, x_m=0.1 + number - modulus: is_pose(seen) and seen.position_m[0] == x_m)


def test_an_old_pose_that_arrives_after_its_counter_wrapped_changes_nothing(tracker, wire):
    t_s = time.monotonic()
    wire.send(encode_pose(0, pose_at(0.2, t_s)))
    until(tracker, is_pose)
    wire.send(encode_pose(65535, pose_at(0.1, t_s - 0.04)))
    wire.send(encode_pose(1, pose_at(0.3, t_s + 0.02)))
    seen = set()
    until(tracker, lambda pose: seen.add(pose.position_m[0]) or pose.position_m[0] == 0.3)
    assert 0.1 not in seen


def test_a_body_is_chosen_by_its_name():
    with closing(StreamTracker(StreamTable(port=0, name="robot"))) as tracker, wire_to(tracker) as wire:
        wire.send(encode_pose(0, pose_at(0.5), "box"))
        assert "poses come of 'box', but none of 'robot'" in until(tracker, lambda seen: "box" in str(seen))
        wire.send(encode_pose(1, pose_at(0.1), "robot"))
        wire.send(encode_pose(2, pose_at(0.5), "box"))
        wire.send(encode_pose(3, pose_at(0.2), "robot"))
        assert until(tracker, lambda seen: is_pose(seen) and seen.position_m[0] != 0.1).position_m[0] == 0.2


def test_two_names_without_a_choice_are_no_pose(tracker, wire):
    wire.send(encode_pose(0, pose_at(0.1), "robot"))
    until(tracker, is_pose)
    wire.send(encode_pose(1, pose_at(0.5), "box"))
    assert "two bodies come, 'robot' and 'box'" in until(tracker, lambda seen: not is_pose(seen))


def test_a_second_sender_is_named_and_no_pose_counts_until_one_is_silent(tracker, wire):
    with wire_to(tracker) as other:
        wire.send(encode_pose(10, pose_at(0.1)))
        until(tracker, is_pose)
        other.send(encode_pose(500, pose_at(0.1)))
        reason = until(tracker, lambda seen: not is_pose(seen))
        for each in (wire, other):
            assert "{}:{}".format(*each.getsockname()) in reason
        wire.send(encode_pose(11, pose_at(0.1)))
        assert "two senders" in until(tracker, lambda seen: not is_pose(seen))
    time.sleep(1.1)
    wire.send(encode_pose(12, pose_at(0.3)))
    assert until(tracker, is_pose).position_m[0] == 0.3


def test_a_sender_that_opens_a_socket_for_each_pose_is_one_sender(tracker):
    for number in range(20):
        with wire_to(tracker) as wire:
            wire.send(encode_pose(number, pose_at(0.1 + 0.001 * number)))
            until(tracker, lambda seen, x_m=0.1 + 0.001 * number: is_pose(seen) and seen.position_m[0] == x_m)


def test_two_bodies_in_turn_from_one_sender_are_no_pose(tracker, wire):
    for number in range(20):
        wire.send(encode_pose(number, pose_at(0.4 * (number % 2), t_s=0.01 * number)))
    assert "by 0.4 m" in until(tracker, lambda seen: "to and fro" in str(seen))


def test_an_outlier_now_and_then_is_no_second_body(tracker, wire):
    for number in range(40):
        wire.send(encode_pose(number, pose_at(2.0 if number % 7 == 3 else 0.1, t_s=0.01 * number)))
        assert "to and fro" not in str(seen_of(tracker))
    assert is_pose(until(tracker, is_pose))


@pytest.mark.parametrize(("key", "meant"), [("yaw", "yaw_rad"), ("heading_rad", "yaw_rad"), ("marker_m", "markers_m")])
def test_a_misspelt_key_is_told_once(tracker, wire, caplog, key, meant):
    for number in range(3):
        wire.send(f'{{"sequence": {number}, "t_s": {number}, "position_m": [0, 0, 0.1], "{key}": 1.0}}'.encode())
    until(tracker, is_pose)
    until(tracker, lambda seen: not is_pose(seen))
    assert len(tracker.remarks) == 1
    assert key in tracker.remarks[0] and meant in tracker.remarks[0]
    assert [record.getMessage() for record in caplog.records].count(tracker.remarks[0]) == 1


def test_a_multicast_group_is_joined_and_may_be_shared():
    table = StreamTable(host="239.255.42.99", port=find_free_port(), interface="127.0.0.1")
    with closing(StreamTracker(table)) as tracker, closing(StreamTracker(table)) as other, udp_socket() as wire:
        wire.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        wire.sendto(encode_pose(0, pose_at(0.1)), (table.host, table.port))
        assert is_pose(until(tracker, is_pose)) and is_pose(until(other, is_pose))


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_two_programs_cannot_have_one_unicast_port(host):
    with closing(StreamTracker(StreamTable(host="127.0.0.1", port=0))) as tracker:
        port = int(tracker.address.split(":")[1])
        code = f"from vvvaltr.drivers.trackers.stream.wire import PoseSocket; PoseSocket({host!r}, {port})"
        other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "Address already in use; end the other program that listens there" in other.stderr


def test_a_group_is_joined_on_all_interfaces_unless_one_is_named():
    with closing(StreamTracker(StreamTable(host="239.255.42.99", port=0))) as tracker, udp_socket() as wire:
        wire.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        wire.sendto(encode_pose(0, pose_at(0.1)), ("239.255.42.99", int(tracker.address.split(":")[1])))
        assert is_pose(until(tracker, is_pose))


def test_an_interface_that_is_none_is_refused_by_name():
    with pytest.raises(ValueError, match="nowhere0"):
        StreamTracker(StreamTable(host="239.255.42.99", port=0, interface="nowhere0"))


def test_broadcast_poses_arrive():
    with closing(StreamTracker(StreamTable(host="127.255.255.255", port=0))) as tracker, udp_socket() as wire:
        wire.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        wire.sendto(encode_pose(0, pose_at(0.1)), ("127.255.255.255", int(tracker.address.split(":")[1])))
        assert is_pose(until(tracker, is_pose))


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0", "127.255.255.255", "239.255.42.99"])
def test_closing_never_waits_for_a_pose(host):
    tracker = StreamTracker(StreamTable(host=host, port=0))
    began_s = time.monotonic()
    tracker.close()
    assert time.monotonic() - began_s < 1.0


def test_it_can_be_closed_twice(tracker):
    tracker.close()
    tracker.close()
