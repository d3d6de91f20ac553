"""The floor: random signed gaits on the spatial twin, a third of the trials repeats, the robot left where it stopped.

The scatter is ``hurried`` with other inclines. The true drift is the mean displacement of ten gaits over four headings
each, at the strength that the robot had in the trials: a weaker robot is carried less.
"""

from __future__ import annotations

import math
import time
from argparse import Namespace
from functools import partial
from itertools import product

import numpy as np

from benchmarks.causes.driving import SETTINGS
from benchmarks.causes.rows import Row, Rows
from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import Piece
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.loop.trial_runner import run_trial
from vvvaltr.transfer.causes.floor import SURE, DriftLearner
from vvvaltr.transfer.causes.pieces import cut, weigh
from vvvaltr.twin.engine import Start
from vvvaltr.twin.presets import TWINS
from vvvaltr.twin.scatter import Scatter, parse_scatter

LOOKS = (5, 10, 20)
STRENGTHS = (0.25, 0.5, 0.75, 1.0)


def choose_gaits(random: np.random.Generator, count: int, high_hz: float) -> list[Gait]:
    """Return gaits of a run: new ones, and every third time an earlier one again."""
    chosen: list[Gait] = []
    for number in range(count):
        again = number % 3 == 2
        chosen.append(
            chosen[int(random.integers(number))] if again else Gait(tuple(random.uniform(-high_hz, high_hz, 3)))
        )
    return chosen


def measure_true_drift(body: str, incline_rad: float) -> Row:
    """Return the size of the drift in m/s, at the mean sum of squared frequencies, for each of ``STRENGTHS``."""
    if incline_rad == 0.0:
        return {"true_m_s": [0.0] * len(STRENGTHS)}
    robot = TWINS["spatial"].make(body, scatter=f"careful:drift=0,incline_rad={incline_rad},azimuth_rad=0")
    random = stream(0, 0, "true drift")
    gaits = [tuple(random.uniform(-50.0, 50.0, 3)) for _ in range(10)]
    found = []
    for strength in STRENGTHS:
        moved = []
        for hz, quarter in product(gaits, range(4)):
            robot.place(1)
            robot.put_down(Start(yaw_rad=quarter * math.pi / 2.0))
            for _ in range(100):
                robot.motors.drive(Gait(hz, amplitude=(strength,) * 3), 0.25)
                robot.clock.sleep(0.05)
            moved.append(robot.engine.nodes_m().mean(axis=0)[0])
        found.append(float(np.mean(moved)) / 5.0)
    return {"true_m_s": found}


def find_floor(body: str, incline_rad: float, seed: int) -> Row:
    """Return what is known of the floor after the trials of ``LOOKS`` in one run: of each a list of numbers."""
    scatter = f"hurried:incline_rad={incline_rad}"
    robot = TWINS["spatial"].make(body, seed=seed, scatter=scatter)
    azimuth_rad = Scatter().draw_azimuth_rad(seed)
    random, learner = stream(seed, 0, "floor gaits"), DriftLearner()
    pieces, driven, strengths = list[tuple[Piece, ...]](), list[Gait](), list[float]()
    found: Row = {"speed_m_s": [], "strength": [], "off_deg": [], "inclined": [], "ms": []}
    for number, gait in enumerate(choose_gaits(random, max(LOOKS), robot.range_hz[1]), start=1):
        trial = run_trial(robot, gait, SETTINGS, number)
        if trial.outcome.is_valid and (cuts := cut(trial.poses)):
            pieces.append(cuts)
            driven.append(gait)
            strengths.append(parse_scatter(scatter, TWINS["spatial"].frequency_scatter).strength(seed, number))
        if number in LOOKS:
            begun_s = time.process_time()
            drift = learner.learn(driven, pieces, [weigh(gait.frequency_hz) for gait in driven])
            assert drift is not None
            found["ms"].append(1000.0 * (time.process_time() - begun_s))
            found["speed_m_s"].append(drift.speed_m_s)
            found["strength"].append(float(np.mean(strengths)))
            found["off_deg"].append(math.degrees(abs(math.remainder(drift.azimuth_rad - azimuth_rad, math.tau))))
            found["inclined"].append(drift.is_inclined)
    return found


def measure(rows: Rows, arguments: Namespace) -> None:
    """Print how well the floor is found, a line for each body, incline and number of trials."""
    for body in arguments.bodies:
        for incline in arguments.inclines:
            where = {"body": body, "incline_rad": incline}
            truth = rows.get({"what": "true drift", **where}, partial(measure_true_drift, body, incline))
            runs = [
                rows.get({"what": "floor", **where, "seed": seed}, partial(find_floor, body, incline, seed))
                for seed in arguments.seeds
            ]
            for look, trials in enumerate(LOOKS):
                _tell(f"{body} {incline:.3f} rad, {trials} trials", runs, look, 5000.0 * np.array(truth["true_m_s"]))


def _tell(name: str, runs: list[Row], look: int, true_mm: Array) -> None:
    mm = 5000.0 * np.array([run["speed_m_s"][look] for run in runs])
    off = np.array([run["off_deg"][look] for run in runs])
    told = f"{name}, {len(runs)} runs: drift in 5 s {np.median(mm):.1f} mm (80 %: {np.quantile(mm, 0.8):.1f})"
    if true_mm.any():
        truth = np.interp([run["strength"][look] for run in runs], STRENGTHS, true_mm)
        near = np.abs(mm / truth - 1.0) < 0.3
        told += f", true {truth.mean():.1f} ({true_mm[-1]:.1f} at full strength), within 30 % in {near.mean():.0%}"
        told += f"; direction off by {np.median(off):.0f} degrees"
        told += f" (80 %: {np.quantile(off, 0.8):.0f}), within 20 in {np.mean(off < 20.0):.0%}"
        is_told = np.array([run["inclined"][look] for run in runs]) >= SURE
        told += f"; told in {is_told.mean():.0%}, and then within 20 in {np.mean(off[is_told] < 20.0):.0%}"
    print(told, flush=True)
