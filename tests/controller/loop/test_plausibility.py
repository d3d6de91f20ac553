"""What a pose must be to count: near where the robot just was, upright in its units, and new."""

import math
from contextlib import nullcontext

import pytest

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.loop.at_rest import average_at_rest
from vvvaltr.controller.loop.plausibility import Plausibility, PoseFilter, plausible_speed_m_s

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
    with pytest.raises(TrackingLost, match=r"jumped by 0\.497"):
        accepted(poses, [walk(n, 0.5) for n in range(50, 70)])


@pytest.mark.parametrize("by_m", [0.08, 0.1, 0.3])
@pytest.mark.parametrize("motors_turn", [True, False])
def test_a_robot_that_is_seen_elsewhere_for_long_is_not_believed_to_have_walked_there(
    by_m: float, motors_turn: bool
) -> None:
    limits = Plausibility(max_speed_m_s=plausible_speed_m_s(16.5))  # by which it would be 0.1 m away after 0.2 s
    poses = PoseFilter(limits)
    poses.begin_at(average_at_rest([walk(0)]), 0.0)
    accepted(poses, [walk(n) for n in range(1, 50)])

    with pytest.raises(TrackingLost, match=r"jumped by 0\.\d+ m in 0\.04 s, where 0\.06 m"):
        accepted(poses, [walk(n, by_m) for n in range(50, 100)], motors_turn)


def test_a_robot_that_was_seen_elsewhere_for_a_moment_is_seen_again() -> None:
    poses = PoseFilter(Plausibility(max_speed_m_s=plausible_speed_m_s(16.5)))
    poses.begin_at(average_at_rest([walk(0)]), 0.0)

    assert accepted(poses, [walk(n, 0.1 if 50 <= n < 55 else 0.0) for n in range(1, 100)]) == 94
    assert poses.dropped == 5


def test_a_yaw_that_is_wrong_for_long_is_not_believed_to_have_turned() -> None:
    poses = new_filter()
    accepted(poses, [walk(n) for n in range(1, 50)])

    with pytest.raises(TrackingLost, match=r"yaw jumped by 1 rad in 0\.04 s"):
        accepted(poses, [walk(n, yaw_rad=1.0) for n in range(50, 100)])


def test_a_robot_whose_motors_are_off_is_not_seen_to_go_on() -> None:
    limits = Plausibility(max_speed_m_s=plausible_speed_m_s(16.5))
    for motors_turn in (True, False):  # unseen for 0.3 s, in which 0.12 m are plausible on the way
        poses = PoseFilter(limits)
        poses.begin_at(average_at_rest([walk(0)]), 0.0)
        assert poses.accepts(Pose(0.3, (0.1, 0.0, 0.06)), motors_turn) is motors_turn


def test_implausible_poses_end_the_trial_once_they_go_on_for_a_quarter_of_a_second() -> None:
    poses = new_filter()
    accepted(poses, [walk(n) for n in range(1, 50)])

    assert accepted(poses, [walk(n, 0.5) for n in range(50, 56)]) == 0  # 0.24 s after the last good one
    with pytest.raises(TrackingLost):
        poses.accepts(walk(56, 0.5), True)


@pytest.mark.parametrize(("bad", "of"), [(1, 3), (1, 2)])
def test_more_than_two_fifths_of_implausible_poses_end_the_trial(bad: int, of: int) -> None:
    poses = new_filter()
    sequence = [walk(n, 0.5 if n % of < bad else 0.0) for n in range(1, 100)]

    with nullcontext() if bad / of < 0.4 else pytest.raises(TrackingLost, match="of the last 8 poses"):
        assert accepted(poses, sequence) == 66


def test_two_bodies_in_turn_are_lost() -> None:
    poses = new_filter()
    with pytest.raises(TrackingLost, match="implausible"):
        accepted(poses, [walk(n, 0.4 * (n % 2)) for n in range(1, 100)])


@pytest.mark.parametrize("wobble_rad", [0.0, 0.01])  # as of a gyroscope that goes on
@pytest.mark.parametrize("wobble_m", [0.0, 1e-8])  # as of sums in single precision
def test_a_place_that_is_repeated_with_new_time_stamps_while_motors_turn_is_lost(
    wobble_rad: float, wobble_m: float
) -> None:
    poses, (x_m, y_m, z_m) = new_filter(), walk(10).position_m
    accepted(poses, [walk(n) for n in range(1, 11)])
    held = [
        Pose(n / RATE_HZ, (x_m + wobble_m * math.sin(n), y_m, z_m), wobble_rad * math.sin(n)) for n in range(11, 60)
    ]
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


