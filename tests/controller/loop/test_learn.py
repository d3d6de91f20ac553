from typing import Any

import pytest
from scripted import ScriptedRobot, raising

from vvvaltr.controller.core.errors import TrackingLost, UserError
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.records import LoggedTrial, Told
from vvvaltr.controller.core.values import Outcome, Suggestion
from vvvaltr.controller.loop.learn import learn, make_source
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.summary import summarise
from vvvaltr.controller.loop.trial_runner import TrialCrashed, TrialSettings
from vvvaltr.transfer.methods.efficient_bo import EfficientBO
from vvvaltr.transfer.methods.plain_bo import PlainBO

SPACE = GaitSpace.over(3, 4.0, 16.7)
SETTINGS = TrialSettings(duration_s=1.0)


def run(robot: ScriptedRobot, trials: int, log: list[LoggedTrial], **more: Any) -> None:
    """Learn with a fresh optimiser, going on from what the log holds."""
    for _ in learn(robot, PlainBO(SPACE, seed=1), SETTINGS, Budget(trials, **more), log.append, tuple(log)):
        pass


def test_the_loop_makes_its_trials_and_finds_the_fast_corner() -> None:
    log: list[LoggedTrial] = []

    run(ScriptedRobot(), 20, log)

    found = summarise(log)
    assert [logged.trial.number for logged in log] == list(range(1, 21))
    assert found["outcomes"] == {"completed": 20}
    assert found["recommended"]["gait_hz"][0] > 16.0
    assert found["recommended"]["mean_m_s"] == pytest.approx(found["best_observed"]["score_m_s"], rel=0.02)
    assert found["recommended"]["low_m_s"] < found["recommended"]["mean_m_s"] < found["recommended"]["high_m_s"]


def test_a_search_that_ends_for_want_of_improvement_has_a_trial_at_least() -> None:
    source_log: list[LoggedTrial] = []
    run(ScriptedRobot(), 5, source_log)
    efficient = EfficientBO(SPACE, 1, [make_source("earlier", source_log, "net")])

    log = list(learn(ScriptedRobot(), efficient, SETTINGS, Budget(9, stop_below=1e9), lambda _: None))

    assert len(log) == 1


def test_a_resumed_run_goes_on_as_the_uninterrupted_one() -> None:
    whole: list[LoggedTrial] = []
    run(ScriptedRobot(), 14, whole)
    torn = whole[:11]

    run(ScriptedRobot(), 14, torn)

    assert [logged.suggestion for logged in torn] == [logged.suggestion for logged in whole]


@pytest.mark.parametrize("kept", [9, 10, 11, 13])
def test_a_run_resumed_around_its_confirmation_confirms_the_same_gaits(kept: int) -> None:
    whole: list[LoggedTrial] = []
    run(ScriptedRobot(), 14, whole, confirm=(2, 2))
    torn = whole[:kept]

    run(ScriptedRobot(), 14, torn, confirm=(2, 2))

    assert [logged.suggestion for logged in torn] == [logged.suggestion for logged in whole]
    assert torn[-1].recommendation == whole[-1].recommendation


def test_a_failed_trial_is_recorded_tried_again_and_never_told() -> None:
    robot = ScriptedRobot(at_s=0.5)
    robot.event = lambda: raising(TrackingLost("hidden"))() if len(robot.placed) in (3, 10) else None
    log: list[LoggedTrial] = []
    undisturbed: list[LoggedTrial] = []

    run(robot, 10, log)
    run(ScriptedRobot(), 10, undisturbed)

    failed = [logged for logged in log if logged.trial.number in (3, 10)]
    valid = [logged for logged in log if logged not in failed]
    assert [(logged.trial.outcome, logged.score, logged.recommendation) for logged in failed] == [
        (Outcome.TRACKING_LOST, None, None)
    ] * 2
    assert [logged.suggestion for logged in valid] == [logged.suggestion for logged in undisturbed]
    assert log[3].trial.gait == log[2].trial.gait


