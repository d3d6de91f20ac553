"""The NatNet tracker against a stand-in for Motive on the loopback: true poses or a reason, whatever it does."""

import socket
import time

import pytest
from moving import assert_true, is_pose, moving, says, seen, until

from vvvaltr.controller.core.errors import LinkLost, UserError
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.natnet.mock import NatnetFaults, NatnetServer
from vvvaltr.drivers.trackers.natnet.protocol import GROUP, Message, message
from vvvaltr.drivers.trackers.natnet.table import NatnetTable
from vvvaltr.drivers.trackers.natnet.tracker import NatnetTracker

AGE_LIMIT_S = 0.15


@pytest.fixture
def server():
    server = NatnetServer()
    yield server
    server.close()


@pytest.fixture
def tracked(server):
    """A tracker that sees the robot move."""
    with moving(server):
        tracker = track(server)
        until(tracker, is_pose)
        yield tracker
        tracker.close()


def track(server: NatnetServer, patience_s: float = 3.0, **keys) -> NatnetTracker:
    table = {"host": "127.0.0.1", "port": server.port, "body": "robot", "age_limit_s": AGE_LIMIT_S, **keys}
    return NatnetTracker(NatnetTable(**table), patience_s)


def refusal_of(server: NatnetServer, kind: type[Exception], **keys) -> str:
    with pytest.raises(kind) as caught:
        track(server, **keys).close()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.mark.parametrize("version", [(3, 0), (3, 1), (4, 0), (4, 1), (4, 2), (4, 3)])
@pytest.mark.parametrize("up", ["y", "z"])
def test_poses_are_true_with_z_upwards_in_every_version(version, up):
    server = NatnetServer(version=version, up=up)
    with moving(server, clock_ahead_s=5e4):
        tracker = track(server, up=up)
        for _ in range(10):
            pose = until(tracker, is_pose)
            assert_true(pose)
            assert abs(time.monotonic() - pose.t_s) < 0.15
            assert pose.uncertainty_m == pytest.approx(0.0003, rel=1e-6)
            time.sleep(0.01)
        tracker.close()
    server.close()


def test_poses_come_from_a_multicast_group():
    data_port = free_port()
    server = NatnetServer(data_port=data_port)
    with moving(server):
        tracker = track(server, multicast=GROUP, data_port=data_port)
        assert_true(until(tracker, is_pose))
        tracker.close()
    server.close()


def test_without_the_cameras_exposure_the_servers_time_counts(server):
    server.faults.has_exposure = False
    with moving(server, clock_ahead_s=100.0):
        tracker = track(server)
        assert_true(until(tracker, is_pose))
        tracker.close()


def test_it_keeps_itself_alive_and_says_goodbye(server, tracked):
    time.sleep(5.5)  # longer than the server remembers a silent client
    assert_true(until(tracked, is_pose))
    assert server.listeners == 1
    tracked.close()
    deadline_s = time.monotonic() + 2.0
    while server.listeners and time.monotonic() < deadline_s:
        time.sleep(0.01)
    assert server.listeners == 0


def test_a_body_that_is_sent_with_its_last_pose_but_not_tracked_is_lost(server):
    tracker = track(server)
    server.send(Pose(time.monotonic(), (0.0, 0.0, 0.0)))
    until(tracker, is_pose)
    server.send_lost(time.monotonic())
    assert until(tracker, lambda what: not is_pose(what)) == "the tracker does not see the robot"
    server.send(Pose(time.monotonic(), (0.0, 0.0, 0.0)))
    until(tracker, is_pose)
    tracker.close()


def test_a_frame_number_that_stands_still_is_a_loss_that_says_so(server, tracked):
    server.faults.repeats_frame = True
    assert "it repeats frame" in until(tracked, lambda what: not is_pose(what))
    server.faults.repeats_frame = False
    assert_true(until(tracked, is_pose))


