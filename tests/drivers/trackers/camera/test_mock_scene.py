"""What the mock's camera shows."""

import numpy as np
import pytest

from vvvaltr.controller.core.values import Pose
from vvvaltr.drivers.trackers.camera.feed import FLOOR_M, TAG, Scene, mock_view
from vvvaltr.drivers.trackers.camera.pictures import Painter
from vvvaltr.drivers.trackers.camera.sight import Sight, Unseen


@pytest.fixture
def scene() -> Scene:
    return Scene(Painter(mock_view(), TAG, FLOOR_M), mock_view())


def place_seen(scene: Scene, pose: Pose | None) -> np.ndarray | None:
    try:
        seen = Sight(mock_view(), TAG).read(scene.picture(pose))
    except Unseen:
        return None
    return np.array([seen.x_m, seen.y_m])


def test_the_robot_is_shown_where_its_twin_is(scene):
    assert place_seen(scene, Pose(0.0, (0.1, -0.1, 0.04))) == pytest.approx([0.1, -0.1], abs=0.0005)


def test_a_twin_that_is_lifted_is_shown_higher(scene):
    scene.picture(Pose(0.0, (0.3, 0.0, 0.04)))
    nearer = place_seen(scene, Pose(0.02, (0.3, 0.0, 0.05)))
    assert nearer[0] == pytest.approx(0.3 * (1.0 - 0.06) / (1.0 - 0.07), abs=0.001)


def test_two_poses_at_almost_the_same_time_tell_no_speed(scene):
    scene.picture(Pose(0.0, (0.1, 0.0, 0.04)))
    assert place_seen(scene, Pose(1e-6, (0.101, 0.0, 0.04))) == pytest.approx([0.101, 0.0], abs=0.0005)


def test_a_hand_hides_the_robot(scene):
    scene.picture(Pose(0.0, (0.1, 0.0, 0.04)))
    assert place_seen(scene, None) is None
    assert scene.at_rest(1.0) is None  # and goes on to do so while nothing is told
    scene.picture(Pose(2.0, (0.1, 0.0, 0.04)))
    assert scene.at_rest(3.0) == Pose(3.0, (0.1, 0.0, 0.04))


def test_a_robot_that_has_left_the_picture_is_carried_back_once_it_lies_still(scene):
    assert place_seen(scene, Pose(0.0, (0.9, 0.0, 0.04))) is None
    assert place_seen(scene, Pose(1.0, (0.9, 0.0, 0.04))) is None
    assert place_seen(scene, Pose(2.5, (0.9, 0.0, 0.04))) == pytest.approx([0.0, 0.0], abs=0.0005)
    assert place_seen(scene, Pose(2.6, (0.95, 0.0, 0.04))) == pytest.approx([0.05, 0.0], abs=0.0005)
