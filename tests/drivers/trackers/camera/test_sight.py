"""From pictures to places: rendered pictures of a robot whose place is known."""

import math
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.camera.feed import FLOOR_M, LENS, TAG, mock_view
from vvvaltr.drivers.trackers.camera.floor import FloorWatch
from vvvaltr.drivers.trackers.camera.pictures import Looks, Painter
from vvvaltr.drivers.trackers.camera.setup import find_view
from vvvaltr.drivers.trackers.camera.sight import RobotTag, Sight, Unseen
from vvvaltr.drivers.trackers.camera.tags import all_tags
from vvvaltr.drivers.trackers.camera.view import View, looking_down

HARD = Looks(blur_px=1.5, noise=0.02, exposure_s=0.004)


@pytest.fixture(scope="module")
def painter() -> Painter:
    return Painter(mock_view(), TAG, FLOOR_M, looks=HARD)


def pose_at(x_m: float, y_m: float, yaw_rad: float = 0.0, z_m: float = TAG.height_m) -> Pose:
    return Pose(0.0, (x_m, y_m, z_m), yaw_rad)


def off_mm(seen, pose: Pose) -> float:
    return 1000.0 * math.hypot(seen.x_m - pose.position_m[0], seen.y_m - pose.position_m[1])


def walk(count: int):
    """Poses all over the picture, turning, with the velocity of a robot that shakes."""
    for step in range(count):
        x_m, y_m = 0.45 * math.sin(0.7 * step), 0.24 * math.cos(1.1 * step)
        yield pose_at(x_m, y_m, 0.37 * step), (0.2 * math.cos(step), 0.2 * math.sin(2.0 * step), 0.0)


def test_the_place_is_found_to_a_third_of_a_millimetre_all_over_the_picture(painter):
    sight = Sight(mock_view(), TAG)
    off = [off_mm(sight.read(painter.picture(pose, velocity)), pose) for pose, velocity in walk(40)]
    assert np.median(off) < 0.15
    assert max(off) < 0.35


def test_the_heading_is_found_to_half_a_degree(painter):
    sight = Sight(mock_view(), TAG)
    off_deg = [
        abs(math.degrees(math.remainder(sight.read(painter.picture(*moving)).yaw_rad - moving[0].yaw_rad, math.tau)))
        for moving in walk(40)
    ]
    assert np.quantile(off_deg, 0.95) < 0.5


def test_the_uncertainty_is_as_large_as_the_error(painter):
    sight = Sight(mock_view(), TAG)
    pairs = [(sight.read(painter.picture(pose, v)), pose) for pose, v in walk(30)]
    error_mm = np.median([off_mm(*pair) for pair in pairs])
    told_mm = 1000.0 * np.median([seen.uncertainty_m for seen, _ in pairs])
    assert 0.5 < told_mm / error_mm < 4.0


def test_a_robot_that_is_lifted_by_five_millimetres_is_still_within_two(painter):
    pose = pose_at(0.3, 0.2, z_m=TAG.height_m + 0.005)
    assert 0.5 < off_mm(Sight(mock_view(), TAG).read(painter.picture(pose)), pose) < 3.0


def test_another_tag_is_not_the_robots(painter):
    sight = Sight(mock_view(), RobotTag(17, TAG.size_m, TAG.height_m))
    with pytest.raises(Unseen, match="does not see tag 17; put it into the picture"):
        sight.read(painter.picture(pose_at(0.0, 0.0)))


def test_a_covered_tag_is_unseen_and_found_again_wherever_it_is_uncovered(painter):
    sight = Sight(mock_view(), TAG)
    sight.read(painter.picture(pose_at(0.0, 0.0)))
    with pytest.raises(Unseen):
        sight.read(painter.picture(pose_at(0.0, 0.0), hand_m=(0.0, 0.0)))
    elsewhere = pose_at(0.4, -0.2, 1.0)
    assert off_mm(sight.read(painter.picture(elsewhere)), elsewhere) < 0.5


def test_a_hand_that_comes_over_the_tag_never_gives_a_wrong_place(painter):
    sight, pose = Sight(mock_view(), TAG), pose_at(0.05, 0.02, 0.3)
    seen = []
    for share in np.linspace(0.0, 1.0, 60):
        try:
            seen.append(off_mm(sight.read(painter.picture(pose, hand_m=(0.05, -0.15 + 0.17 * share))), pose))
        except Unseen:
            continue
    assert 5 < len(seen) < 60
    assert max(seen) < 1.0


@pytest.mark.parametrize("size_m", [0.03, 0.055])
def test_a_tag_of_another_size_than_the_file_says_is_not_believed(painter, size_m):
    sight = Sight(mock_view(), RobotTag(TAG.id, size_m, TAG.height_m))
    with pytest.raises(Unseen, match=r"mm wide, and should be .* correct tag.size_m"):
        sight.read(painter.picture(pose_at(0.0, 0.0)))


