import pytest
from scipy import stats
from scripted import ScriptedRobot

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.controller.studies.repeats import mean_with_interval, repeat_trial


def test_a_trial_in_which_a_motor_stood_still_has_no_score() -> None:
    robot = ScriptedRobot(at_s=1.0, event=lambda: (10.0, 0.0, 10.0), where="state")
    recorded: list[LoggedTrial] = []

    (logged,) = repeat_trial(robot, Gait((10.0, 10.0, 10.0)), TrialSettings(), 1, "net", recorded.append)

    assert recorded == [logged]
    assert (logged.trial.outcome, logged.score) == (Outcome.FAULTED, None)
    assert logged.trial.reason.startswith("motor 2 did not turn at 10.0 Hz")


def test_the_interval_is_students() -> None:
    scores = [0.012, 0.020, 0.009, 0.015]

    found = mean_with_interval(scores)

    assert found is not None
    expected = stats.ttest_1samp(scores, 0.0).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))
    assert found.mean == pytest.approx(0.014)


@pytest.mark.parametrize("scores", [[], [0.01]])
def test_one_trial_has_no_interval(scores: list[float]) -> None:
    assert mean_with_interval(scores) is None
