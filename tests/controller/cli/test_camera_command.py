"""`vvvaltr camera`, as a user runs it: on pictures of a mock's camera."""

import json
import tomllib
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
import pytest
from board_views import write_board_views

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.camera import opening
from vvvaltr.drivers.trackers.camera.feed import FLOOR_M, LENS, TAG, mock_view
from vvvaltr.drivers.trackers.camera.frames import FrameWriter
from vvvaltr.drivers.trackers.camera.pictures import Painter

POSE = Pose(0.0, (0.1, -0.05, TAG.height_m), 0.5)
ROBOT = """# our robot
body = "prism3"

[[line]]
driver = "node"
port = "/dev/ttyACM0"

[[line.motor]]
max_hz = 16.0

[tracker]
kind = "camera"
source = "{source}"

[tracker.tag]
id = 0  # on a mast
size_m = 0.04
height_m = 0.06
"""
LENS_TABLE = f"""
[tracker.lens]
width_px = 1280
height_px = 720
focal_px = {list(LENS.focal_px)}
centre_px = {list(LENS.centre_px)}
distortion = {list(LENS.distortion)}
"""
FLOOR = "".join(f"\n[[tracker.floor]]\nid = {n}\nx_m = {x}\ny_m = {y}\n" for n, (x, y) in FLOOR_M.items())


@pytest.fixture(scope="module")
def pictures(tmp_path_factory) -> Path:
    """A second of a robot at rest."""
    folder = tmp_path_factory.mktemp("pictures")
    painter = Painter(mock_view(), TAG, FLOOR_M)
    for number in range(60):
        cv2.imwrite(str(folder / f"{number:03}.jpg"), painter.picture(POSE))
    return folder


@pytest.fixture
def robot(tmp_path, monkeypatch, pictures) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT.format(source=pictures) + FLOOR + LENS_TABLE)
    return path


def test_show_draws_the_pose_and_tells_it(robot, capsys):
    assert main(["camera", str(robot), "show", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["pose"]["x_m"] == pytest.approx(0.1, abs=0.0005)
    assert told["pose"]["yaw_rad"] == pytest.approx(0.5, abs=0.02)
    assert told["camera_height_m"] == pytest.approx(1.0, abs=0.002)
    picture = cv2.imread("camera.png")
    assert picture.shape == (720, 1280, 3)
    assert np.ptp(picture.astype(int), axis=2).max() > 100  # something is drawn in colour


def test_pictures_are_looked_for_beside_the_robots_file(robot, tmp_path, monkeypatch, pictures, capsys):
    (tmp_path / "pictures").symlink_to(pictures)
    robot.write_text(ROBOT.format(source="pictures") + FLOOR + LENS_TABLE)
    monkeypatch.chdir("/")
    assert main(["camera", str(robot), "show", "--out", str(tmp_path / "seen.png")]) == 0


def test_show_without_a_lens_fails_with_the_cure_and_still_draws_what_is_seen(robot, capsys, pictures):
    robot.write_text(ROBOT.format(source=pictures))
    assert main(["camera", str(robot), "show", "--out", "seen"]) == 1
    assert (
        "tracker.lens is missing; run vvvaltr camera ROBOT calibrate first; seen.png shows" in capsys.readouterr().err
    )
    assert Path("seen.png").exists()


def test_tags_and_board_are_written_for_printing(robot, capsys):
    assert main(["camera", str(robot), "print-tag", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["tags"] == [0, 1, 2, 3, 4]
    assert all(Path(name).stat().st_size > 1000 for name in told["files"])
    assert main(["camera", str(robot), "print-tag", "--board", "--out", "sheet.svg"]) == 0
    assert Path("sheet.svg").read_text().startswith("<svg")


def test_a_calibrated_lens_is_kept_in_the_robots_file_with_its_comments(robot, tmp_path, capsys):
    views = tmp_path / "views"
    write_board_views(views, 12)
    robot.write_text(ROBOT.format(source=views).replace('kind = "camera"', 'kind = "camera"\nrate_hz = 5'))
    assert main(["camera", str(robot), "calibrate", "--views", "7", "--json"]) == 0
    text = robot.read_text()
    assert "# our robot" in text
    assert "# on a mast" in text
    kept = tomllib.loads(text)["tracker"]["lens"]
    assert kept == json.loads(capsys.readouterr().out)["lens"]
    assert kept["focal_px"] == pytest.approx(list(LENS.focal_px), rel=0.01)
    assert main(["camera", str(robot), "calibrate", "--views", "6"]) == 0  # a second time replaces it
    assert robot.read_text().count("[tracker.lens]") == 1


def test_too_few_views_are_told_and_nothing_is_written(robot, capsys):
    before = robot.read_text()
    assert main(["camera", str(robot), "calibrate"]) == 1
    assert "only 0 different views of the board were seen, 15 are needed" in capsys.readouterr().err
    assert robot.read_text() == before


def test_check_tells_the_cameras_own_cure(robot, pictures, capsys):
    robot.write_text(ROBOT.format(source=pictures) + FLOOR)
    assert main(["check", str(robot)]) == 1
    assert "\ntracker: run vvvaltr camera ROBOT calibrate first\n" in capsys.readouterr().out


def test_a_robot_with_another_tracker_is_told_what_to_set(robot, capsys):
    robot.write_text(ROBOT.split("[tracker]")[0] + '[tracker]\nkind = "stream"\nport = 5005\n')
    assert main(["camera", str(robot), "show"]) == 2
    assert "tracker.kind is 'stream'; set it to \"camera\"" in capsys.readouterr().err


@pytest.mark.parametrize("action", ["show", "calibrate"])
def test_pictures_whose_program_has_died_are_not_waited_for(action, robot, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(opening, "_GONE_S", 0.05)
    with closing(FrameWriter(tmp_path / "frames", 1280, 720, 1000.0)) as writer:
        writer.write(1.0, np.full((720, 1280), 128, np.uint8))
    robot.write_text(ROBOT.format(source=f"frames:{tmp_path / 'frames'}") + FLOOR + LENS_TABLE)
    assert main(["camera", str(robot), action]) == 1
    assert "frames for 0.05 s; is the program that writes it running?" in capsys.readouterr().err


@pytest.mark.parametrize("action", ["print-tag", "show"])
@pytest.mark.parametrize("out", [".", "..", "/", "pictures"])
def test_the_name_of_a_folder_is_refused_with_one_that_would_do(action, out, robot, tmp_path, capsys):
    (tmp_path / "pictures").mkdir()
    assert main(["camera", str(robot), action, "--out", out]) == 2
    assert f"--out {out} names no file" in capsys.readouterr().err
