import math

import numpy as np
import pytest

from vvvaltr.controller.core.values import Pose
from vvvaltr.transfer.causes.floor import DriftLearner, learn_drift
from vvvaltr.transfer.causes.pieces import cut, weigh

GAIT_HZ = (20.0, -30.0, 10.0)


def drive(own_m_s, drift_m_s, yaw_rad, turn_rad_s, random, duration_s=5.0, noise_m=0.0005):
    """Return the poses of a robot that walks and turns on a drifting floor."""
    times_s = np.arange(0.0, duration_s + 1e-9, 0.05)
    yaws_rad = yaw_rad + turn_rad_s * times_s
    cos, sin = np.cos(yaws_rad), np.sin(yaws_rad)
    velocity = np.stack([cos * own_m_s[0] - sin * own_m_s[1], sin * own_m_s[0] + cos * own_m_s[1]], axis=1) + drift_m_s
    places_m = np.cumsum(velocity * 0.05, axis=0) + random.normal(0.0, noise_m, (len(times_s), 2))
    return [
        Pose(float(t), (float(x), float(y), 0.0), math.remainder(float(yaw), math.tau))
        for t, (x, y), yaw in zip(times_s, places_m, yaws_rad, strict=True)
    ]


def learn(random, drift_m_s, turns_rad_s, gaits, repeats=1):
    own = random.normal(0.0, 0.01, (gaits, 2))
    names = [gait for gait in range(gaits) for _ in range(repeats)]
    trials = [
        cut(drive(own[gait], drift_m_s, random.uniform(-3, 3), turns_rad_s * random.choice([-1, 1]), random))
        for gait in names
    ]
    drift = learn_drift(names, trials, [weigh(GAIT_HZ)] * len(names))
    assert drift is not None
    return drift


def test_a_drive_of_an_hour_is_cut_into_no_more_pieces_than_one_of_a_minute():
    random = np.random.default_rng(0)
    minute, hour = (
        cut(drive((0.01, 0.0), (0.0, 0.0), 0.0, 0.001, random, duration_s)) for duration_s in (61.0, 3600.0)
    )

    assert len(minute) == len(hour) == 60
    assert sum(piece.duration_s for piece in hour) == pytest.approx(3600.0 - 1.25, abs=0.2)


def test_a_robot_that_turns_tells_the_floor_from_itself_in_a_few_trials_without_repeats():
    drift = learn(np.random.default_rng(0), (0.004, -0.003), 0.4, gaits=6)

    assert drift.velocity_m_s == pytest.approx([0.004, -0.003], abs=0.0012)
    assert drift.is_inclined > 0.95
    assert math.degrees(abs(drift.azimuth_rad - math.atan2(-3, 4))) < 15


def test_a_robot_that_does_not_turn_tells_it_from_repeats_at_other_headings():
    drift = learn(np.random.default_rng(1), (0.004, -0.003), 0.0, gaits=3, repeats=6)

    assert drift.velocity_m_s == pytest.approx([0.004, -0.003], abs=0.002)


def test_on_a_level_floor_there_is_next_to_no_drift():
    found = [learn(np.random.default_rng(seed), (0.0, 0.0), 0.4, gaits=8) for seed in range(10)]

    assert np.median([drift.speed_m_s for drift in found]) < 0.0006
    assert np.median([drift.is_inclined for drift in found]) < 0.6


def test_a_robot_that_always_heads_the_same_way_tells_nothing_of_the_floor():
    random = np.random.default_rng(2)
    trials = [cut(drive((0.01 * k, 0.0), (0.004, 0.0), 1.0, 0.0, random)) for k in range(5)]

    assert learn_drift(range(5), trials, [weigh(GAIT_HZ)] * 5) is None


def test_the_drift_grows_with_the_squares_of_the_frequencies():
    drift = learn(np.random.default_rng(0), (0.004, -0.003), 0.4, gaits=6)

    twice = drift.during(2.0 * drift.mean_weight, 5.0)
    assert twice == pytest.approx(2.0 * drift.during(drift.mean_weight, 5.0))
    assert drift.mean_weight == pytest.approx(1400.0)


def test_poses_that_do_not_make_two_pieces_are_left_out():
    random = np.random.default_rng(3)

    assert cut([]) == ()
    assert cut(drive((0.01, 0.0), (0.0, 0.0), 0.0, 0.1, random, duration_s=1.5)) == ()
    assert learn_drift([], [], []) is None


def test_what_the_floor_added_is_told_for_each_trial():
    drift = learn(np.random.default_rng(0), (0.004, -0.003), 0.4, gaits=6)

    assert drift.of_trials_m_s == pytest.approx(np.tile([0.004, -0.003], (6, 1)), abs=0.002)


def test_a_learner_that_has_learned_before_finds_the_same_bits():
    random = np.random.default_rng(4)
    trials = [cut(drive((0.01, 0.0), (0.004, 0.0), 0.0, 0.3, random)) for _ in range(5)]
    learner, weights = DriftLearner(), [weigh(GAIT_HZ)] * 5
    for count in range(1, 6):
        last = learner.learn(range(count), trials[:count], weights[:count])

    anew = learn_drift(range(5), trials, weights)

    assert last is not None and anew is not None
    assert last.of_trials_m_s.tolist() == anew.of_trials_m_s.tolist()


def test_the_time_in_which_motors_speed_up_is_left_out():
    random = np.random.default_rng(5)

    long, short = (cut(drive((0.01, 0.0), (0.0, 0.0), 0.0, 0.1, random, duration_s=s)) for s in (5.0, 2.0))

    assert math.fsum(piece.duration_s for piece in long) == pytest.approx(3.75)
    assert math.fsum(piece.duration_s for piece in short) == pytest.approx(1.5)


def test_drives_that_were_far_more_uneven_than_others_count_less():
    off_deg = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        own = random.normal(0.0, 0.01, (9, 2))
        noises_m = [0.0005] * 5 + [0.03] * 4
        trials = [
            cut(drive(v, (0.004, -0.003), random.uniform(-3, 3), 0.4, random, noise_m=noise_m))
            for v, noise_m in zip(own, noises_m, strict=True)
        ]
        drift = learn_drift(range(9), trials, [weigh(GAIT_HZ)] * 9)
        assert drift is not None
        off_deg.append(math.degrees(abs(math.remainder(drift.azimuth_rad - math.atan2(-3, 4), math.tau))))

    assert np.quantile(off_deg, 0.8) < 12.0  # 21 where all count alike
