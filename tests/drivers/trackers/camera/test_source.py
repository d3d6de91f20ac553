"""Where pictures come from, and what is said when they do not."""

import math
import struct
import time

import cv2
import numpy as np
import pytest

from vvvaltr.controller.core.errors import UserError
from vvvaltr.drivers.trackers.camera import opening
from vvvaltr.drivers.trackers.camera.device import DeviceSource, device_problem
from vvvaltr.drivers.trackers.camera.frames import FrameReader, FrameWriter
from vvvaltr.drivers.trackers.camera.opening import open_source
from vvvaltr.drivers.trackers.camera.source import NoMorePictures, Wanted

FAST = Wanted(rate_hz=100.0)
NO_SLOTS = struct.pack("<8sIIIdq", b"vvvaltr1", 64, 48, 0, 30.0, 5)


def grey(level: int) -> np.ndarray:
    return np.full((48, 64), level, np.uint8)


def test_a_folder_of_pictures_is_shown_in_order_at_its_rate_and_then_ends(tmp_path):
    for number in range(5):
        cv2.imwrite(str(tmp_path / f"{number:03}.png"), grey(10 * number))
    (tmp_path / "notes.txt").write_text("no picture")
    source = open_source(str(tmp_path), FAST)
    frames = [source.newest() for _ in range(3)]
    levels = [int(frame.grey[0, 0]) for frame in frames]
    assert levels == sorted(levels)
    assert frames[1].t_s - frames[0].t_s >= 0.0099
    assert source.applied == Wanted(64, 48, 100.0)
    with pytest.raises(NoMorePictures, match="have ended"):
        for _ in range(5):
            source.newest()


def test_pictures_that_are_late_are_passed_over(tmp_path):
    for number in range(50):
        cv2.imwrite(str(tmp_path / f"{number:03}.png"), grey(number))
    source = open_source(str(tmp_path), FAST)
    source.newest()
    time.sleep(0.1)
    frame = source.newest()
    assert frame.grey[0, 0] >= 9
    assert time.monotonic() - frame.t_s < 0.05


def test_a_film_is_shown_in_real_time_and_then_ends(tmp_path):
    path = tmp_path / "film.avi"
    film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 50.0, (64, 48))
    for number in range(10):
        film.write(np.full((48, 64, 3), 20 * number, np.uint8))
    film.release()
    source = open_source(str(path), FAST)
    frames = []
    with pytest.raises(NoMorePictures, match=r"film\.avi has ended"):
        while True:
            frames.append(source.newest())
    source.close()
    assert (source.applied.width_px, source.applied.height_px, source.applied.rate_hz) == (64, 48, 50.0)
    assert len(frames) > 5
    assert np.diff([frame.t_s for frame in frames]).min() > 0.015
    assert frames[-1].grey.shape == (48, 64)


def test_another_programs_newest_picture_is_taken_and_each_only_once(tmp_path):
    writer = FrameWriter(tmp_path / "frames", 64, 48, 30.0)
    for level in range(9):
        writer.write(1.0 + level, grey(level))
    source = open_source(f"frames:{tmp_path / 'frames'}", FAST)
    frame = source.newest()
    assert (frame.t_s, frame.grey[0, 0], frame.grey.shape) == (9.0, 8, (48, 64))
    reader = FrameReader(tmp_path / "frames")
    assert reader.newest(after=8) is None
    writer.write(10.0, grey(9))
    assert reader.newest(after=8)[1] == 10.0
    assert source.newest().t_s == 10.0


def test_a_picture_of_another_size_is_not_handed_on(tmp_path):
    writer = FrameWriter(tmp_path / "frames", 64, 48, 30.0)
    with pytest.raises(ValueError, match="shape"):
        writer.write(0.0, np.zeros((64, 48), np.uint8))


@pytest.mark.parametrize("content", [b"", b"vvvaltr1", b"\0" * 5000, b"vvvaltr1" + b"\xff" * 5000, NO_SLOTS])
def test_a_file_that_holds_no_pictures_is_refused_with_its_name(tmp_path, content):
    path = tmp_path / "frames"
    path.write_bytes(content)
    with pytest.raises(UserError, match=f"{path}: it"):
        open_source(f"frames:{path}", FAST)


def test_a_program_that_writes_no_more_pictures_is_asked_for_and_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(opening, "_GONE_S", 0.05)
    writer = FrameWriter(tmp_path / "frames", 64, 48, 1000.0)
    writer.write(1.0, grey(1))
    source = open_source(f"frames:{tmp_path / 'frames'}", FAST)
    source.newest()
    began_s = time.monotonic()
    for _ in range(2):
        with pytest.raises(NoMorePictures, match=r"no new picture in .*frames for 0\.05 s; is the program .* running"):
            source.newest()
    assert time.monotonic() - began_s < 0.2  # the second time at once
    writer.write(2.0, grey(2))
    assert source.newest().t_s == 2.0


