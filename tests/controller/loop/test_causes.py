from dataclasses import replace

import numpy as np

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import EventKind, Fit, LoggedTrial
from vvvaltr.controller.core.values import MotorState, Outcome, Phase, Pose, Suggestion, Trial
from vvvaltr.controller.loop.causes import StrengthWatch, fault_standing_motor, have_turned, review_speed, to_repeat
from vvvaltr.controller.loop.learn import learn
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.summary import summarise, tell_causes
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.twin.presets import planar_robot

GAIT, OTHER = Gait((12.0, -14.0, 0.0)), Gait((9.0, 9.0, 9.0))
LIVELY = Gait((12.0, 14.0, 16.0))
SHORT = TrialSettings(duration_s=0.6)


def trial(*frequency_hz, number=1, measured=True, gait=GAIT):
    states = tuple(MotorState(0.1 * k, frequency_hz, measured) for k in range(1, 31))
    return Trial(number, gait, Outcome.COMPLETED, "", 0.0, 3.0, states=states)


def logged(speed_m_s, number, history=(), gait=GAIT):
    review = review_speed(gait, speed_m_s, history)
    return LoggedTrial(Suggestion(gait, "test"), trial(number=number, gait=gait), speed_m_s, None, review=review)


def run_of(*speeds_m_s):
    history = []
    for number, speed_m_s in enumerate(speeds_m_s, start=1):
        history.append(logged(speed_m_s, number, tuple(history)))
    return history


def test_a_motor_that_its_device_measures_at_rest_faults_the_trial_and_is_named():
    stood = fault_standing_motor(trial(12.0, 0.1, 0.0))

    assert stood.outcome is Outcome.FAULTED
    assert stood.reason.startswith("motor 2 did not turn at -14.0 Hz")


def test_a_trial_whose_motors_turn_or_are_not_measured_is_left_alone():
    for fine in (trial(12.0, -13.9, 0.0), trial(12.0, 0.0, 0.0, measured=False), replace(trial(), states=())):
        assert fault_standing_motor(fine) is fine


def test_a_drive_too_short_for_motors_to_spin_up_is_not_judged():
    short = replace(trial(12.0, 0.1, 0.0), duration_s=0.8, states=trial(12.0, 0.1, 0.0).states[:8])

    assert fault_standing_motor(short) is short


def test_a_motor_that_a_fast_tracker_does_not_see_shaking_faults_the_trial_where_no_device_measures():
    times_s = np.arange(0.0, 5.0, 0.01)
    shaking = 0.0003 * (np.cos(2.0 * np.pi * 12.0 * times_s) + np.cos(2.0 * np.pi * 31.0 * times_s))
    noise = np.random.default_rng(0).normal(0.0, 0.0002, (len(times_s), 2))
    poses = tuple(
        Pose(t, (0.01 * t + x + a, x + b, 0.0))
        for t, x, (a, b) in zip(times_s.tolist(), shaking.tolist(), noise.tolist(), strict=True)
    )
    seen = Trial(1, Gait((12.0, -20.0, 31.0)), Outcome.COMPLETED, "", 0.0, 5.0, poses)

    faulted = fault_standing_motor(seen)

    assert faulted.outcome is Outcome.FAULTED
    assert faulted.reason.startswith("motor 2 at -20.0 Hz did not turn: the tracker sees no shaking there")
    measured = replace(seen, states=(MotorState(0.1, (12.0, -20.0, 31.0)),))
    assert fault_standing_motor(measured) is measured


def test_a_trial_far_below_the_gaits_others_is_suspect_in_words_and_is_repeated_once():
    history = run_of(0.100, 0.110, 0.008)

    assert history[-1].review.is_suspect
    assert "moved in 2 of 3 trials" in history[-1].review.suspicion
    assert to_repeat(history) == GAIT
    assert to_repeat([*history, logged(0.105, 4, history)]) is None
    assert to_repeat([*history, logged(0.009, 4, history)]) is None
    assert to_repeat(run_of(0.100, 0.110)) is None


def test_a_first_trial_is_never_suspect():
    assert not review_speed(GAIT, 0.0, [logged(0.1, 1, gait=OTHER)]).is_suspect


def test_a_suspect_trial_among_speeds_of_all_sizes_is_not_said_to_have_moved() -> None:
    review = review_speed(GAIT, 0.00005, [logged(0.0023, 1), logged(0.00023, 2)])

    assert review.suspicion == "far below what the gait did before, did a motor stand still?"


def test_a_loss_of_strength_is_told_once_in_words():
    random = np.random.default_rng(0)
    speeds = [0.1 * (0.5 if k >= 12 else 1.0) * float(np.exp(random.normal(0.0, 0.08))) for k in range(22)]
    history = run_of(*speeds)
    watch = StrengthWatch(history[:8])

    told = [text for n in range(9, 23) if (text := watch.look(history[:n]))]

    assert len(told) == 1
    assert told[0].startswith("from trial 13 on the robot moves 0.")
    assert "battery, springs, floor?" in told[0]


def test_a_run_repeats_a_gait_whose_motor_stood_still_and_learns_from_none_of_it():
    robot = planar_robot(seed=1, scatter="careful:not_starting=0.25")
    optimizer = Fixed()
    made = list(learn(robot, optimizer, TrialSettings(duration_s=1.2), Budget(6), lambda _: None))

    faulted = [it for it in made if it.trial.outcome is Outcome.FAULTED]
    assert faulted and all("did not turn" in it.trial.reason for it in faulted)
    assert optimizer.told == 6 == sum(it.score is not None for it in made)


