import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vvvaltr.twin.posture import continue_angles, fit_rotation, place_nodes, rotate_posture

RANDOM = np.random.default_rng(7)
HALVES_M = np.array([0.05, 0.04, 0.03])
NODES_M = RANDOM.normal(0.0, 0.05, (12, 3))


def random_posture():
    quaternions = Rotation.random(3, random_state=3).as_quat()[:, [3, 0, 1, 2]]
    return np.hstack([RANDOM.normal(0.0, 0.1, (3, 3)), quaternions])


def test_nodes_lie_half_a_length_up_and_down_each_struts_axis():
    posture = random_posture()
    nodes_m = place_nodes(posture, HALVES_M)

    for strut, (x, y, z, w, i, j, k) in enumerate(posture):
        axis = Rotation.from_quat([i, j, k, w]).apply([0.0, 0.0, HALVES_M[strut]])
        assert nodes_m[2 * strut] == pytest.approx(axis + np.array([x, y, z]))
        assert nodes_m[2 * strut + 1] == pytest.approx(np.array([x, y, z]) - axis)


def test_turning_a_posture_turns_its_nodes_by_yaw_then_pitch_then_roll():
    posture, about_m, angles = random_posture(), np.array([0.1, -0.2, 0.3]), (0.7, -0.4, 2.1)

    nodes_m = place_nodes(rotate_posture(posture, angles, about_m), HALVES_M)

    rotation = Rotation.from_euler("ZYX", angles)
    assert nodes_m == pytest.approx(about_m + rotation.apply(place_nodes(posture, HALVES_M) - about_m))


@pytest.mark.parametrize("seed", range(5))
def test_the_best_rotation_is_the_one_that_was_made_even_under_noise(seed):
    rotation = Rotation.random(random_state=seed)
    moved_m = rotation.apply(NODES_M) + np.array([1.0, 2.0, 3.0])

    assert fit_rotation(moved_m, NODES_M) == pytest.approx(rotation.as_matrix())
    noisy = fit_rotation(moved_m + RANDOM.normal(0.0, 1e-4, moved_m.shape), NODES_M)
    assert noisy == pytest.approx(rotation.as_matrix(), abs=0.01)
    assert np.linalg.det(noisy) == pytest.approx(1.0)


def test_the_best_rotation_never_mirrors():
    assert np.linalg.det(fit_rotation(NODES_M * [1.0, 1.0, -1.0], NODES_M)) == pytest.approx(1.0)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_angles_run_on_through_whole_turns_about_every_axis(axis):
    wanted, angles = np.zeros(3), (0.0, 0.0, 0.0)
    for turn in np.linspace(0.0, 3.0 * math.tau, 200)[1:]:
        wanted[axis] = turn
        angles = continue_angles(Rotation.from_euler("ZYX", wanted).as_matrix(), angles)
        assert angles == pytest.approx(tuple(wanted), abs=1e-6)