@pytest.mark.parametrize("t_s", [time.time(), math.inf], ids=["wall time", "infinite"])
def test_a_picture_from_the_future_which_would_never_grow_old_is_refused(tmp_path, t_s):
    FrameWriter(tmp_path / "frames", 64, 48, 30.0).write(t_s, grey(1))
    source = open_source(f"frames:{tmp_path / 'frames'}", FAST)
    with pytest.raises(NoMorePictures, match=r"frames is from the future; give it the time of time\.monotonic"):
        source.newest()


def test_a_folder_whose_first_picture_cannot_be_read_is_refused_with_its_name(tmp_path):
    (tmp_path / "000.png").write_bytes(b"Dear Sir")
    with pytest.raises(UserError, match=r"tracker\.source: .*000\.png is no picture; remove it"):
        open_source(str(tmp_path), FAST)


def test_a_program_that_is_not_running_is_asked_for(tmp_path):
    with pytest.raises(UserError, match=r"No such file.*running\?"):
        open_source(f"frames:{tmp_path / 'none'}", FAST)


def test_a_film_that_is_not_there_is_named():
    with pytest.raises(UserError, match=r"there is no film or folder nowhere\.mp4"):
        open_source("nowhere.mp4", FAST)


def test_a_file_that_is_no_film_is_named(tmp_path):
    path = tmp_path / "letter.mp4"
    path.write_bytes(b"Dear Sir")
    with pytest.raises(UserError, match=r"letter\.mp4 is no film"):
        open_source(str(path), FAST)


def test_a_folder_without_pictures_is_named(tmp_path):
    with pytest.raises(UserError, match="holds no pictures"):
        open_source(str(tmp_path), FAST)


def test_a_camera_that_is_not_there_is_answered_with_those_that_are(tmp_path):
    assert "no camera at all" in device_problem(tmp_path / "video0")
    (tmp_path / "video2").touch()
    assert device_problem(tmp_path / "video0") == (
        f"camera {tmp_path}/video0 is not there; there are {tmp_path}/video2"
    )
    assert device_problem(tmp_path / "video2") == ""


def test_a_camera_that_one_may_not_use_is_answered_with_the_cure(tmp_path, monkeypatch):
    (tmp_path / "video0").touch()
    monkeypatch.setattr("os.access", lambda *_: False)  # the tests may run as root, who may do everything
    assert "sudo usermod -aG video" in device_problem(tmp_path / "video0")


def test_a_camera_that_does_not_open_is_named_with_what_may_have_it():
    with pytest.raises(UserError, match=r"camera /dev/null does not open: another program has it"):
        open_source("/dev/null", FAST)


class BreakingCapture:
    """Of a camera: each second picture cannot be decoded, or none can."""

    def __init__(self, works: bool) -> None:
        self.works, self.count = works, 0

    def isOpened(self) -> bool:  # noqa: N802
        return True

    def set(self, key: int, value: float) -> bool:
        return True

    def get(self, key: int) -> float:
        return 1e3 * time.monotonic() if key == cv2.CAP_PROP_POS_MSEC else 30.0

    def grab(self) -> bool:
        self.count += 1
        return True

    def retrieve(self) -> tuple[bool, np.ndarray | None]:
        is_whole = self.works and self.count % 2 == 0
        return is_whole, grey(self.count) if is_whole else None


def test_a_broken_picture_of_a_camera_is_passed_over_and_nothing_but_broken_ones_ends_it(tmp_path, monkeypatch):
    (tmp_path / "video0").touch()
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: BreakingCapture(works=True))
    source = DeviceSource(tmp_path / "video0", FAST)
    assert [source.newest().grey[0, 0] for _ in range(2)] == [2, 4]
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: BreakingCapture(works=False))
    with pytest.raises(NoMorePictures, match="video0 gives nothing but broken pictures"):
        DeviceSource(tmp_path / "video0", FAST).newest()


def test_out_of_real_time_every_picture_is_shown(tmp_path):
    for number in range(8):
        cv2.imwrite(str(tmp_path / f"{number:03}.png"), grey(number))
    source = open_source(str(tmp_path), FAST, in_real_time=False)
    shown = []
    with pytest.raises(NoMorePictures):
        while True:
            shown.append(int(source.newest().grey[0, 0]))
            time.sleep(0.02)
    assert shown == list(range(8))
