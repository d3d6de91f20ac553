import math

import pytest

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Estimate, Outcome, Pose, Trial
from vvvaltr.controller.loop.scoring import as_speed, score


def trial(*places: tuple[float, float], outcome: Outcome = Outcome.COMPLETED, yaw_rad: float = 0.0) -> Trial:
    """Return a trial that was seen at these places, one a second."""
    poses = tuple(Pose(float(t_s), (x, y, 0.1 * t_s), yaw_rad) for t_s, (x, y) in enumerate(places))
    return Trial(1, Gait((12.0,)), outcome, "", 0.0, float(len(places) - 1), poses)


def test_net_speed_is_the_distance_from_start_to_end_over_the_ground_and_time() -> None:
    assert score(trial((0, 0), (9, 9), (0.3, 0.4))) == pytest.approx(0.25)


def test_path_speed_counts_the_way_and_not_the_noise() -> None:
    square = trial((0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1), (0, 0))
    trembling = trial(*([(0, 0), (0.004, 0)] * 50), (0, 0))

    assert score(square, "path") == pytest.approx(0.1)
    assert score(square, "net") == 0.0
    assert score(trembling, "path") == 0.0


def test_forward_speed_follows_the_heading_at_the_start() -> None:
    to_the_left = ((0.0, 0.0), (0.0, 0.2))

    assert score(trial(*to_the_left, yaw_rad=math.pi / 2), "forward") == pytest.approx(0.2)
    assert score(trial(*to_the_left, yaw_rad=-math.pi / 2), "forward") == pytest.approx(-0.2)
    assert score(trial(*to_the_left), "forward") == pytest.approx(0.0)


def test_a_trial_cut_short_is_scored_over_the_time_it_ran() -> None:
    assert score(trial((0, 0), (0.1, 0), outcome=Outcome.CUT_SHORT)) == pytest.approx(0.1)


@pytest.mark.parametrize("outcome", [outcome for outcome in Outcome if not outcome.is_valid])
def test_a_failed_measurement_is_never_a_number(outcome: Outcome) -> None:
    with pytest.raises(ValueError, match=outcome.value):
        score(trial((0, 0), (0.1, 0), outcome=outcome))


@pytest.mark.parametrize(("name", "low_m_s"), [("net", 0.0), ("path", 0.0), ("forward", -0.0038)])
def test_an_interval_ends_where_the_score_does(name: str, low_m_s: float) -> None:
    assert as_speed(Estimate(0.029, -0.0038, 0.0625), name) == Estimate(0.029, low_m_s, 0.0625)