@pytest.mark.parametrize("outlier", [0, 2, 4])
def test_an_outlier_at_rest_has_no_say_in_where_the_drive_begins_wherever_it_stands(outlier: int) -> None:
    poses = PoseFilter(Plausibility())
    rest = poses.rest([walk(0, 2.0 if n == outlier else 0.0) for n in range(5)])
    assert rest.position_m == walk(0).position_m
    assert poses.dropped == 1


def test_poses_at_rest_that_do_not_agree_are_lost() -> None:
    with pytest.raises(TrackingLost, match=r"apart; let the tracker see one body alone"):
        PoseFilter(Plausibility()).rest([walk(n, 0.4 * (n % 2)) for n in range(5)])


@pytest.mark.parametrize("others", [1, 2, 3])
@pytest.mark.parametrize("apart_m", [0.06, 0.1])
def test_a_place_between_two_at_which_the_robot_is_seen_at_rest_is_none(others: int, apart_m: float) -> None:
    poses = [walk(0, apart_m if n < others else 0.0) for n in range(4)]

    if others == 2:
        with pytest.raises(TrackingLost, match=f"up to {apart_m:g} m apart"):
            PoseFilter(Plausibility()).rest(poses)
    else:
        x_m, *_ = PoseFilter(Plausibility()).rest(poses).position_m
        assert x_m == pytest.approx(apart_m if others == 3 else 0.0)


@pytest.mark.parametrize(
    ("pose", "cure"),
    [
        (Pose(0.0, (120.0, 40.0, 60.0)), 'unit = "mm"'),
        (Pose(0.0, (12.0, 4.0, 6.0)), 'unit = "cm"'),
        (Pose(0.0, (0.1, 0.0, 0.06), yaw_rad=90.0), 'yaw_unit = "deg"'),
    ],
)
def test_at_rest_the_reason_names_the_unit_that_it_looks_like(pose: Pose, cure: str) -> None:
    with pytest.raises(TrackingLost, match=cure):
        PoseFilter(Plausibility()).rest([pose] * 5)


@pytest.mark.parametrize("size", [0.07, 0.13])
def test_a_yaw_at_rest_that_scatters_by_degrees_is_lost_with_the_cure(size: float) -> None:
    poses = [walk(0, yaw_rad=size * math.sin(17.0 * n)) for n in range(9)]
    with pytest.raises(TrackingLost, match='yaw_unit = "deg"'):
        PoseFilter(Plausibility()).rest(poses)


def test_a_yaw_that_scatters_after_the_drive_is_lost_though_it_agreed_by_luck_before() -> None:
    lucky = [walk(0, yaw_rad=yaw_rad) for yaw_rad in (0.0, 0.02, -0.02, 0.15, -0.2)]
    poses = PoseFilter(Plausibility())
    poses.begin_at(poses.rest(lucky), 0.0)

    with pytest.raises(TrackingLost, match='yaw_unit = "deg"'):
        poses.rest_after([walk(9, yaw_rad=yaw_rad) for yaw_rad in (0.0, -0.1, 0.1, 0.15, -0.15)], [])


def test_a_robot_that_still_turns_a_little_as_it_comes_to_rest_is_not_lost() -> None:
    poses = PoseFilter(Plausibility())
    poses.begin_at(poses.rest([walk(0, yaw_rad=0.002 * n) for n in range(5)]), 0.0)

    assert poses.rest_after([walk(9, yaw_rad=0.05 * n) for n in range(5)], []).yaw_rad == pytest.approx(0.1)


def test_a_yaw_that_jumps_is_dropped_except_of_a_robot_that_stands_on_end() -> None:
    assert accepted(new_filter(), [walk(1, yaw_rad=0.1), walk(2, yaw_rad=1.4), walk(3, yaw_rad=0.2)]) == 2
    assert accepted(new_filter(), [walk(1, pitch_rad=1.5), walk(2, yaw_rad=3.0, pitch_rad=1.5)]) == 2


def test_zeros_alone_are_no_place_of_a_robot_that_was_seen() -> None:
    zeros = [Pose(n / RATE_HZ, (0.0, 0.0, 0.0)) for n in range(20, 40)]
    poses = PoseFilter(Plausibility(max_lift_m=1.0))
    assert accepted(poses, [walk(n) for n in range(1, 20)]) == 19
    with pytest.raises(TrackingLost, match="as trackers report a body that they do not see"):
        accepted(poses, zeros)


