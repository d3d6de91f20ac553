"""Between trials: the robot is put back, the operator decides, and nothing waits for what cannot come."""

import math
from collections.abc import Sequence
from typing import Any

import pytest
from attending import ScriptedHand, ScriptedOperator, wish
from scripted import ScriptedRobot, raising

from vvvaltr.controller.core.attending import Stage, StartPlace, Wish
from vvvaltr.controller.core.errors import TrackingLost, UserError
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.records import LoggedTrial, Verdict
from vvvaltr.controller.core.values import MotorState, Outcome, Phase
from vvvaltr.controller.loop.attendance import Attendance
from vvvaltr.controller.loop.learn import learn
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.putting_back import Placement, Reposition, describe_move
from vvvaltr.controller.loop.safety import Arena
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.transfer.methods.plain_bo import PlainBO

SPACE = GaitSpace.over(3, 4.0, 16.7)
ARENA = Arena((-0.15, 0.15), (-0.15, 0.15))
START = StartPlace(0.05, 0.0, within_m=0.02)
EACH = Placement(Reposition.EACH, START, ARENA)
BORDER = Placement(Reposition.ARENA, None, ARENA)


class LeftRobot(ScriptedRobot):
    """Is left where it stopped, as a real robot is."""

    def place(self, trial: int) -> None:
        self.carry_on(trial)


def run(
    attendance: Attendance, trials: int = 3, log: list[LoggedTrial] | None = None, duration_s: float = 1.0, **more: Any
) -> list[LoggedTrial]:
    log = [] if log is None else log
    settings = TrialSettings(duration_s=duration_s, arena=ARENA)
    optimizer, robot = PlainBO(SPACE, seed=1), attendance.robot
    for _ in learn(robot, optimizer, settings, Budget(trials, **more), log.append, tuple(log), (), attendance):
        pass
    return log


def attended(robot: ScriptedRobot, *script: Any, placement: Placement | None = None, **more: Any) -> Attendance:
    operator = ScriptedOperator(robot, list(script))
    return Attendance(robot, placement or Placement(), operator, review_s=more.pop("review_s", 0.01), **more)


def outcomes(log: Sequence[LoggedTrial]) -> list[str]:
    return [logged.trial.outcome.value for logged in log]


def test_before_each_trial_the_hand_puts_the_robot_into_its_start_circle() -> None:
    robot = LeftRobot()
    hand = ScriptedHand(robot)

    log = run(Attendance(robot, EACH, hand=hand))

    assert hand.asked == [START] * 3
    assert [logged.trial.start.position_m[0] for logged in log if logged.trial.start] == [START.x_m] * 3


def test_at_its_arenas_border_the_robot_is_put_back_to_the_middle_and_not_before() -> None:
    robot = LeftRobot(x_m=0.1, speed_m_s_per_hz=0.003)
    hand = ScriptedHand(robot)

    log = run(Attendance(robot, BORDER, hand=hand), trials=4)

    assert 0 < len(hand.asked) < 4
    assert {(place.x_m, place.y_m) for place in hand.asked} == {(0.0, 0.0)}
    assert {logged.trial.outcome.is_valid for logged in log} == {True}


def test_nobody_there_ends_the_run_with_the_reason_and_what_was_measured() -> None:
    log: list[LoggedTrial] = []
    robot = LeftRobot(x_m=0.05)

    with pytest.raises(UserError, match=r"trial \d cannot begin: move .* nobody is there .* --reposition never$"):
        run(Attendance(robot, BORDER), 9, log)

    assert log
    assert set(outcomes(log)) <= {"completed", "cut_short"}


def test_a_hand_that_does_nothing_ends_the_run_in_the_end() -> None:
    robot = LeftRobot()
    hand = ScriptedHand(robot, is_lame=True)

    with pytest.raises(UserError, match="the mock's hand did not put it there"):
        run(Attendance(robot, EACH, hand=hand))

    assert len(hand.asked) == 3


def test_a_blind_tracker_ends_the_wait_of_a_run_that_nobody_attends() -> None:
    robot = LeftRobot(where="pose", at_s=-1e9, event=raising(TrackingLost("hidden")))

    with pytest.raises(UserError, match="the tracker does not see the robot; check what it sees"):
        run(Attendance(robot, EACH))


def test_the_run_goes_on_by_itself_when_the_operator_has_put_the_robot_back() -> None:
    robot = LeftRobot(speed_m_s_per_hz=0.004)

    def put_back() -> None:
        robot.x_m = START.x_m

    attendance = attended(robot, *[(Stage.WAITING, "move", put_back)] * 3, placement=EACH)
    log = run(attendance)

    assert outcomes(log) == ["completed"] * 3
    shown = [line for stage, line in attendance._operator.shown if stage is Stage.WAITING]  # type: ignore[union-attr]
    assert shown[0] == "trial 1: move 0.05 m (x +0.05 y +0.00)"
    assert "trial 1: in its place; hands off, it must lie still" in shown


