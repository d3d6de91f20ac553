"""The camera as a tracker: fresh poses or a reason, from real pictures, through a process of its own."""

import math
import os
import signal
import threading
import time

import msgspec
import pytest

from vvvaltr.controller.core.errors import TrackingLost, UserError
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.camera import messages, opening, watcher
from vvvaltr.drivers.trackers.camera.feed import LENS, TAG, make_feed, mock_view
from vvvaltr.drivers.trackers.camera.frames import FrameWriter
from vvvaltr.drivers.trackers.camera.pictures import Painter
from vvvaltr.drivers.trackers.camera.sight import Sighting
from vvvaltr.drivers.trackers.camera.table import CameraTable, FloorTagTable, TagTable, lens_table
from vvvaltr.drivers.trackers.camera.tracker import CameraTracker
from vvvaltr.drivers.trackers.camera.watcher import robot_place
from vvvaltr.drivers.trackers.registry import TRACKERS


class Robot(threading.Thread):
    """Tells a feed 25 poses a second of a robot that moves to and fro, or that a hand hides it."""

    def __init__(self, feed) -> None:
        super().__init__(daemon=True)
        self._feed = feed
        self.is_hidden = False
        self.is_over = threading.Event()

    @staticmethod
    def x_m(t_s: float) -> float:
        return 0.1 * math.sin(t_s)

    def run(self) -> None:
        while not self.is_over.wait(0.04):
            now_s = time.monotonic()
            if self.is_hidden:
                self._feed.send_lost(now_s)
            else:
                self._feed.send(Pose(now_s, (self.x_m(now_s), 0.05, 0.04), 0.5))


@pytest.fixture(scope="module")
def mock():
    mock = make_feed()
    robot = Robot(mock.feed)
    robot.start()
    yield mock.table, robot
    robot.is_over.set()
    robot.join()
    mock.feed.close()


@pytest.fixture
def tracker(mock):
    mock[1].is_hidden = False
    tracker = CameraTracker(mock[0])
    until(tracker, is_pose)
    yield tracker
    tracker.close()


def until(tracker, wanted) -> Pose | str:
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


def is_lost(seen) -> bool:
    return isinstance(seen, str)


def says(words):
    """Return a test whether a reason has these words: a busy computer may give another one first, an old pose."""
    return lambda seen: is_lost(seen) and words in seen


def test_poses_are_where_the_robot_was_when_the_picture_was_taken(tracker):
    for _ in range(20):
        asked_s = time.monotonic()
        pose = until(tracker, is_pose)
        assert pose.position_m[0] == pytest.approx(Robot.x_m(pose.t_s), abs=0.0005)
        assert pose.position_m[1:] == (pytest.approx(0.05, abs=0.0005), TAG.height_m)
        assert pose.yaw_rad == pytest.approx(0.5, abs=0.01)
        assert 0.0 < pose.uncertainty_m < 0.0005
        assert asked_s - pose.t_s < 0.2
        time.sleep(0.02)


def test_it_tells_what_the_camera_does_and_how_high_it_hangs(tracker):
    assert (tracker.settings.width_px, tracker.settings.height_px) == (1280, 720)
    assert tracker.settings.camera_height_m == pytest.approx(1.0, abs=0.002)


def test_a_hidden_robot_is_lost_with_the_reason_and_found_again(mock, tracker):
    mock[1].is_hidden = True
    until(tracker, says("does not see tag 0; the last pose is"))
    time.sleep(0.3)
    with pytest.raises(TrackingLost):
        tracker.pose()
    mock[1].is_hidden = False
    pose = until(tracker, is_pose)
    assert pose.position_m[0] == pytest.approx(Robot.x_m(pose.t_s), abs=0.0005)


def test_a_picture_a_second_is_kept(tracker):
    tracker.take_photos()
    time.sleep(2.2)
    photos = tracker.take_photos()
    assert len(photos) in (2, 3)
    assert all(photo.jpeg.startswith(b"\xff\xd8") for photo in photos)
    assert photos[1].t_s - photos[0].t_s == pytest.approx(1.0, abs=0.2)
    assert tracker.take_photos() == ()


def test_no_picture_is_kept_where_the_file_says_so(mock):
    mock[1].is_hidden = False
    tracker = CameraTracker(with_changes(mock, pictures=False))
    until(tracker, is_pose)
    time.sleep(1.1)
    assert tracker.take_photos() == ()
    tracker.close()


def test_when_its_process_dies_the_robot_is_lost(tracker):
    os.kill(tracker._process.pid, signal.SIGKILL)
    assert until(tracker, says("process")) == "the camera's process has ended"


def test_when_its_process_hangs_the_robot_is_lost(tracker):
    os.kill(tracker._process.pid, signal.SIGSTOP)
    try:
        until(tracker, says("s old"))
    finally:
        os.kill(tracker._process.pid, signal.SIGCONT)