def test_a_robot_that_is_first_seen_after_zeros_is_lost() -> None:
    poses = PoseFilter(Plausibility())
    poses.begin_at(poses.rest([Pose(n / RATE_HZ, (0.0, 0.0, 0.0)) for n in range(5)]), 0.0)
    with pytest.raises(TrackingLost, match="zero to the last digit"):
        accepted(poses, [walk(n) for n in range(1, 20)])


def test_a_pose_that_is_repeated_from_the_drive_to_the_end_is_not_where_the_robot_came_to_rest() -> None:
    poses, last = new_filter(), walk(10)
    driven = [walk(n) for n in range(1, 11)]
    accepted(poses, driven)
    held = [Pose(n / RATE_HZ, last.position_m) for n in range(11, 20)]
    accepted(poses, held[:2])
    accepted(poses, held[2:], motors_turn=False)
    with pytest.raises(TrackingLost, match="since the drive"):
        poses.rest_after(held[2:], driven)


def at_rest(x_m: float, from_s: float, noise_m: float = 2e-4) -> list[Pose]:
    """Return five poses of a robot at rest, with a tracker's noise."""
    return [
        Pose(from_s + 0.05 * n, (x_m + noise_m * math.sin(from_s + n), noise_m * math.cos(3.0 * n + from_s), 0.06))
        for n in range(5)
    ]


def held(pose: Pose, count: int, from_s: float) -> list[Pose]:
    return [Pose(from_s + 0.05 * n, pose.position_m, 0.01 * n) for n in range(count)]


@pytest.mark.parametrize(("count", "of"), [(2, 2), (3, 5), (5, 5)])
def test_a_place_that_was_repeated_before_the_drive_is_not_where_the_robot_lay(count: int, of: int) -> None:
    poses, stale = PoseFilter(Plausibility()), Pose(-1.0, (-0.004, 0.0, 0.06))
    poses.begin_at(poses.rest(held(stale, count, -0.5) + at_rest(0.0, -0.2)[count:of]), 0.0)

    with pytest.raises(TrackingLost, match=r"repeated one position .* before the drive.*show the robot to the tracker"):
        poses.rest_after(at_rest(0.02, 1.0), [walk(9)])


@pytest.mark.parametrize("in_drive", [True, False])
def test_a_place_that_is_repeated_since_the_motors_stopped_is_not_where_the_robot_came_to_rest(in_drive: bool) -> None:
    poses, last = PoseFilter(Plausibility()), walk(9)
    poses.begin_at(poses.rest(at_rest(0.0, -0.2)), 0.0)
    stale = last if in_drive else walk(10)  # read once before the motors stopped, or not at all

    with pytest.raises(TrackingLost, match=r"repeated one position .* after the drive.*show the robot to the tracker"):
        poses.rest_after(held(stale, 5, 1.0), [walk(8), last])


def test_a_tracker_that_rounds_may_repeat_a_place_at_rest() -> None:
    poses = PoseFilter(Plausibility())
    poses.begin_at(poses.rest(held(Pose(0.0, (0.001, 0.0, 0.06)), 5, -0.2)), 0.0)
    flickering = [Pose(1.0 + 0.05 * n, (0.021 + 0.001 * (n % 2), 0.001 * (n // 2 % 2), 0.06)) for n in range(5)]

    assert poses.rest_after(flickering, [walk(9)]).position_m[0] == pytest.approx(0.021)


def test_a_tracker_without_noise_may_repeat_a_place_at_rest() -> None:
    poses = PoseFilter(Plausibility(frozen_s=math.inf))
    poses.begin_at(poses.rest(held(Pose(0.0, (0.0, 0.0, 0.06)), 5, -0.2)), 0.0)

    assert poses.rest_after(at_rest(0.02, 1.0), [walk(9)]).position_m[0] == pytest.approx(0.02, abs=2e-4)


def test_of_the_poses_after_the_drive_those_that_the_tracker_repeated_do_not_count() -> None:
    poses, last, after = new_filter(), walk(10), walk(20, 0.03)
    driven = [walk(n) for n in range(1, 11)]
    accepted(poses, driven)
    held = [Pose(n / RATE_HZ, last.position_m) for n in range(11, 14)]
    assert poses.rest_after([*held, after], driven).position_m == after.position_m


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
