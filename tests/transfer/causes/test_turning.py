import tracemalloc

import numpy as np
import pytest

from vvvaltr.controller.core.values import Pose
from vvvaltr.transfer.causes.turning import find_turning

GAIT_HZ = (20.0, -31.0, 13.0)


def shake(turning_hz, rate_hz=100.0, noise_m=0.0003, amplitude_m=0.0003, duration_s=5.0, seed=0):
    """Return the poses of a robot that walks while some motors shake it."""
    random, times_s = np.random.default_rng(seed), np.arange(0.0, duration_s, 1.0 / rate_hz)
    walk = 0.01 * times_s + 0.002 * np.sin(2.0 * times_s)
    places_m = np.stack([walk, 0.5 * walk, np.zeros_like(walk)], axis=1)
    for k, hz in enumerate(turning_hz):
        phases = 2.0 * np.pi * hz * times_s + k
        places_m += amplitude_m * np.stack([np.cos(phases), np.sin(phases), 0.5 * np.cos(phases)], axis=1)
    places_m += random.normal(0.0, noise_m, places_m.shape)
    yaws_rad = 0.1 * times_s + random.normal(0.0, 0.002, len(times_s))
    return [
        Pose(t, tuple(p), yaw) for t, p, yaw in zip(times_s.tolist(), places_m.tolist(), yaws_rad.tolist(), strict=True)
    ]


def test_motors_that_turn_are_seen_though_they_miss_their_frequency_by_two_percent():
    assert find_turning(shake([20.4, 30.5, 13.2]), GAIT_HZ) == (True, True, True)


@pytest.mark.parametrize("dead", [0, 1, 2])
def test_a_motor_that_does_not_turn_is_seen(dead):
    turning = [abs(hz) for motor, hz in enumerate(GAIT_HZ) if motor != dead]

    found = [find_turning(shake(turning, seed=seed), GAIT_HZ) for seed in range(10)]

    assert sum(it[dead] is False for it in found) >= 9
    assert all(it[motor] is True for it in found for motor in range(3) if motor != dead)


def test_a_motor_beyond_half_the_trackers_rate_is_seen_where_its_line_folds_to():
    assert find_turning(shake([20.0, 62.0, 13.0]), (20.0, 62.0, 13.0)) == (True, True, True)
    assert find_turning(shake([20.0, 13.0]), (20.0, 62.0, 13.0)) == (True, False, True)


def test_a_pose_that_was_read_twice_counts_once():
    poses = shake([20.0, 13.0], rate_hz=60.0)

    assert find_turning([pose for pose in poses for _ in range(3)], GAIT_HZ) == find_turning(poses, GAIT_HZ)
    assert find_turning(poses, GAIT_HZ)[1] is False


def test_of_a_long_drive_the_end_is_looked_at_in_little_memory():
    at_first, at_last = shake([20.0, 31.0, 13.0], duration_s=40.0), shake([20.0, 13.0], duration_s=60.0)
    poses = at_first + [pose for pose in at_last if pose.t_s > 39.995]

    tracemalloc.start()
    try:
        found = find_turning(poses, GAIT_HZ)
        _, most_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    assert found == (True, False, True)
    assert most_bytes < 50e6


def test_nearly_equal_motors_are_told_together():
    alike = (20.0, -20.5, 13.0)

    assert find_turning(shake([13.0]), alike) == (False, False, True)
    assert find_turning(shake([20.5, 13.0]), alike) == (None, None, True)


@pytest.mark.parametrize(
    ("why", "poses"),
    [
        ("a tracker of 20 Hz", shake([20.0, 13.0], rate_hz=20.0)),
        ("a tracker of 1 mm that hardly sees the other motors", shake([20.0, 13.0], noise_m=0.001, amplitude_m=0.0001)),
        ("a drive too short", shake([20.0, 13.0], duration_s=2.0)),
        ("a robot at rest: nothing shows that the tracker would see it", shake([])),
        ("a motor that turns a tenth slower than commanded", shake([20.0, 27.9, 13.0])),
        ("no poses", []),
        (
            "a tracker of 10 Hz, each of whose poses is read ten times",
            np.repeat(shake([20.0, 13.0], 10.0), 10).tolist(),
        ),
        ("a clock that goes back and forth", shake([20.0, 13.0])[::-1] + shake([20.0, 13.0])),
    ],
)
def test_where_it_cannot_be_told_nothing_is_told(why, poses):
    assert find_turning(poses, GAIT_HZ)[1] is None, why


def test_a_slow_motor_cannot_be_told_from_the_walk():
    assert find_turning(shake([20.0, 13.0]), (20.0, 5.0, 13.0))[1] is None


def test_a_line_where_those_of_other_motors_mix_tells_nothing():
    gait_hz = (33.9, 48.5, 15.0)

    assert find_turning(shake([33.9, 48.5, 48.5 - 33.9]), gait_hz)[2] is None
    assert find_turning(shake([33.9, 48.5, 15.2]), gait_hz) == (True, True, True)