def test_what_another_program_does_not_show_for_a_while_is_lost_and_found_again(tmp_path, monkeypatch):
    monkeypatch.setattr(opening, "_GONE_S", 0.05)
    monkeypatch.setattr(watcher, "_CHECK_S", 0.01)
    picture = Painter(mock_view(), TAG, {}).picture(Pose(0.0, (0.1, -0.05, TAG.height_m), 0.5))
    writer = FrameWriter(tmp_path / "frames", LENS.width_px, LENS.height_px, 1000.0)
    tag = TagTable(size_m=TAG.size_m, height_m=TAG.height_m)
    place = f"frames:{tmp_path / 'frames'}"
    table = CameraTable(source=place, tag=tag, camera_height_m=1.0, pictures=False, lens=lens_table(LENS))
    lateness_s, told = [0.0, -3600.0, 0.0], []

    def say(news) -> None:
        told.append(news)
        if isinstance(news, messages.Ready | messages.Unseen):
            writer.write(time.monotonic() - lateness_s.pop(0), picture)

    with pytest.raises(IndexError):  # no picture is left to write
        watcher.watch(table, say)

    kinds = [messages.Ready, messages.Seen, messages.Unseen, messages.Unseen, messages.Seen, messages.Unseen]
    assert [type(news) for news in told] == kinds
    assert "is the program that writes it running?" in told[2].reason
    assert "from the future" in told[3].reason


def test_its_process_ends_with_it_and_it_can_be_closed_twice(tracker):
    tracker.close()
    assert tracker._process.returncode == 0
    tracker.close()


def with_changes(mock, **changes) -> CameraTable:
    return msgspec.structs.replace(mock[0], **changes)


def test_a_camera_without_a_lens_is_refused_with_the_cure(mock):
    with pytest.raises(UserError, match="run vvvaltr camera ROBOT calibrate first"):
        CameraTracker(with_changes(mock, lens=None))


def test_a_lens_for_other_pictures_is_refused(mock):
    lens = msgspec.structs.replace(mock[0].lens, width_px=640, height_px=480)
    with pytest.raises(UserError, match="1280 x 720 pixels, and the lens was calibrated at 640 x 480"):
        CameraTracker(with_changes(mock, lens=lens))


def test_a_camera_that_is_not_there_is_refused(mock):
    with pytest.raises(UserError, match="camera /dev/video63 is not there"):
        CameraTracker(with_changes(mock, source=63))


def test_a_tag_of_another_size_than_the_file_says_gives_no_pose_but_the_cure(mock):
    mock[1].is_hidden = False
    tracker = CameraTracker(with_changes(mock, tag=TagTable(size_m=0.06, height_m=0.06)))
    try:
        assert until(tracker, says("mm wide")).endswith("the camera's height")
    finally:
        tracker.close()


def test_without_opencv_the_extra_is_named(mock, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"pip install 'vvvaltr\[camera\]'"):
        CameraTracker(mock[0])


def test_the_registry_knows_the_camera():
    assert TRACKERS.named("camera").table is CameraTable


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"floor": (FloorTagTable(id=1, x_m=0.0, y_m=0.0),)}, "floor has 1 tags"),
        ({"floor": tuple(FloorTagTable(id=n, x_m=0.0, y_m=0.0) for n in range(4))}, "same id"),
        ({"camera_height_m": 0.05}, "camera_height_m is 0.05; allowed: above tag.height_m"),
    ],
)
def test_a_table_that_makes_no_sense_is_refused(changes, complaint):
    with pytest.raises(ValueError, match=complaint):
        CameraTable(tag=TagTable(size_m=0.04, height_m=0.06), **changes)


def test_the_robots_centre_is_told_from_a_tag_that_is_mounted_aside():
    seen = Sighting(1.0, 2.0, math.pi / 2.0, 0.0, None)
    tag = TagTable(size_m=0.04, height_m=0.06, x_m=0.1, y_m=0.02, yaw_rad=math.pi / 2.0)
    assert robot_place(seen, tag) == (pytest.approx(0.9), pytest.approx(1.98), pytest.approx(0.0))


def test_no_pose_is_held_or_invented_while_the_robot_is_hidden(mock, tracker):
    """A quick form of the thousand occlusions of ``benchmarks.camera``."""
    for _ in range(5):
        mock[1].is_hidden, hidden_s = True, time.monotonic()
        found = []
        while time.monotonic() < hidden_s + mock[0].age_limit_s + 0.2:
            try:
                found.append(tracker.pose())
            except TrackingLost:
                found.append(None)
            time.sleep(0.01)
        assert found[-1] is None
        assert all(pose is None or pose.t_s < hidden_s + 0.05 for pose in found)
        mock[1].is_hidden = False
        until(tracker, is_pose)
