import dataclasses
import math

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.records import Evidence, Piece, Told
from vvvaltr.transfer.bayes import refitting
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.causes.correction import Corrector
from vvvaltr.transfer.methods.registry import make_optimizer

SPACE = GaitSpace.over(3, -50.0, 50.0)
DRIFT_M_S = np.array([0.004, -0.003])


def drive(gait, own_m_s, yaw_rad, random, drift_m_s=DRIFT_M_S, strength=1.0, ahead=None):
    """Return what is told of a trial of 5 s in which the robot walks straight in its own frame, turns and drifts."""
    own, pieces, total = np.array(own_m_s) * strength, [], np.zeros(2)
    share = sum(hz * hz for hz in gait.frequency_hz) / 1400.0
    for second in range(5):
        yaw = yaw_rad + 0.3 * (second + 0.5)
        cos, sin = math.cos(yaw), math.sin(yaw)
        velocity = np.array([[cos, -sin], [sin, cos]]) @ own + share * np.array(drift_m_s)
        moved = velocity + random.normal(0.0, 0.0005, 2)
        total += moved
        pieces.append(Piece(1.0, tuple(moved.tolist()), (cos, sin)))
    x, y = (total / 5.0).tolist()
    score = math.hypot(x, y) if ahead is None else ahead[0] * x + ahead[1] * y
    return Told(gait, score, None, Evidence((x, y), ahead, tuple(pieces)))


def drives(random, count, drift_m_s=DRIFT_M_S):
    gaits = [Gait(tuple(random.uniform(10.0, 25.0, 3).tolist())) for _ in range(count)]
    own = random.normal(0.0, 0.015, (count, 2))
    inclined = [drive(gait, v, 1.0 * i, random, drift_m_s) for i, (gait, v) in enumerate(zip(gaits, own, strict=True))]
    level = [drive(gait, v, 1.0 * i, random, (0.0, 0.0)) for i, (gait, v) in enumerate(zip(gaits, own, strict=True))]
    return inclined, [told.score for told in level]


def test_the_floor_is_taken_off_the_scores():
    inclined, level = drives(np.random.default_rng(0), 12)

    corrected = Corrector(100.0).correct(inclined)

    before = np.abs(np.array([told.score for told in inclined]) - level).mean()
    assert np.abs(corrected.scores - level).mean() < 0.5 * before
    assert corrected.drift is not None
    assert math.degrees(abs(corrected.drift.azimuth_rad - math.atan2(-3, 4))) < 15


def test_late_in_a_run_the_last_trials_lose_the_floors_mean_drift_until_it_is_learned_anew():
    inclined, level = drives(np.random.default_rng(6), 83)
    one_by_one = Corrector(100.0)

    settled, late, anew = (one_by_one.correct(inclined[:count]) for count in (80, 81, 82))

    assert late.drift is settled.drift is not None
    assert np.array_equal(late.scores[:80], settled.scores)
    added_m_s = late.drift.during(sum(hz * hz for hz in inclined[80].gait.frequency_hz), 1.0)
    assert late.scores[80] == pytest.approx(math.hypot(*(inclined[80].evidence.velocity_m_s - added_m_s)))
    assert abs(late.scores[80] - level[80]) < abs(inclined[80].score - level[80])
    assert anew.drift is not settled.drift
    assert np.array_equal(Corrector(100.0).correct(inclined[:81]).scores, late.scores)


def test_on_a_level_floor_the_scores_stay_nearly_as_they_are():
    level, scores = drives(np.random.default_rng(1), 12, (0.0, 0.0))

    corrected = Corrector(100.0).correct(level)

    assert np.abs(corrected.scores / scores - 1.0).mean() < 0.05


def test_a_speed_along_the_heading_loses_the_part_of_the_floor_along_it():
    random, ahead = np.random.default_rng(2), (0.8, -0.6)  # along the drift
    gaits = [Gait(tuple(random.uniform(10.0, 25.0, 3).tolist())) for _ in range(10)]
    history = [drive(gait, random.normal(0.0, 0.01, 2), 0.7 * i, random, ahead=ahead) for i, gait in enumerate(gaits)]

    corrected = Corrector(100.0).correct(history)

    taken = np.array([told.score for told in history]) - corrected.scores
    assert (taken > 0.0).all()


