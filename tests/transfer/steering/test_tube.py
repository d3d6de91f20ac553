"""The tube holds a drive that goes as its belief says, and none that does not."""

import numpy as np
import pytest
from gliding import GAITS, GlidingRobot, tried

from vvvaltr.transfer.steering.arcs import travel
from vvvaltr.transfer.steering.repertoire import learn_repertoire
from vvvaltr.transfer.steering.tube import Tube

VELOCITY = np.array([0.010, 0.002, 0.2, 0.001, -0.001])
SPREAD = np.diag([0.003, 0.003, 0.05, 0.0005, 0.0005]) ** 2


def tube(covariance: np.ndarray = SPREAD, delay_s: float = 0.0) -> Tube:
    return Tube(np.zeros(3), 0.0, delay_s, VELOCITY, covariance)


def test_the_expected_course_is_that_of_the_planner() -> None:
    moved_m, turn_rad = travel(VELOCITY[:3], np.array(4.0))

    assert tube(delay_s=1.0).pose(5.0) == pytest.approx([*(moved_m + 4.0 * VELOCITY[3:]), turn_rad])


def test_nine_drives_of_ten_are_inside_at_any_time() -> None:
    random = np.random.default_rng(1)

    def ends(time_s: float) -> np.ndarray:
        drawn = random.multivariate_normal(VELOCITY, SPREAD, 600)
        return np.array([Tube(np.zeros(3), 0.0, 0.0, each, SPREAD).pose(time_s) for each in drawn])

    for time_s in (3.0, 8.0):
        inside = np.mean([tube().holds(end, time_s) for end in ends(time_s)])

        assert 0.85 < inside < 0.97


def test_a_drive_that_stands_still_leaves_it() -> None:
    known = SPREAD / 25.0

    assert tube(known).holds(np.zeros(3), 0.05)
    assert not tube(known).holds(np.zeros(3), 3.0)


def test_it_is_narrower_once_a_part_of_the_drive_has_been_seen() -> None:
    belief = learn_repertoire([tried(GlidingRobot(), 2)]).belief()
    seen = tried(GlidingRobot())[0]
    from vvvaltr.transfer.steering.passage import passage

    _, before = belief.underway(0, None)
    mean, after = belief.underway(0, passage(seen.poses))

    assert seen.gait == GAITS[0]
    assert np.linalg.eigvalsh(before - after).min() > -1e-12
    assert np.trace(after) < 0.5 * np.trace(before)
    assert mean[0] == pytest.approx(0.020, abs=0.002)


def test_headings_are_compared_round_the_circle() -> None:
    turned = np.append(tube().pose(3.0)[:2], tube().pose(3.0)[2] - 2.0 * np.pi)

    assert tube().distance(turned, 3.0) == pytest.approx(0.0, abs=1e-6)