def test_silence_is_told_and_ends_by_itself(server, tracked):
    server.faults.is_mute = True
    until(tracked, says("s old"), within_s=1.0)
    assert "check that Motive runs" in until(tracked, says("silent"), within_s=4.0)
    server.faults.is_mute = False
    assert_true(until(tracked, is_pose))


def test_after_a_restart_with_another_version_and_time_it_is_believed_again():
    first = NatnetServer(version=(3, 0))
    with moving(first, clock_ahead_s=1000.0):
        tracker = track(first)
        until(tracker, is_pose)
    first.close()
    until(tracker, lambda what: not is_pose(what))
    second = NatnetServer(port=first.port, version=(4, 2))
    with moving(second):
        assert_true(until(tracker, is_pose))
        tracker.close()
    second.close()


def test_changed_models_are_asked_for_again(server, tracked):
    server.bodies = ("another", "wand", "robot")  # and so the robot has another id
    server.models_changed = True
    deadline_s = time.monotonic() + 2.0
    while server.models_changed and time.monotonic() < deadline_s:
        time.sleep(0.01)
    time.sleep(0.1)
    assert_true(until(tracked, is_pose))


@pytest.mark.parametrize("wrong", [b"", b"\7", message(Message.FRAME, b"abc"), message(Message.MODEL, b"\xff" * 8)])
def test_a_malformed_datagram_is_a_reason_until_the_next_frame(server, wrong):
    tracker = track(server)
    server.send(Pose(time.monotonic(), (0.0, 0.0, 0.0)))
    until(tracker, is_pose)
    server.send_bytes(wrong)
    assert "malformed" in until(tracker, lambda what: not is_pose(what))
    server.send(Pose(time.monotonic(), (0.0, 0.0, 0.0)))
    until(tracker, is_pose)
    tracker.close()


def test_what_others_send_is_not_heard(server):
    tracker = track(server)
    frames = []
    server.send_bytes, real = frames.append, server.send_bytes
    server.send(Pose(time.monotonic(), (1.0, 2.0, 3.0)))
    client = next(iter(server._clients))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.2", 0))
        stranger.sendto(frames[0], client)
    time.sleep(0.2)
    assert not is_pose(seen(tracker))
    real(frames[0])
    until(tracker, is_pose)
    tracker.close()


def test_a_body_that_motive_does_not_know_is_refused_with_those_that_it_knows(server):
    message = refusal_of(server, UserError, body="rodot")
    assert "tracker.body is 'rodot'" in message and "knows 'wand', 'robot'" in message


@pytest.mark.parametrize(("version", "words"), [((2, 10), "update Motive"), ((5, 0), "newer than 4")])
def test_a_version_that_is_not_understood_is_refused(version, words):
    server = NatnetServer(version=version)
    message = refusal_of(server, UserError)
    assert f"version {version[0]}.{version[1]} of NatNet" in message and words in message
    server.close()


def test_a_server_that_sends_to_a_group_is_refused_with_the_settings_for_it():
    server = NatnetServer(data_port=free_port())
    assert "write multicast = '239.255.42.99' and data_port = " in refusal_of(server, UserError)
    server.close()


def test_no_server_is_refused_with_the_address_and_the_cure():
    server = NatnetServer(faults=NatnetFaults(is_mute=True))
    message = refusal_of(server, LinkLost, patience_s=0.5)
    assert f"127.0.0.1:{server.port}" in message and "check that Motive runs" in message
    server.close()
    assert "check that Motive runs" in refusal_of(server, LinkLost, patience_s=0.5)


@pytest.mark.parametrize("keys", [{"host": "no.such.host.invalid"}, {"multicast": "300.1.1.1"}])
def test_an_address_that_is_none_is_refused(server, keys):
    assert "cannot be reached" in refusal_of(server, ValueError, **keys)


def test_it_can_be_closed_twice(server):
    tracker = track(server)
    tracker.close()
    tracker.close()
