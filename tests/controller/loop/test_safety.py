import math

import pytest

from vvvaltr.controller.core.errors import SafetyStop
from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState, Outcome, Pose
from vvvaltr.controller.loop.safety import Arena, GuardedMotors, HeadingGuard, Limits, make_arena_guard


class Motors:
    """Motors that apply at once what they are told, and remember it."""

    motor_count = 3
    quantities = frozenset({Quantity.FREQUENCY})

    def __init__(self) -> None:
        self.driven: list[tuple[Gait, float]] = []
        self.applied_hz: tuple[float, ...] = (0.0, 0.0, 0.0)

    def drive(self, gait: Gait, hold_s: float) -> None:
        self.driven.append((gait, hold_s))
        self.applied_hz = gait.frequency_hz

    def state(self) -> MotorState:
        return MotorState(0.0, self.applied_hz)

    def stop(self) -> None:
        self.applied_hz = (0.0, 0.0, 0.0)

    def close(self) -> None:
        self.stop()


LIMITS = Limits((16.7, 16.7, 16.7))


def test_a_command_within_the_limits_reaches_the_motors_unchanged() -> None:
    motors = Motors()

    GuardedMotors(motors, LIMITS).drive(Gait((16.7, -16.7, 0)), 0.25)

    assert motors.driven == [(Gait((16.7, -16.7, 0)), 0.25)]


@pytest.mark.parametrize(
    ("gait", "hold_s", "complaint"),
    [
        (Gait((16.8, 0, 0)), 0.25, "motor 1: 16.8 Hz"),
        (Gait((0, 0, -20)), 0.25, "motor 3: -20 Hz"),
        (Gait((1, 1)), 0.25, "2 frequencies given, but the robot has 3 motors"),
        (Gait((1, 1, 1)), 0.0, "hold_s 0"),
        (Gait((1, 1, 1)), 5.0, "hold_s 5"),
        (Gait((1, 1, 1)), math.nan, "hold_s nan"),
    ],
)
def test_a_command_outside_the_limits_is_refused_and_nothing_is_sent(gait: Gait, hold_s: float, complaint: str) -> None:
    motors = Motors()

    with pytest.raises(ValueError, match=complaint):
        GuardedMotors(motors, LIMITS).drive(gait, hold_s)

    assert motors.driven == []


@pytest.mark.parametrize("applied", [25.0, -25.0, math.nan, math.inf])
def test_a_motor_that_runs_away_ends_the_trial(applied: float) -> None:
    motors = Motors()
    motors.applied_hz = (0.0, applied, 0.0)

    with pytest.raises(SafetyStop, match="motor 2") as stop:
        GuardedMotors(motors, LIMITS).state()

    assert stop.value.outcome is Outcome.FAULTED


def test_leaving_the_arena_cuts_the_trial_short() -> None:
    check = make_arena_guard(Arena((-0.5, 0.5), (-0.2, 0.2)))

    check(Pose(0.0, (0.5, -0.2, 9.0)))
    with pytest.raises(SafetyStop, match=r"y = 0\.210 m") as stop:
        check(Pose(1.0, (0.0, 0.21, 0.0)))

    assert stop.value.outcome is Outcome.CUT_SHORT


def test_leaving_the_arena_at_once_measures_nothing() -> None:
    check = make_arena_guard(Arena((-0.5, 0.5), (-0.2, 0.2)))

    with pytest.raises(SafetyStop, match="put the robot in the middle") as stop:
        check(Pose(0.05, (0.51, 0.0, 0.0)))

    assert stop.value.outcome is Outcome.FAULTED


def turned(guard: HeadingGuard, *yaws_rad: float, period_s: float = 0.1) -> int:
    """Return how many looks the guard allows before it ends the trial."""
    for look, yaw_rad in enumerate(yaws_rad):
        try:
            guard(Pose(look * period_s, (0.0, 0.0, 0.0), yaw_rad))
        except SafetyStop:
            return look
    return len(yaws_rad)


def test_three_checks_in_a_row_beyond_one_radian_end_the_trial() -> None:
    assert turned(HeadingGuard(), 0.0, 1.1, 1.1, 1.1, 1.1) == 3


def test_a_turn_back_starts_the_count_again() -> None:
    assert turned(HeadingGuard(), 0.0, 1.1, 1.1, 0.9, 1.1, 1.1, 0.9) == 7


def test_the_heading_is_checked_ten_times_a_second_however_often_it_is_seen() -> None:
    assert turned(HeadingGuard(), 0.0, *([1.1] * 9), period_s=0.05) == 6


def test_the_heading_is_compared_the_short_way_round() -> None:
    assert turned(HeadingGuard(), 3.0, *([-3.0] * 9)) == 10


def test_the_heading_counts_from_where_it_began() -> None:
    assert turned(HeadingGuard(), 2.0, *([2.9] * 9)) == 10


@pytest.mark.parametrize(
    ("gait", "refusal"),
    [
        (Gait((1.0, 2.0)), "2 frequencies given, but the robot has 3 motors"),
        (Gait((1.0, 1.0, 1.0), phase_rad=(0.0, 1.0, 0.0)), "cannot set phases"),
        (Gait((1.0, 1.0, 1.0), amplitude=(1.0, 0.5, 1.0)), "cannot set amplitudes"),
    ],
)
def test_the_guard_alone_refuses_other_motors_and_quantities_that_they_cannot_set(gait: Gait, refusal: str) -> None:
    motors = Motors()

    with pytest.raises(ValueError, match=refusal):
        GuardedMotors(motors, Limits((16.0,) * 3)).drive(gait, 0.25)

    assert not motors.driven
