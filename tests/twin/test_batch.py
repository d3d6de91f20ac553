from functools import partial

import pytest

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.twin.batch import run_all
from vvvaltr.twin.presets import planar_robot, spatial_robot

SETTINGS = TrialSettings(duration_s=0.5, settle_s=0.1)
GAITS = [Gait((10.0 + number, 14.0, -12.0)) for number in range(5)]


def trial_of(gait, number, robot):
    trial = run_trial(robot, gait, SETTINGS, number)
    return trial.outcome, trial.poses, trial.states


TASKS = [partial(trial_of, gait, number) for number, gait in enumerate(GAITS, start=1)]


def refuse(robot):
    raise ValueError("no such gait")


@pytest.mark.parametrize("make_robot", [spatial_robot, planar_robot])
def test_many_at_once_give_the_numbers_of_one_by_one_bit_for_bit_and_in_order(make_robot):
    make = partial(make_robot, seed=3)

    one_by_one = [task(make()) for task in TASKS]

    assert list(run_all(make, TASKS)) == one_by_one
    assert list(run_all(make, TASKS, jobs=2)) == one_by_one


@pytest.mark.parametrize("make_robot", [spatial_robot, planar_robot])
def test_an_error_of_a_task_reaches_the_caller(make_robot):
    with pytest.raises(ValueError, match="no such gait"):
        list(run_all(make_robot, [refuse, refuse], jobs=2))


@pytest.mark.parametrize("make_robot", [spatial_robot, planar_robot])
def test_nothing_to_do_is_done(make_robot):
    assert list(run_all(make_robot, [], jobs=2)) == []
