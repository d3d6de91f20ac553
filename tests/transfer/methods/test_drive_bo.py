"""The default without a source: what it expects of a robot's drive, and that data decide about it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait, GaitSpace, Quantity
from vvvaltr.transfer.bayes.drive import Drive
from vvvaltr.transfer.bayes.driven import Driven
from vvvaltr.transfer.bayes.refitting import Conditioned
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.methods.drive import DriveBO, Hypotheses, learn_driven
from vvvaltr.transfer.methods.plain_bo import INITIAL_TRIALS, PlainBO

SIGNED = GaitSpace.over(3, -16.0, 16.0)
ONE_SENSE = GaitSpace.over(3, 4.0, 16.0)
AMPLITUDES = GaitSpace.over(2, -16.0, 16.0, (Quantity.FREQUENCY, Quantity.AMPLITUDE))
PER_HYPOTHESIS = ("dead_zones", "trend", "loading", "inverse_root", "weights")
PHASES = GaitSpace.over(2, 0.0, 1.0, (Quantity.PHASE,))


def shaken(gait: Gait, dead_hz: float = 10.0) -> float:
    """Speed in m/s: what all motors together have beyond a dead zone, faster with the first motor backwards."""
    beyond = np.maximum(np.abs(gait.frequency_hz) - dead_hz, 0.0)
    return float(0.002 * beyond.sum() * (1.5 if gait.frequency_hz[0] < 0.0 else 1.0))


def search(optimizer: DriveBO | PlainBO, trials: int, scatter: float = 0.1) -> list[Gait]:
    rng, gaits = np.random.default_rng(4), []
    for _ in range(trials):
        gaits.append(optimizer.ask().gait)
        optimizer.tell(gaits[-1], shaken(gaits[-1]) * float(np.exp(scatter * rng.normal())))
    return gaits


@pytest.mark.parametrize("space", [SIGNED, ONE_SENSE])
def test_the_first_gait_has_all_motors_near_full_speed_but_apart_and_says_why(space: GaitSpace) -> None:
    suggestion = DriveBO(space, 2).ask()
    assert sorted(np.abs(suggestion.gait.frequency_hz)) == pytest.approx([14.4, 15.2, 16.0])
    assert suggestion.origin == "strongest drive"


def test_from_the_second_trial_on_gaits_are_chosen_for_the_gain_expected_of_them() -> None:
    optimizer = DriveBO(SIGNED, 2)
    search(optimizer, 1)
    assert optimizer.ask().origin == "expected improvement"


def test_after_one_trial_the_best_gait_is_the_one_that_was_tried() -> None:
    optimizer = DriveBO(SIGNED, 2)
    tried = search(optimizer, 1)[0]
    best = optimizer.recommend()
    assert best.gait.frequency_hz == pytest.approx(tried.frequency_hz)
    assert best.estimate.mean == pytest.approx(shaken(tried), rel=0.5)


def test_the_first_five_gaits_of_a_shaken_robot_are_twice_as_fast_as_those_of_plain_bo() -> None:
    ours, plain = (search(optimizer, 5) for optimizer in (DriveBO(SIGNED, 3), PlainBO(SIGNED, 3)))
    assert sum(map(shaken, ours)) > 2.0 * sum(map(shaken, plain))


def test_a_best_gait_in_a_corner_of_the_space_is_recommended() -> None:
    optimizer = DriveBO(SIGNED, 3)
    search(optimizer, 12)
    assert np.abs(optimizer.recommend().gait.frequency_hz) == pytest.approx(16.0, rel=0.02)


def by_luck(gait: Gait, rng: np.random.Generator, usual: float) -> float:
    """Speed of a robot of which gaits that beat have any speed from 0 to ``usual`` times that of their neighbours."""
    beats = Drive.of(SIGNED).beats(SIGNED.to_unit(gait)[None, :])[0]
    return shaken(gait) * (usual * rng.random() if beats else float(np.exp(0.05 * rng.normal())))


@pytest.mark.parametrize(("usual", "beats"), [(1.0, False), (8.0, True)])
def test_gaits_that_beat_are_recommended_only_where_their_mean_is_the_better_one(usual: float, beats: bool) -> None:
    found = []
    for seed in range(5):
        optimizer, rng = DriveBO(SIGNED, seed), np.random.default_rng(seed)
        for _ in range(25):
            gait = optimizer.ask().gait
            optimizer.tell(gait, by_luck(gait, rng, usual))
        best = SIGNED.to_unit(optimizer.recommend().gait)
        found.append(bool(Drive.of(SIGNED).beats(best[None, :])[0]))
    assert found.count(beats) >= 4


def belief_of(x: np.ndarray, scores: np.ndarray, space: GaitSpace = SIGNED) -> dict[str, float]:
    belief = learn_driven(space, Drive.of(space), Trials(x, scores), None, np.random.default_rng(0))
    return dict(belief.hyperparameters)


@pytest.mark.parametrize("seed", [0, 1, 5])
def test_a_gait_with_all_motors_off_is_not_tried_although_strong_gaits_are_slow(seed: int) -> None:
    optimizer, rng = DriveBO(ONE_SENSE, seed), np.random.default_rng(seed)
    for _ in range(10):
        gait = optimizer.ask().gait
        u = np.array(gait.frequency_hz) / 16.0
        assert u.max() > 0.2
        score = 0.02 * np.linalg.norm(u) * (1.2 - 0.25 * u.sum()) * np.exp(0.1 * rng.normal())
        optimizer.tell(gait, float(score))


def test_a_robot_is_known_to_stay_where_it_is_while_all_motors_are_off() -> None:
    off, weak = Gait((0.0, 0.0, 0.0)), Gait((3.0, 3.0, 3.0))
    optimizer = DriveBO(ONE_SENSE, 0)
    search(optimizer, 6)
    known, other = optimizer.predict([off, weak])
    assert known.low <= 0.0 <= known.high
    assert known.high - known.low < 0.5 * (other.high - other.low)


@pytest.mark.parametrize("space", [SIGNED, GaitSpace.over(3, 8.0, 16.0)])
def test_the_place_at_which_all_motors_are_off_is_that_of_no_frequency(space: GaitSpace) -> None:
    assert Drive.of(space).rest == pytest.approx(space.to_unit(Gait((0.0, 0.0, 0.0))))


def test_data_decide_whether_more_drive_moves_more() -> None:
    x = np.random.default_rng(5).random((25, 3))
    drive = Drive.of(SIGNED).trend(x, np.zeros(1))[0]
    assert belief_of(x, 1.0 + drive)["drive"] > 0.7
    assert belief_of(x, 1.0 - drive)["drive"] < -0.2


def test_data_decide_how_wide_the_dead_zone_is() -> None:
    x = np.random.default_rng(5).random((40, 3))
    gaits = [SIGNED.from_unit(place) for place in x]
    wide, none = (np.array([shaken(gait, dead_hz) for gait in gaits]) for dead_hz in (11.2, 0.0))
    assert belief_of(x, wide)["dead_zone_hz"] >= 8.0
    assert belief_of(x, none)["dead_zone_hz"] <= 4.8


def test_gaits_whose_slow_motors_differ_within_the_dead_zone_are_told_apart() -> None:
    x = np.random.default_rng(5).random((40, 3))
    x[:, 1:] = np.round(x[:, 1:])
    gaits = [ONE_SENSE.from_unit(place) for place in x]
    scores = np.array([shaken(gait, 11.2) * (1.5 if gait.frequency_hz[0] < 8.0 else 1.0) for gait in gaits])
    belief = learn_driven(ONE_SENSE, Drive.of(ONE_SENSE), Trials(x, scores), None, np.random.default_rng(0))
    assert belief.hyperparameters["dead_zone_hz"] >= 9.0
    slow, slower = belief.posterior.predict_mean(np.array([[0.45, 1.0, 1.0], [0.15, 1.0, 1.0]]))
    assert slower > slow + 0.1


def test_amplitudes_count_and_phases_do_not() -> None:
    loud, faint = (AMPLITUDES.to_unit(Gait((16.0, 16.0), (), (share, share))) for share in (1.0, 0.25))
    trend = Drive.of(AMPLITUDES).trend(np.array([loud, faint]), np.zeros(1))[0]
    assert trend == pytest.approx([3.0 * (1.0 - 0.4), 3.0 * (0.25 - 0.4)])
    assert not Drive.of(PHASES).has_meaning


def test_where_a_drive_has_no_meaning_the_first_trials_are_spread_out_as_in_plain_bo() -> None:
    optimizer, plain = DriveBO(PHASES, 6), PlainBO(PHASES, 6)
    for trial in range(INITIAL_TRIALS + 3):
        suggestion = optimizer.ask()
        assert (suggestion.gait == plain.ask().gait) == (trial < INITIAL_TRIALS)
        for each in (optimizer, plain):
            each.tell(suggestion.gait, float(np.cos(suggestion.gait.phase_rad[0])))
    assert "drive" not in optimizer.ask().hyperparameters
    assert DriveBO(SIGNED, 6, has_drive=False).ask().origin == "initial design"


@pytest.mark.parametrize("space", [SIGNED, ONE_SENSE, AMPLITUDES, PHASES])
def test_the_gradients_of_a_mixture_equal_finite_differences(space: GaitSpace) -> None:
    rng, drive = np.random.default_rng(7), Drive.of(space)
    x = rng.random((14, space.dimension))
    belief = learn_driven(space, drive, Trials(x, rng.random(14)), None, rng)
    posterior, step = belief.posterior, 1e-6
    assert isinstance(posterior, Driven)
    places = rng.random((5, space.dimension))
    mean, variance, mean_slope, variance_slope = posterior.predict_with_gradient(places)
    assert np.array([mean, variance]) == pytest.approx(np.array(posterior.predict(places)))
    assert posterior.predict_mean(places) == pytest.approx(mean)
    assert np.array_equal(posterior.predict_mean_with_gradient(places)[1], mean_slope)
    for j, shift in enumerate(step * np.eye(space.dimension)):
        ahead, behind = np.array(posterior.predict(places + shift)), np.array(posterior.predict(places - shift))
        by_mean, by_variance = (ahead - behind) / (2.0 * step)
        assert mean_slope[:, j] == pytest.approx(by_mean, abs=1e-6)
        assert variance_slope[:, j] == pytest.approx(by_variance, abs=1e-6)


def test_the_mixture_has_the_moments_of_its_hypotheses() -> None:
    rng, drive = np.random.default_rng(8), Drive.of(SIGNED)
    belief = learn_driven(SIGNED, drive, Trials(rng.random((6, 3)), rng.random(6)), None, rng)
    posterior, x = belief.posterior, rng.random((4, 3))
    assert isinstance(posterior, Driven) and len(posterior.chance) > 1
    alone = [
        replace(
            posterior,
            chance=np.ones((1, 1)),
            **{name: getattr(posterior, name)[i : i + 1] for name in PER_HYPOTHESIS},
        )
        for i in range(len(posterior.chance))
    ]
    means, variances = (np.array(part) for part in zip(*(each.predict(x) for each in alone), strict=True))
    mean, variance = posterior.predict(x)
    assert mean == pytest.approx((posterior.chance * means).sum(axis=0))
    assert variance == pytest.approx((posterior.chance * (variances + means**2)).sum(axis=0) - mean**2)


def test_hypotheses_that_are_extended_are_those_conditioned_on_all_trials() -> None:
    rng, drive = np.random.default_rng(9), Drive.of(SIGNED)
    rows = Trials(rng.random((72, 3)), rng.random(72))
    fitted = learn_driven(SIGNED, drive, rows.part(slice(70)), None, rng).fitted
    belief = learn_driven(SIGNED, drive, rows, fitted, rng)
    assert isinstance(belief.fitted, Conditioned) and belief.fitted.is_of(70)  # so it goes on from that fit
    assert belief.drive is not None
    longer = Hypotheses.of(belief.drive, belief.fitted.others)
    anew = Hypotheses.condition(belief.drive, belief.fitted, belief.scale, None, math.nan)
    assert longer.chances() == pytest.approx(anew.chances(), rel=1e-9)