def test_a_robot_that_keeps_failing_ends_the_run_with_the_reason() -> None:
    log: list[LoggedTrial] = []

    with pytest.raises(UserError, match=r"3 trials in a row failed.*tracking lost: hidden"):
        run(ScriptedRobot(at_s=0.0, event=raising(TrackingLost("hidden"))), 10, log)

    assert len(log) == 3
    assert summarise(log)["recommended"] is None


def test_after_the_mending_the_failures_of_before_do_not_count() -> None:
    log: list[LoggedTrial] = []
    broken = ScriptedRobot(at_s=0.0, event=raising(TrackingLost("hidden")))
    with pytest.raises(UserError):
        run(broken, 10, log)

    run(ScriptedRobot(), 4, log)

    assert summarise(log)["outcomes"] == {"tracking_lost": 3, "completed": 4}


def test_an_interrupt_ends_the_run_with_the_trial_on_record() -> None:
    log: list[LoggedTrial] = []

    with pytest.raises(KeyboardInterrupt, match="SIGTERM"):
        run(ScriptedRobot(at_s=0.5, event=raising(KeyboardInterrupt("SIGTERM"))), 10, log)

    assert [logged.trial.outcome for logged in log] == [Outcome.INTERRUPTED]


def test_a_defect_ends_the_run_with_the_trial_on_record() -> None:
    log: list[LoggedTrial] = []

    with pytest.raises(TrialCrashed):
        run(ScriptedRobot(at_s=0.5, event=raising(ZeroDivisionError())), 10, log)

    assert [logged.trial.outcome for logged in log] == [Outcome.CRASHED]


def test_a_source_is_the_valid_trials_scored_anew() -> None:
    robot = ScriptedRobot(at_s=0.5)
    robot.event = lambda: raising(TrackingLost("hidden"))() if len(robot.placed) == 2 else None
    log: list[LoggedTrial] = []
    run(robot, 3, log)

    net, forward = make_source("flat", log, "net"), make_source("flat", log, "forward")

    assert len(net.gaits) == 3
    assert net.scores == forward.scores == tuple(logged.score for logged in log if logged.score is not None)


def test_a_source_of_failures_alone_is_refused() -> None:
    with pytest.raises(ValueError, match="no valid trial"):
        make_source("flat", [], "net")


class Constant:
    """An optimiser of one's own that only asks and tells."""

    def ask(self) -> Suggestion:
        return Suggestion(Gait((10.0, 10.0, 10.0)), "constant")

    def tell(self, gait: Gait, score: float) -> None:
        """Learn nothing."""


def test_ask_and_tell_suffice_and_the_first_recommendation_comes_with_the_first_repeat() -> None:
    log = list(learn(ScriptedRobot(), Constant(), SETTINGS, Budget(3), lambda _: None))

    assert log[0].recommendation is None
    assert summarise(log[:1])["recommended"] is None
    assert log[2].recommendation is not None
    assert log[2].recommendation.estimate.mean == pytest.approx(log[0].score)


class InterruptedBO(PlainBO):
    """Is interrupted while it learns from its sixth trial."""

    told = 0

    def tell_trial(self, told: Told) -> None:
        self.told += 1
        if self.told == 6:
            raise KeyboardInterrupt("SIGINT")
        super().tell_trial(told)


def test_an_interrupt_while_the_optimiser_learns_loses_no_trial_and_the_resumed_run_learns_from_it() -> None:
    whole: list[LoggedTrial] = []
    run(ScriptedRobot(), 12, whole)
    log: list[LoggedTrial] = []

    with pytest.raises(KeyboardInterrupt):
        seen = [*learn(ScriptedRobot(), InterruptedBO(SPACE, seed=1), SETTINGS, Budget(12), log.append)]
        pytest.fail(f"went on for {len(seen)} trials")

    assert [logged.score for logged in log] == [logged.score for logged in whole[:6]]
    assert summarise(log)["recommended"] == summarise(whole[:5])["recommended"]
    run(ScriptedRobot(), 12, log)
    assert [logged.suggestion for logged in log] == [logged.suggestion for logged in whole]
