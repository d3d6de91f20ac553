"""The QTM tracker against a stand-in for QTM on the loopback: true poses or a reason, whatever the server does."""

import asyncio
import math
import socket
import struct
import sys
import threading
import time

import pytest
import qtm_rt
from moving import assert_true, is_pose, moving, says, seen, until

from vvvaltr.controller.core.errors import LinkLost, UserError
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.qtm.mock import QtmFaults, QtmServer
from vvvaltr.drivers.trackers.qtm.protocol import Component, Event, Kind, frame, packet
from vvvaltr.drivers.trackers.qtm.table import QtmTable
from vvvaltr.drivers.trackers.qtm.tracker import QtmTracker
from vvvaltr.drivers.trackers.registry import open_tracker

AGE_LIMIT_S = 0.15


@pytest.fixture
def server():
    server = QtmServer()
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


def track(server: QtmServer, body: str = "robot", **wish) -> QtmTracker:
    return QtmTracker("127.0.0.1", server.port, body=body, age_limit_s=AGE_LIMIT_S, **wish)


def refusal_of(server: QtmServer, kind: type[Exception], **wish) -> str:
    with pytest.raises(kind) as caught:
        track(server, **wish).close()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_qualisys_own_client_library_understands_the_stand_in(server):
    async def frames() -> list:
        heard = []
        connection = await qtm_rt.connect("127.0.0.1", port=server.port)
        parameters = await connection.get_parameters(["6d"])
        await connection.stream_frames(components=["6d"], on_packet=lambda packet: heard.append(packet.get_6d()))
        while len(heard) < 3:
            await asyncio.sleep(0.01)
        connection.disconnect()
        return [parameters, *heard]

    with moving(server):
        parameters, (header, bodies), *_ = asyncio.run(frames())
    assert b"<Name>robot</Name>" in parameters
    assert header.body_count == 2
    assert math.isnan(bodies[0][0].x)
    assert abs(bodies[1][0].z - 30.0) < 1e-4


@pytest.mark.parametrize("fragment_bytes", [0, 1, 7, 1000])
def test_poses_are_true_in_metres_and_radians_however_the_bytes_are_cut(server, fragment_bytes):
    server.faults.fragment_bytes = fragment_bytes
    with moving(server, clock_ahead_s=5e4):
        tracker = track(server)
        for _ in range(20):
            pose = until(tracker, is_pose)
            assert_true(pose)
            assert abs(time.monotonic() - pose.t_s) < 0.15
            assert pose.uncertainty_m == pytest.approx(0.0002, rel=1e-6)
            time.sleep(0.01)
        tracker.close()


def test_fewer_frames_are_sent_where_fewer_are_asked_for(server):
    with moving(server):
        tracker = track(server, rate_hz=20.0)
        until(tracker, is_pose)
        times_s = {seen_at_s(tracker) for _ in range(500)}
        tracker.close()
    assert 10 < len(times_s) < 35  # of 200 frames a second, in a second or so


def seen_at_s(tracker: QtmTracker) -> float:
    time.sleep(0.002)
    return until(tracker, is_pose).t_s


def test_a_qtm_that_cannot_tell_residuals_is_asked_for_poses_without(server):
    server.faults.has_residual = False
    with moving(server):
        tracker = track(server)
        pose = until(tracker, is_pose)
        assert_true(pose)
        assert pose.uncertainty_m is None
        tracker.close()


def test_without_the_client_library_the_message_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "qtm_rt", None)
    with pytest.raises(UserError, match=r"pip install 'vvvaltr\[qtm\]'"):
        open_tracker(QtmTable(host="127.0.0.1", body="robot"))


def test_a_robot_that_turns_round_and_round_keeps_a_heading_within_half_a_turn(server):
    tracker = track(server)
    for yaw_rad in [0.9 * step for step in range(16)]:  # two turns and more, in steps that one frame can show
        server.send(Pose(time.monotonic(), (0.0, 0.0, 0.0), yaw_rad))
        heading_rad = math.remainder(yaw_rad, math.tau)
        until(tracker, lambda pose, yaw_rad=heading_rad: is_pose(pose) and abs(pose.yaw_rad - yaw_rad) < 1e-5)
    tracker.close()


def test_a_body_that_is_not_seen_is_lost_at_once_and_found_again(server):
    tracker = track(server)
    server.send(Pose(time.monotonic(), (0.0, 0.0, 0.0)))
    until(tracker, is_pose)
    server.send_lost(time.monotonic())
    assert until(tracker, lambda what: not is_pose(what)) == "the tracker does not see the robot"
    server.send(Pose(time.monotonic(), (0.0, 0.0, 0.0)))
    until(tracker, is_pose)
    tracker.close()


def test_a_matrix_that_is_no_rotation_is_no_pose(server):
    tracker = track(server)
    unseen, flat = (math.nan,) * 13, (0.0,) * 13
    server.send_bytes(frame(1, 1, (unseen, flat), Component.BODIES_WITH_RESIDUAL))
    until(tracker, says("does not see"))
    tracker.close()


def test_a_frame_number_that_stands_still_is_a_loss_that_says_so(server, tracked):
    server.faults.repeats_frame = True
    assert "it repeats frame" in until(tracked, lambda what: not is_pose(what))
    server.faults.repeats_frame = False
    assert_true(until(tracked, is_pose))