def test_a_key_begins_the_trial_wherever_the_robot_lies() -> None:
    robot = LeftRobot(x_m=-0.1)

    log = run(attended(robot, wish(Stage.WAITING, "move", Wish.GO), placement=EACH), trials=1)

    assert log[0].trial.start is not None
    assert log[0].trial.start.position_m[0] == -0.1


def test_reposition_each_needs_a_start() -> None:
    with pytest.raises(ValueError, match=r"needs a start: write \[start\]"):
        Placement(Reposition.EACH)


@pytest.mark.parametrize(
    ("at", "words"),
    [
        ((0.30, -0.10, 0.0), "move 0.32 m (x -0.30 y +0.10), turn 90 deg left"),
        ((0.0, 0.0, math.pi), "turn 90 deg right"),
        ((0.0, 0.001, math.pi / 2), ""),
    ],
)
def test_one_line_says_how_far_and_which_way(at: tuple[float, float, float], words: str) -> None:
    place = StartPlace(yaw_rad=math.pi / 2)

    assert describe_move(place, *at) == words
    assert place.holds(*at) == (not words)
    assert len(f"trial 100: {words}") <= 60


def test_a_discarded_trial_is_recorded_with_its_reason_and_never_told() -> None:
    robot = ScriptedRobot()
    discard = wish(Stage.REVIEW, "trial 2:", Wish.DISCARD, "a cable caught")
    log = run(attended(robot, discard), trials=4)
    undisturbed = run(Attendance(ScriptedRobot(), Placement()), trials=4)

    (discarded,) = [logged for logged in log if logged.score is None]
    assert (discarded.trial.number, discarded.trial.outcome) == (2, Outcome.COMPLETED)
    assert (discarded.review.verdict, discarded.review.verdict_reason) == (Verdict.DISCARD, "a cable caught")
    assert discarded.trial.poses
    kept = [logged for logged in log if logged is not discarded]
    assert [logged.suggestion for logged in kept] == [logged.suggestion for logged in undisturbed]


def test_a_repeated_trial_counts_and_its_gait_is_driven_again() -> None:
    log = run(attended(ScriptedRobot(), wish(Stage.REVIEW, "trial 2:", Wish.REPEAT)), trials=4)

    assert log[1].score is not None
    assert log[2].trial.gait == log[1].trial.gait
    assert log[2].suggestion.origin == "repeated for the operator"
    assert log[3].trial.gait != log[2].trial.gait


def test_a_repeat_of_the_reference_takes_no_trial_from_the_search() -> None:
    attendance = attended(ScriptedRobot(), wish(Stage.REVIEW, "trial 3:", Wish.REPEAT))

    log = run(attendance, trials=4, reference=Gait((9.0, 9.0, 9.0)), reference_every=2)

    search, reference = Phase.SEARCH, Phase.REFERENCE
    assert [each.suggestion.phase for each in log] == [search, search, reference, reference, search, search]


def test_a_repeat_in_the_confirmation_takes_the_next_turn_of_its_gait() -> None:
    attendance = attended(ScriptedRobot(), wish(Stage.REVIEW, "trial 5:", Wish.REPEAT))

    log = run(attendance, trials=8, confirm=(2, 2))

    first, second = log[4].trial.gait, log[6].trial.gait
    assert [each.suggestion.phase for each in log] == [Phase.SEARCH] * 4 + [Phase.CONFIRMATION] * 4
    assert [each.trial.gait for each in log[4:]] == [first, first, second, second]


def test_notes_and_a_new_battery_go_with_the_trial_that_they_are_about() -> None:
    robot = ScriptedRobot()
    script = [
        wish(Stage.REVIEW, "trial 1:", Wish.NOTE, "loud"),
        wish(Stage.REVIEW, "trial 1:", Wish.NEW_BATTERY),
        wish(Stage.REVIEW, "trial 2:", Wish.KEEP),
    ]

    log = run(attended(robot, *script), trials=3)

    assert [logged.review.notes for logged in log] == ["loud", "", ""]
    assert [logged.trial.conditions.battery_changed for logged in log] == [False, True, False]
    assert {logged.review.verdict for logged in log} == {Verdict.KEEP}