def test_the_repeat_of_a_suspect_trial_is_one_of_the_trials_asked_for():
    robot, recorded = planar_robot(seed=1), []

    def weaken(logged):
        recorded.append(logged)
        share = 0.1 if logged.trial.number == 3 else 1.0
        robot._scatter = replace(robot._scatter, step=1.0 - share, step_factor=max(share, 0.1))

    made = list(learn(robot, Fixed(), TrialSettings(duration_s=2.0), Budget(6), weaken))

    origins = [it.suggestion.origin for it in made]
    assert len(made) == 6
    assert [it.review.is_suspect for it in made].index(True) + 1 == origins.index("repeats a suspect trial")


def test_the_reference_comes_after_every_so_many_trials_of_the_search_and_on_top_of_them():
    reference = Gait((10.0, 10.0, 10.0))
    budget = Budget(7, reference=reference, reference_every=3)
    made = list(learn(planar_robot(seed=1), Fixed(), SHORT, budget, lambda _: None))

    phases = [it.suggestion.phase for it in made]
    assert phases == [Phase.SEARCH] * 3 + [Phase.REFERENCE] + [Phase.SEARCH] * 3 + [Phase.REFERENCE, Phase.SEARCH]
    assert {it.trial.gait for it in made if it.suggestion.phase is Phase.REFERENCE} == {reference}


def test_a_resumed_run_goes_on_with_the_reference_where_it_was():
    budget = Budget(7, reference=OTHER, reference_every=3)
    whole = list(learn(planar_robot(seed=1), Fixed(), SHORT, budget, lambda _: None))
    rest = list(learn(planar_robot(seed=1), Fixed(), SHORT, budget, lambda _: None, history=whole[:5]))

    assert [it.trial.gait for it in rest] == [it.trial.gait for it in whole[5:]]


def test_a_robot_that_loses_strength_makes_the_run_warn():
    robot = planar_robot(seed=5, scatter="careful:drift=0,fade=0")
    events = []

    class Listener:
        def on_trial(self, logged):
            if logged.trial.number == 10:
                robot._scatter = replace(robot._scatter, step=1.0, step_factor=0.8, fade=0.0)

        def on_event(self, event):
            events.append(event)

    list(learn(robot, Fixed(), SHORT, Budget(16), lambda _: None, observers=[Listener()]))
    warnings = [event.text for event in events if event.kind is EventKind.WARNING]
    assert any("the robot moves 0." in text for text in warnings)


class Fixed:
    """An optimiser that always asks for one gait."""

    def __init__(self, gait=LIVELY):
        self.gait, self.told = gait, 0

    def ask(self):
        return Suggestion(self.gait, "fixed")

    def tell(self, gait, score):
        self.told += 1


def test_impossible_references_are_refused(capsys, tmp_path):
    from vvvaltr.controller.cli.main import main

    begin = ["learn", "--robot", "planar", "--trials", "3", "--out", str(tmp_path / "r"), "-q"]
    assert main([*begin, "--reference", "12,14,16"]) == 2
    assert "is not GAIT:N" in capsys.readouterr().err
    assert main([*begin, "--reference", "99,14,16:2"]) == 2
    assert "--reference" in capsys.readouterr().err


def test_trials_of_the_reference_gait_come_on_top_of_those_asked_for_and_are_not_counted(capsys, tmp_path):
    from vvvaltr.controller.cli.main import main

    out = str(tmp_path / "r")
    learn = [
        "learn",
        "--robot",
        "planar",
        "--duration",
        "1",
        "--trials",
        "3",
        "--reference",
        "12,-14,9:2",
        "--no-recording",
    ]
    assert main([*learn, "--out", out]) == 0
    assert main(["learn", "--resume", out, "--trials", "5", "--no-recording"]) == 0
    told = [line.split(":")[0] for line in capsys.readouterr().err.splitlines() if line.startswith("trial ")]
    assert [place.partition(", ")[2] for place in told] == [
        "1 of 3", "2 of 3", "reference", "3 of 3", "4 of 5", "reference", "5 of 5",
    ]  # fmt: skip


def test_the_summary_says_what_speeds_are_corrected_for_and_which_gaits_stood_still():
    found = {
        "strength": 0.52,
        "floor_x_m_s": 0.0,
        "floor_y_m_s": 0.004,
        "floor_sd_m_s": 0.001,
        "floor_probability": 0.9,
    }
    *before, last = run_of(0.100, 0.110, 0.008, 0.105)

    summary = summarise([*before, replace(last, fit=Fit({"signal_variance": 1.0, **found}, is_new=True))])

    assert summary["corrected"] == found
    assert summary["stood_still"][0]["moved"] == 3 and summary["stood_still"][0]["trials"] == 4
    told = [sentence for _, sentence in tell_causes(summary)]
    assert told == [
        "the speed is that on a level floor at today's strength (0.52 of the first trial's); "
        "the floor carries the robot by 4.0 +- 1.0 mm/s towards 90 degrees",
        "12.00 -14.00 0.00 Hz moved in 3 of 4 trials, 105.0 mm/s when it did",
    ]


def test_a_summary_of_a_run_without_a_model_says_nothing_of_causes():
    assert list(tell_causes(summarise(run_of(0.100, 0.110)))) == []


def test_a_robot_that_heads_along_minus_x_has_not_turned_because_its_yaw_changes_sign():
    def heading(*yaws_rad):
        poses = tuple(Pose(0.1 * k, (0.0, 0.0, 0.0), yaw_rad) for k, yaw_rad in enumerate(yaws_rad))
        return replace(trial(12.0, -14.0, 0.0), poses=poses)

    assert not have_turned([heading(3.12, -3.13), heading(-3.14, 3.13)])
    assert have_turned([heading(3.1, -3.1), heading(2.9)])
