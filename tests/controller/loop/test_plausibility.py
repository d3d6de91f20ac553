"""What a pose must be to count: near where the robot just was, upright in its units, and new."""

import math

import pytest

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.loop.plausibility import Plausibility, PoseFilter, average_at_rest, plausible_speed_m_s

RATE_HZ = 25.0


def walk(number: int, x_m: float = 0.0, **more: float) -> Pose:
    """Return a pose of a robot that walks at 20 mm/s and shakes by 3 mm."""
    t_s = number / RATE_HZ
    return Pose(t_s, (x_m + 0.02 * t_s + 0.003 * math.sin(40.0 * t_s), 0.001 * math.cos(37.0 * t_s), 0.06), **more)


def new_filter() -> PoseFilter:
    poses = PoseFilter(Plausibility())
    poses.begin_at(average_at_rest([walk(0)]), 0.0)
    return poses


def accepted(poses: PoseFilter, sequence: list[Pose], motors_turn: bool = True) -> int:
    return sum(poses.accepts(pose, motors_turn) for pose in sequence)


def test_a_walking_robot_passes() -> None:
    poses = new_filter()
    assert accepted(poses, [walk(n) for n in range(1, 500)]) == 499
    assert poses.dropped == 0


@pytest.mark.parametrize("x_m", [100.0, -0.5, 1e308, math.inf, math.nan])
def test_a_single_outlier_is_dropped_and_counted(x_m: float) -> None:
    poses = new_filter()
    sequence = [walk(n, x_m if n == 50 else 0.0) for n in range(1, 100)]
    assert accepted(poses, sequence) == 98
    assert poses.dropped == 1


def test_outliers_now_and_then_are_dropped_and_counted() -> None:
    poses = new_filter()
    assert accepted(poses, [walk(n, 2.0 if n % 7 == 0 else 0.0) for n in range(1, 141)]) == 120
    assert poses.dropped == 20


def test_a_robot_that_is_suddenly_elsewhere_is_lost() -> None:
    poses = new_filter()
    accepted(poses, [walk(n) for n in range(1, 50)])
    with pytest.raises(TrackingLost, match=r"jumped by 0\.5"):
        accepted(poses, [walk(n, 0.5) for n in range(50, 70)])


def test_two_bodies_in_turn_are_lost() -> None:
    poses = new_filter()
    with pytest.raises(TrackingLost, match="implausible"):
        accepted(poses, [walk(n, 0.4 * (n % 2)) for n in range(1, 100)])


def test_a_pose_that_is_repeated_with_new_time_stamps_while_motors_turn_is_lost() -> None:
    poses, last = new_filter(), walk(10)
    accepted(poses, [walk(n) for n in range(1, 11)])
    held = [Pose(n / RATE_HZ, last.position_m) for n in range(11, 60)]
    with pytest.raises(TrackingLost, match="to the last digit"):
        accepted(poses, held)


def test_a_pose_that_is_repeated_while_motors_rest_is_a_robot_at_rest() -> None:
    poses = new_filter()
    held = [Pose(n / RATE_HZ, walk(0).position_m) for n in range(1, 60)]
    assert accepted(poses, held, motors_turn=False) == 59


def test_a_robot_that_stands_still_before_a_tracker_with_noise_passes() -> None:
    poses = new_filter()
    still = [Pose(n / RATE_HZ, (1e-5 * math.sin(n), 0.0, 0.06)) for n in range(1, 100)]
    assert accepted(poses, still) == 99


def test_the_same_pose_read_twice_is_no_repetition_of_the_tracker() -> None:
    poses = new_filter()
    assert accepted(poses, [walk(n // 10) for n in range(10, 300)]) == 290


def test_millimetres_and_degrees_are_named_with_their_cure() -> None:
    millimetres = [Pose(n / RATE_HZ, (120.0 + n, 40.0, 60.0)) for n in range(20)]
    with pytest.raises(TrackingLost, match='unit = "mm"'):
        accepted(PoseFilter(Plausibility()), millimetres)
    with pytest.raises(TrackingLost, match='yaw_unit = "deg"'):
        accepted(new_filter(), [walk(n, yaw_rad=90.0) for n in range(1, 20)])


def test_a_robot_that_is_lifted_is_lost() -> None:
    poses = new_filter()
    lifted = [Pose(n / RATE_HZ, (0.0, 0.0, 0.06 + 0.02 * n)) for n in range(1, 40)]
    with pytest.raises(TrackingLost, match="height"):
        accepted(poses, lifted)


def test_the_place_at_rest_does_not_move_with_an_outlier_and_says_how_sure_it_is() -> None:
    noise_m = [0.0003 * math.sin(17.0 * n) for n in range(9)]
    poses = [Pose(0.1 * n, (0.1 + noise, 0.0, 0.06), yaw_rad=3.1 + noise) for n, noise in enumerate(noise_m)]
    poses[4] = Pose(0.4, (7.0, 3.0, 0.06), yaw_rad=-3.1)

    rest = average_at_rest(poses)

    assert rest.position_m == pytest.approx((0.1, 0.0, 0.06), abs=2e-4)
    assert rest.yaw_rad == pytest.approx(3.1, abs=2e-3)
    assert rest.position_sd_m is not None and 0.00005 < rest.position_sd_m < 0.0003


def test_the_place_at_rest_of_headings_across_the_turn_is_between_them() -> None:
    rest = average_at_rest([Pose(0.0, (0.0, 0.0, 0.0), yaw_rad=yaw) for yaw in (3.13, -3.13, 3.14)])
    assert math.remainder(rest.yaw_rad - 3.14, math.tau) == pytest.approx(0.0, abs=0.02)


def test_one_pose_at_rest_leaves_its_error_unknown() -> None:
    assert average_at_rest([walk(0)]).position_sd_m is None


def test_the_plausible_speed_is_ten_times_that_of_known_gaits() -> None:
    assert plausible_speed_m_s(16.7) == pytest.approx(0.25, abs=0.01)