@pytest.mark.parametrize("trials_before", [0, 8])
def test_a_skipped_gait_is_on_record_and_another_one_is_driven_also_after_a_resume(trials_before: int) -> None:
    log = run(Attendance(ScriptedRobot(), Placement()), trials=trials_before) if trials_before else []
    number = trials_before + 1
    robot = ScriptedRobot()
    pause = wish(Stage.WAITING, "", Wish.SKIP)
    operator = ScriptedOperator(robot, [pause])
    attendance = Attendance(robot, Placement(), operator, review_s=0.0)
    attendance.pause("look")
    script_end = wish(Stage.WAITING, f"trial {number + 1}: look", Wish.GO)
    operator.script.append(script_end)

    whole = run(attendance, trials=trials_before + 4, log=list(log))
    torn = whole[: number + 1]
    resumed = run(Attendance(ScriptedRobot(), Placement()), trials=trials_before + 4, log=torn)

    skipped, instead = whole[number - 1], whole[number]
    assert (skipped.review.verdict, skipped.score, skipped.trial.duration_s) == (Verdict.SKIP, None, 0.0)
    assert instead.suggestion.origin == "in place of a skipped gait"
    assert instead.trial.gait != skipped.trial.gait
    assert [each.suggestion for each in resumed] == [each.suggestion for each in whole]


def test_a_stop_ends_the_trial_at_once_and_the_run_goes_on_when_the_operator_says_so() -> None:
    robot = ScriptedRobot()
    script = [wish(Stage.DRIVING, "trial 2 ", Wish.STOP), wish(Stage.WAITING, "trial 3: stopped", Wish.GO)]

    log = run(attended(robot, *script), trials=3)

    assert outcomes(log) == ["completed", "interrupted", "completed", "completed"]
    assert log[1].trial.reason == "stopped by the operator"
    assert log[1].trial.duration_s < 0.2
    assert log[2].trial.gait == log[1].trial.gait


def test_the_operator_ends_the_run_after_the_present_trial() -> None:
    log = run(attended(ScriptedRobot(), wish(Stage.DRIVING, "trial 2 ", Wish.END)), trials=9)

    assert outcomes(log) == ["completed"] * 2


def test_an_interrupt_during_the_review_leaves_the_trial_on_record() -> None:
    log: list[LoggedTrial] = []
    interrupt = (Stage.REVIEW, "trial 2:", raising(KeyboardInterrupt("SIGHUP")))

    with pytest.raises(KeyboardInterrupt, match="SIGHUP"):
        run(attended(ScriptedRobot(), interrupt), 9, log)

    assert outcomes(log) == ["completed"] * 2


def test_failures_in_a_row_pause_an_attended_run() -> None:
    robot = ScriptedRobot(at_s=0.0, event=raising(TrackingLost("hidden")))

    def mend() -> None:
        robot.event = lambda: None

    script = [(Stage.WAITING, "3 trials in a row failed", mend), wish(Stage.WAITING, "in a row", Wish.PAUSE)]
    log = run(attended(robot, *script), trials=2)

    assert outcomes(log) == ["tracking_lost"] * 3 + ["completed"] * 2


class WeakRobot(ScriptedRobot):
    """Its second motor turns at 70 % of its set-point, as sensors measure."""

    def state(self) -> MotorState:
        first, second, third = super().state().frequency_hz
        return MotorState(self.t_s, (first, 0.7 * second, third), measured=True)


def test_a_motor_that_falls_short_ends_a_run_that_nobody_attends() -> None:
    log: list[LoggedTrial] = []

    with pytest.raises(UserError, match=r"battery or stall: motor 2 turned at 70% .* in two trials"):
        run(Attendance(WeakRobot(), Placement()), 9, log, duration_s=3.0)

    assert len(log) == 2


def test_a_motor_that_falls_short_pauses_an_attended_run() -> None:
    script = [wish(Stage.WAITING, "battery or stall", Wish.GO)]

    log = run(attended(WeakRobot(), *script), trials=3, duration_s=3.0)

    assert len(log) == 3
    assert not script[1:]


def test_a_long_pause_lets_go_of_the_motors_lines_once() -> None:
    robot, parked = ScriptedRobot(), []
    attendance = attended(robot, park=lambda: parked.append(robot.t_s), park_after_s=0.01)
    attendance.pause("lunch")
    go_on = iter(range(200))
    operator = attendance._operator
    assert isinstance(operator, ScriptedOperator)
    listen = operator.listen

    def later(wait_s: float) -> Sequence[Any]:
        import time

        time.sleep(0.0005)
        if next(go_on) == 60:
            operator.script.append(wish(Stage.WAITING, "lunch", Wish.PAUSE))
        return listen(wait_s)

    operator.listen = later  # type: ignore[method-assign]

    log = run(attendance, trials=1)

    assert len(parked) == 1
    assert outcomes(log) == ["completed"]


def test_no_motor_starts_while_the_operator_types() -> None:
    robot = ScriptedRobot()
    attendance = attended(robot)
    operator = attendance._operator
    assert isinstance(operator, ScriptedOperator)
    operator.is_busy = True
    began: list[bool] = []

    def end_the_note() -> None:
        began.append(robot.is_running)
        operator.is_busy = False

    operator.script.append((Stage.WAITING, "waits for what you type", end_the_note))

    log = run(attendance, trials=1)

    assert began == [False]
    assert outcomes(log) == ["completed"]
