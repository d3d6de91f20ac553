"""Plans: they reach the goal by what the movements do, in little time, and never across the arena's border."""

import math

import numpy as np
import pytest
from gliding import TABLE

from vvvaltr.transfer.steering.arcs import travel
from vvvaltr.transfer.steering.planner import DURATIONS_S, Abilities, Border, Goal, plan

VELOCITIES = np.array(list(TABLE.values()))
SURE = np.full(VELOCITIES.shape, 1e-4)
START = np.zeros(3)


def able(drift_m_s: tuple[float, float] = (0.0, 0.0), deviations: np.ndarray = SURE) -> Abilities:
    return Abilities(
        VELOCITIES, deviations, np.tile([0.0, 0.0, *drift_m_s], (len(VELOCITIES), 1)), delay_s=0.2, pause_s=0.3
    )


def followed(steps: tuple[tuple[int, float], ...], drift_m_s: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Return x, y, yaw along a plan, 100 a second, by small straight steps."""
    x, y, yaw, path = 0.0, 0.0, 0.0, []
    for movement, duration_s in steps:
        forward, left, turn = VELOCITIES[movement]
        for _ in range(round(100 * (duration_s - 0.2))):
            x += 0.01 * (forward * math.cos(yaw) - left * math.sin(yaw) + drift_m_s[0])
            y += 0.01 * (forward * math.sin(yaw) + left * math.cos(yaw) + drift_m_s[1])
            yaw += 0.01 * turn
            path.append((x, y, yaw))
    return np.array(path)


@pytest.mark.parametrize("bearing_deg", range(0, 360, 45))
def test_a_plan_followed_leads_to_the_goal(bearing_deg: int) -> None:
    goal = Goal(0.15 * math.cos(math.radians(bearing_deg)), 0.15 * math.sin(math.radians(bearing_deg)))

    way = plan(START, goal, able())

    end = followed(way.steps)[-1]
    assert goal.distance_m(end[0], end[1]) <= goal.within_m
    assert way.poses[-1] == pytest.approx(end, abs=0.01)
    assert way.expected_s < 30.0


def test_the_floors_drift_is_put_on() -> None:
    goal, drift_m_s = Goal(0.15, 0.05), (-0.006, 0.002)

    end = followed(plan(START, goal, able(drift_m_s)).steps, drift_m_s)[-1]

    assert goal.distance_m(end[0], end[1]) <= goal.within_m


def test_a_goal_may_have_a_heading() -> None:
    goal = Goal(0.08, 0.0, yaw_rad=1.5)

    end = followed(plan(START, goal, able()).steps)[-1]

    assert goal.is_reached(end)


def test_of_two_movements_with_the_same_mean_the_surer_one_is_driven() -> None:
    velocities = np.array([[0.02, 0.0, 0.0], [0.02, 0.0, 0.0]])
    deviations = np.array([[0.01, 0.01, 0.1], [0.0005, 0.0005, 0.01]])

    way = plan(START, Goal(0.06, 0.0), Abilities(velocities, deviations, np.zeros((2, 4)), 0.2, 0.3))

    assert way.steps[0][0] == 1


def test_the_border_is_never_planned_across() -> None:
    border = Border((-0.3, 0.3), (-0.02, 0.3))
    random = np.random.default_rng(1)
    for _ in range(20):
        goal = Goal(random.uniform(-0.25, 0.25), random.uniform(0.0, 0.25))

        way = plan(START, goal, able(), border)

        path = followed(way.steps)
        assert path[:, 0].min() > -0.301
        assert path[:, 0].max() < 0.301
        assert path[:, 1].min() > -0.021
        assert path[:, 1].max() < 0.301


def test_where_every_movement_would_cross_the_border_there_is_no_plan() -> None:
    assert plan(START, Goal(0.2, 0.0), able(), Border((-1e-4, 1e-4), (-1e-4, 1e-4))).steps == ()


def test_a_movement_underway_goes_on_where_it_leads_to_the_goal_and_not_where_it_leads_away() -> None:
    ahead, behind, on = Goal(0.1, 0.0), Goal(-0.1, 0.0), np.append(VELOCITIES[0], np.zeros(4))

    assert plan(START, ahead, able(), underway=on).steps[0][0] == -1
    assert plan(START, behind, able(), underway=on).steps[0][0] != -1


def test_a_repertoire_that_moves_at_once_is_planned_for_no_shorter_drives_than_any_other() -> None:
    at_once = Abilities(VELOCITIES, SURE, np.zeros((len(VELOCITIES), 4)), delay_s=0.0, pause_s=0.3)

    steps = [step for x_m in (0.03, 0.05, 0.08) for step in plan(START, Goal(x_m, 0.01), at_once).steps]

    assert {duration_s for _, duration_s in steps} <= set(DURATIONS_S)


def test_travel_is_the_integral_of_a_velocity_that_turns_with_the_robot() -> None:
    moved_m, turn_rad = travel(np.array([0.02, 0.01, 0.5]), np.array(4.0))

    steps = np.arange(4000) * 0.001 + 0.0005
    cos, sin = np.cos(0.5 * steps), np.sin(0.5 * steps)
    assert turn_rad == pytest.approx(2.0)
    assert moved_m == pytest.approx([0.001 * (0.02 * cos - 0.01 * sin).sum(), 0.001 * (0.02 * sin + 0.01 * cos).sum()])


def test_a_turn_that_depends_on_the_heading_is_foreseen() -> None:
    velocities, floor = (
        np.array([[0.02, 0.0, 0.0]]),
        np.array([[0.0, 0.3, 0.0, 0.0]]),
    )  # 0.3 rad/s at a heading of 90 deg
    x, y, yaw = start = np.array([0.0, 0.0, 0.3])

    way = plan(start, Goal(0.08, 0.06), Abilities(velocities, np.zeros((1, 3)), floor, 0.0, 0.3))

    for _ in range(round(1000 * way.steps[0][1])):
        x, y = x + 0.001 * 0.02 * math.cos(yaw), y + 0.001 * 0.02 * math.sin(yaw)
        yaw += 0.001 * 0.3 * math.sin(yaw)
    assert yaw > 0.5
    assert way.poses[0] == pytest.approx([x, y, yaw], abs=0.05)