def test_earlier_scores_are_brought_to_the_strength_of_today():
    random = np.random.default_rng(3)
    gaits = [Gait(tuple(random.uniform(10.0, 25.0, 3).tolist())) for _ in range(3)]
    history = [
        Told(gaits[i % 3], 0.05 * (1.0 if i < 12 else 0.5) * math.exp(random.normal(0.0, 0.08)), None, Evidence())
        for i in range(21)
    ]

    corrected = Corrector(100.0).correct(history)

    assert corrected.strengths[-1] == pytest.approx(0.5, rel=0.15)
    assert corrected.scores[:12].mean() == pytest.approx(0.025, rel=0.2)
    assert corrected.scores[-1] == history[-1].score
    assert corrected.names["strength"] == pytest.approx(0.5, rel=0.15)


def test_a_loss_that_is_not_certain_changes_no_score():
    random = np.random.default_rng(4)
    speeds = [0.05, 0.045, 0.04, 0.028, 0.03, 0.026]
    gaits = [Gait(tuple(random.uniform(10.0, 25.0, 3).tolist())) for _ in speeds]
    history = [Told(gait, speed, None, Evidence()) for gait, speed in zip(gaits, speeds, strict=True)]

    corrected = Corrector(100.0).correct(history)

    assert corrected.scores.tolist() == speeds
    assert "strength" not in corrected.names


def test_a_gait_that_stands_still_from_some_starts_is_as_fast_as_all_its_trials_say():
    gait = Gait((20.0, 20.0, 20.0))
    history = [Told(gait, speed, None, Evidence()) for speed in (0.050, 0.052, 0.003, 0.049)]

    corrected = Corrector(100.0).correct(history)

    assert corrected.scores.tolist() == [told.score for told in history]


def test_what_was_applied_counts_not_what_was_commanded_and_a_common_share_is_no_other_gait():
    gait = Gait((20.0, -30.0, 1.0))
    applied = [(18.0, -27.0, 0.0), (18.0, -27.0, 0.9), (18.9, -27.0, 0.5)]
    history = [Told(gait, 0.05, None, Evidence(applied_hz=hz)) for hz in applied]

    corrected = Corrector(100.0).correct(history)

    assert corrected.gaits[0] == gait
    assert corrected.gaits[2].frequency_hz == pytest.approx((21.0, -30.0, 1.0))


def test_a_sensor_that_lies_is_not_believed():
    gait = Gait((20.0, -30.0, 10.0))
    history = [Told(gait, 0.05, None, Evidence(applied_hz=hz)) for hz in [(20, -30, 10), (20, 30, 10), (2, -30, 10)]]

    assert [each.frequency_hz for each in Corrector(100.0).correct(history).gaits] == [gait.frequency_hz] * 3


def test_trials_told_without_evidence_stay_as_they_are():
    history = [Told(Gait((20.0, 20.0, 20.0)), speed) for speed in (0.05, 0.05, 0.002, 0.01)]

    corrected = Corrector(100.0).correct(history)

    assert corrected.scores.tolist() == [told.score for told in history]
    assert corrected.names == {}


@pytest.mark.parametrize(("method", "told"), [("plain", 14), ("plain", 20), ("plain", 26), ("drive", 20)])
def test_a_corrected_history_continues_with_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, method: str, told: int
) -> None:
    monkeypatch.setattr(refitting, "EVERY_TRIAL", 12)
    monkeypatch.setattr(refitting, "MOST_OBSERVATIONS", 16)
    optimizer, resumed = make_optimizer(method, SPACE, 1), make_optimizer(method, SPACE, 1)
    assert isinstance(optimizer, Search) and isinstance(resumed, Search)
    random, history = np.random.default_rng(5), list[Told]()
    for number in range(told):
        gait = optimizer.ask().gait if number % 4 else Gait((20.0, 20.0, 20.0))
        speed = 0.001 if number == 8 else 0.01  # the fixed gait stood still in its third trial
        one = drive(gait, (speed, 0.0), 1.3 * number, random)
        optimizer.tell_trial(one)
        history.append(dataclasses.replace(one, fit=optimizer.fit()))

    resumed.recall(history)

    assert resumed.ask() == optimizer.ask()
    assert resumed.recommend() == optimizer.recommend()
    assert resumed.fit() == optimizer.fit()
