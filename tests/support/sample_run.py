"""A run made by hand: a robot of three struts that hops over a bump, with every field of the log in use."""

from __future__ import annotations

import math
import random
from dataclasses import replace

from vvvaltr.controller.core.conditions import Conditions
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import Displacement, Fit, LoggedTrial, Review, Run, SteeringStep, Verdict
from vvvaltr.controller.core.values import (
    Command,
    Estimate,
    Forces,
    MotorState,
    Outcome,
    Phase,
    Pose,
    Recommendation,
    Source,
    Structure,
    Suggestion,
    Terrain,
    Trial,
)
from vvvaltr.controller.loop.movement import measure_applied, measure_movement

X_M = tuple(0.02 * step for step in range(-10, 31))
STRUCTURE = Structure(
    struts=((0, 1), (2, 3), (4, 5)),
    springs=((0, 2), (2, 4), (4, 0), (1, 3), (3, 5), (5, 1)),
    motor_struts=(0, 1, 2),
    terrain=Terrain(X_M, (-0.1, 0.1), tuple((0.01 * math.sin(20 * x),) * 2 for x in X_M)),
)
SOURCE = Source("flat", (Gait((12.0, -14.0, 9.0)), Gait((0.0, 5.0, 0.0), (0.1, 0.2, 0.3))), (0.041, 0.0))


def logged_trial(number: int, poses: int = 21, outcome: Outcome = Outcome.COMPLETED) -> LoggedTrial:
    """Return a trial of 20 poses a second that moves at about 40 mm/s."""
    draw = random.Random(number)
    gait = Gait(tuple(draw.uniform(-16, 16) for _ in range(3)))
    times_s = [0.05 * step for step in range(poses)]
    speed_m_s = draw.uniform(0.0, 0.08)
    estimate = Estimate(speed_m_s, 0.5 * speed_m_s, 1.5 * speed_m_s)
    reason = "" if outcome is Outcome.COMPLETED else "no pose for 0.3 s: is the tag in view?"
    trial = Trial(
        number,
        gait,
        outcome,
        reason,
        started_unix_s=1.76e9 + 0.3 * number,
        duration_s=times_s[-1],
        poses=tuple(_pose(t_s, speed_m_s, draw) for t_s in times_s),
        commands=tuple(Command(t_s, gait.scaled(min(1.0, 5 * t_s)), 0.3) for t_s in times_s),
        states=tuple(_state(t_s, gait, draw) for t_s in times_s),
        conditions=Conditions(60.0 * number, 7.4 - 0.01 * number, number == 3, 2, 0.012, 0.003),
    )
    movement, applied = measure_movement(trial), measure_applied(trial)
    if not outcome.is_valid:
        suggestion = Suggestion(gait, "initial design")
        return LoggedTrial(suggestion, trial, None, None, movement, applied, Review(verdict=Verdict.REPEAT))
    suggestion = Suggestion(gait, "expected improvement", estimate, {"length_scale_1": 0.3, "noise": 0.02})
    return LoggedTrial(
        suggestion,
        trial,
        speed_m_s * draw.uniform(0.7, 1.3),
        Recommendation(gait, estimate),
        movement,
        applied,
        Review("a cable touched it", Verdict.KEEP, "only at the end", True, "turned faster than it can"),
        Fit({"length_scale_1": 0.3, "noise": 0.02}, is_new=True),
        SteeringStep((0.3, 0.1), 1.57, Displacement(0.04, 0.0, 0.1), 0.01, 0.2, (gait, gait)),
    )


def sample_run(trials: int = 4, poses: int = 21) -> Run:
    """Return a run whose second trial lost its tracker."""
    outcomes = {2: Outcome.TRACKING_LOST}
    logged = (logged_trial(n, poses, outcomes.get(n, Outcome.COMPLETED)) for n in range(1, trials + 1))
    return Run(STRUCTURE, (SOURCE,), tuple(logged), {"version": "0.2.0", "robot": "sample", "seed": "0"})


def weaker(trials: int, since: int) -> list[LoggedTrial]:
    """Return trials of alike gaits, every fifth of them the reference, that are half as fast from one of them on."""
    logged = []
    for number in range(1, trials + 1):
        trial, is_reference = logged_trial(number, poses=3), number % 5 == 1
        gait = Gait((12.0, -14.0, 9.0 if is_reference else 8.0 + 0.1 * number))
        phase = Phase.REFERENCE if is_reference else Phase.SEARCH
        speed_m_s = (0.030 + 0.001 * (number % 3)) * (1.0 if number < since else 0.45)
        suggestion = replace(trial.suggestion, gait=gait, phase=phase)
        logged.append(
            replace(
                trial, suggestion=suggestion, trial=replace(trial.trial, gait=gait), score=speed_m_s, review=Review()
            )
        )
    return logged


def _pose(t_s: float, speed_m_s: float, draw: random.Random) -> Pose:
    pitch_rad = 0.1 * math.sin(12 * t_s)
    centre_m = (speed_m_s * t_s, draw.gauss(0, 1e-4), 0.04 + 0.004 * abs(math.sin(20 * t_s)))
    corners = [(0.047 * math.cos(angle + pitch_rad), 0.047 * math.sin(angle + pitch_rad)) for angle in range(6)]
    markers_m = tuple((centre_m[0] + x, centre_m[1], centre_m[2] + z) for x, z in corners)
    return Pose(t_s, centre_m, 0.02 * t_s, pitch_rad, draw.gauss(0, 0.01), markers_m, _forces(t_s, markers_m))


def _forces(t_s: float, markers_m: tuple[tuple[float, float, float], ...]) -> Forces:
    """Return forces of which the ground's are gone while the robot hops."""
    tensions_n = tuple(2.0 + math.sin(20 * t_s + spring) for spring in range(len(STRUCTURE.springs)))
    feet_m = markers_m[4:] if math.sin(20 * t_s) < 0.5 else ()
    swing_n = (0.3 * math.sin(80 * t_s), 0.0, 0.3 * math.cos(80 * t_s))
    return Forces(tensions_n, (swing_n,) * 3, feet_m, ((0.0, 0.0, 0.4),) * len(feet_m))


def _state(t_s: float, gait: Gait, draw: random.Random) -> MotorState:
    share = 1 - math.exp(-t_s / 0.2)
    return MotorState(
        t_s, tuple(share * f + draw.gauss(0, 0.1) for f in gait.frequency_hz), True, (0.2, 0.3, 0.1), (31.0,)
    )