def test_a_tag_that_leaves_the_picture_is_unseen(painter):
    sight = Sight(mock_view(), TAG)
    with pytest.raises(Unseen):
        sight.read(painter.picture(pose_at(0.63, 0.0)))


def test_pictures_of_nothing_hold_no_tag():
    random = np.random.default_rng(0)
    for _ in range(20):
        noise = cv2.GaussianBlur(random.integers(0, 256, (360, 640), np.uint8), (0, 0), 3.0)
        assert not all_tags(cv2.normalize(noise, noise, 0, 255, cv2.NORM_MINMAX))


def test_a_camera_hung_askew_is_placed_by_its_floor_tags(painter):
    view = find_view(LENS, TAG, FLOOR_M, 0.0, lambda: painter.picture(pose_at(0.0, 0.1)))
    truth = mock_view()
    assert np.linalg.norm(view.position_m - truth.position_m) < 0.002
    assert view.error_m < 0.0003
    pose = pose_at(-0.4, 0.2, 2.0)
    assert off_mm(Sight(view, TAG).read(painter.picture(pose)), pose) < 0.5


def test_floor_tags_that_are_exchanged_are_noticed(painter):
    exchanged = {**FLOOR_M, 1: FLOOR_M[2], 2: FLOOR_M[1]}
    with pytest.raises(UserError, match=r"floor tags .* measure their places again"):
        find_view(LENS, TAG, exchanged, 0.0, lambda: painter.picture(None))


def test_a_floor_tag_that_is_not_seen_is_named_with_those_that_are(painter):
    with pytest.raises(UserError, match=r"does not see tag 9 \(it sees 1, 2, 3, 4\)"):
        find_view(LENS, TAG, {**FLOOR_M, 9: (0.0, 0.0)}, 0.0, lambda: painter.picture(None))


def test_floor_tags_and_a_measured_height_that_disagree_are_refused(painter):
    with pytest.raises(UserError, match=r"put the camera 1\.00 m above the ground.*says 1\.5 m"):
        find_view(LENS, TAG, FLOOR_M, 1.5, lambda: painter.picture(None))


def test_without_floor_tags_the_tags_size_tells_the_height():
    straight = looking_down(LENS, 1.3)
    painter = Painter(straight, TAG, looks=HARD)
    pose = pose_at(0.2, 0.1)
    view = find_view(LENS, TAG, {}, 0.0, lambda: painter.picture(pose))
    assert view.position_m[2] == pytest.approx(1.3, rel=0.02)
    assert off_mm(Sight(view, TAG).read(painter.picture(pose)), pose) < 5.0


def test_a_measured_height_is_taken_as_it_is():
    assert find_view(LENS, TAG, {}, 1.1, lambda: np.zeros((720, 1280), np.uint8)).position_m[2] == 1.1


def test_the_known_plane_undoes_what_the_lens_and_the_tilt_do():
    view = mock_view()
    places = np.random.default_rng(1).uniform([-0.5, -0.25], [0.5, 0.25], (50, 2))
    pixels = view.pixels(np.column_stack([places, np.full(50, 0.06)]))
    assert np.abs(view.on_plane(pixels, 0.06) - places).max() < 2e-5


def test_a_view_is_in_metres_and_y_points_up_in_the_picture():
    view = View(LENS)
    up, right = view.pixels(np.array([[0.0, 0.1, 0.0], [0.1, 0.0, 0.0]]))
    assert up[1] < LENS.centre_px[1] < LENS.centre_px[1] + 1 + abs(right[1] - LENS.centre_px[1])
    assert right[0] > LENS.centre_px[0] + 90


def test_a_camera_that_was_moved_is_noticed_and_one_that_hangs_still_is_not(painter):
    seen = find_view(LENS, TAG, FLOOR_M, 0.0, lambda: painter.picture(None))
    moved = replace(mock_view(), position_m=mock_view().position_m + np.array([0.01, 0.0, 0.0]))
    elsewhere = Painter(moved, TAG, FLOOR_M, looks=HARD)
    watch = FloorWatch(seen, FLOOR_M)
    assert [watch.check(painter.picture(pose_at(0.0, 0.0))) for _ in range(8)] == [None] * 8
    problem = [watch.check(elsewhere.picture(pose_at(0.0, 0.0))) for _ in range(4)][-1]
    assert re.fullmatch(r"floor tag \d is (9|10|11) mm off: camera or tag was moved", problem.reason)
    assert problem.cure == "put it back, or start again"
    assert [watch.check(painter.picture(None)) for _ in range(4)][-1] is None


def test_floor_tags_that_are_covered_say_nothing(painter):
    watch = FloorWatch(find_view(LENS, TAG, FLOOR_M, 0.0, lambda: painter.picture(None)), FLOOR_M)
    empty = Painter(mock_view(), TAG, looks=HARD).picture(None)
    assert [watch.check(empty) for _ in range(4)] == [None] * 4