@pytest.mark.parametrize(
    ("event", "words"),
    [
        (Event.CONNECTION_CLOSED, "closed the measurement"),
        (Event.CAPTURE_STOPPED, "capture has stopped"),
        (Event.FILE_STOPPED, "no longer plays"),
        (Event.SHUTTING_DOWN, "shutting down"),
    ],
)
def test_an_event_that_ends_the_frames_is_the_reason_until_the_next_frame(server, event, words):
    tracker = track(server)
    server.send(Pose(time.monotonic(), (0.0, 0.0, 0.0)))
    until(tracker, is_pose)
    server.tell(event)
    assert words in until(tracker, lambda what: not is_pose(what))
    server.send(Pose(time.monotonic(), (0.0, 0.0, 0.0)))
    until(tracker, is_pose)
    tracker.close()


def test_without_a_measurement_the_reason_is_that_there_are_no_frames(server):
    tracker = track(server)
    assert "start a measurement" in until(tracker, says("no frames"))
    with moving(server):
        assert_true(until(tracker, is_pose))
        server.tell_no_more_data()
    assert "start a measurement" in until(tracker, says("no frames"))
    tracker.close()


def test_after_a_lost_connection_it_connects_again(server, tracked):
    server.hang_up()
    assert "is lost" in until(tracked, lambda what: not is_pose(what))
    assert_true(until(tracked, is_pose))


def test_after_a_restart_of_qtm_at_other_frames_and_times_it_is_believed_again():
    first = QtmServer()
    with moving(first, clock_ahead_s=1000.0):
        tracker = track(first)
        until(tracker, is_pose)
    first.close()
    until(tracker, lambda what: not is_pose(what))
    second = QtmServer(port=first.port)
    with moving(second):
        assert_true(until(tracker, is_pose))
        tracker.close()
    second.close()


def test_silence_is_noticed_and_told(server, tracked):
    server.faults.is_mute = True
    until(tracked, says("s old"), within_s=1.0)
    assert "silent" in until(tracked, says("silent"), within_s=4.0)
    server.faults.is_mute = False
    assert_true(until(tracked, is_pose))


def test_changed_settings_are_read_again(server):
    with moving(server):
        tracker = track(server)
        until(tracker, is_pose)
        server.bodies = ("another", "wand", "robot")
        server.tell(Event.SETTINGS_CHANGED)
        until(tracker, lambda what: not is_pose(what))
        for _ in range(10):
            assert_true(until(tracker, is_pose))
        tracker.close()


@pytest.mark.parametrize("disabled", ["wand", "another"])
def test_a_body_that_is_switched_off_is_left_out_of_the_frames(disabled):
    server = QtmServer(bodies=("wand", "another", "robot"), faults=QtmFaults(disabled=(disabled,)))
    with moving(server):
        tracker = track(server)
        assert_true(until(tracker, is_pose))
        tracker.close()
    server.close()


def test_a_body_that_qtm_does_not_know_is_refused_with_those_that_it_knows(server):
    assert "'rodot', but QTM at 127.0.0.1" in refusal_of(server, UserError, body="rodot")
    assert "knows 'wand', 'robot'" in refusal_of(server, UserError, body="rodot")


def test_a_robot_that_is_switched_off_is_refused(server):
    server.faults.disabled = ("robot",)
    assert "switched off" in refusal_of(server, UserError)


def test_a_qtm_that_is_too_old_is_refused(server):
    server.faults.versions = ("1.7",)
    message = refusal_of(server, UserError)
    assert "does not speak version 1.25" in message and "update QTM" in message


def test_another_vertical_axis_is_refused(server):
    server.faults.vertical = "+Y"
    with moving(server):
        assert "calibrate it with +Z upwards" in refusal_of(server, UserError)


def test_a_mute_server_is_given_up():
    server = QtmServer(faults=QtmFaults(is_mute=True))
    began_s = time.monotonic()
    assert "does not answer within 0.5 s" in refusal_of(server, LinkLost, patience_s=0.5)
    assert time.monotonic() - began_s < 2.0
    server.close()


def test_no_server_is_refused_with_the_address():
    server = QtmServer()
    server.close()
    message = refusal_of(server, LinkLost)
    assert f"QTM at 127.0.0.1:{server.port}: nothing listens there" in message and "tracker.host" in message


@pytest.mark.parametrize(
    "said", [struct.pack("<II", 0, 3), struct.pack("<II", 2**31, 3), b"HTTP/1.1 400 Bad Request\r\n\r\n", b"\0" * 64]
)
def test_a_server_that_speaks_something_else_is_refused_at_once(said):
    listening = socket.create_server(("127.0.0.1", 0))

    def answer() -> None:
        wire, _ = listening.accept()
        with wire:
            wire.sendall(said)
            wire.recv(1000)

    thread = threading.Thread(target=answer)
    thread.start()
    began_s = time.monotonic()
    with pytest.raises(LinkLost, match="no real-time protocol"):
        QtmTracker("127.0.0.1", listening.getsockname()[1], body="robot")
    assert time.monotonic() - began_s < 1.0
    thread.join()
    listening.close()


@pytest.mark.parametrize(
    "wrong",
    [
        struct.pack("<II", 0, 3),
        struct.pack("<II", 2**31, 3),
        packet(Kind.DATA, b""),
        packet(Kind.DATA, struct.pack("<qII", 0, 10**6, 2**31)),
        packet(Kind.DATA, struct.pack("<qIIIIihh", 0, 10**6, 1, 16, 11, 2**30, 0, 0)),
        packet(Kind.EVENT, b"\xff"),
    ],
)
def test_a_malformed_packet_ends_the_connection_and_never_the_tracker(server, tracked, wrong):
    server.send_bytes(wrong)
    assert "no real-time protocol" in until(tracked, lambda what: not is_pose(what))
    assert_true(until(tracked, is_pose))


def test_it_closes_while_qtm_is_away_and_twice(server):
    tracker = track(server)
    server.close()
    until(tracker, says("QTM"))
    tracker.close()
    tracker.close()
    assert not is_pose(seen(tracker))
