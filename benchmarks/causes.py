"""Whether the causes of scatter are found in a run's own trials: ``python -m benchmarks.causes PART``.

``floor``: random signed gaits on the spatial twin, a third of the trials repeats, the robot left where it stopped, in
``hurried`` with other inclines. The true drift is the mean displacement of ten gaits over four headings each.
``strength``: synthetic runs that search and repeat, half of them with a halving; ``laboratory``: a table of repeats.
``learning``: what a method recommends under each scatter, by its true speed, with and without correcting for causes;
``gain``: the same of the same 20 trials.
``turning``: whether a motor turned, from the shaking that a tracker sees; as many drives as there are seeds.
``standing``: repeats of one gait some of which stand still, as a laboratory's robot does.
Each finished run is a line in ``--out``, so that an interrupted benchmark has lost nothing.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.ask_tell import tell_history
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.records import LoggedTrial, Piece
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Gait, GaitSpace, Pose, Trial
from vvvaltr.controller.loop.causes import find_loss_in
from vvvaltr.controller.loop.learn import learn
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.safety import GuardedRobot, Limits
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.transfer.causes.floor import DriftLearner
from vvvaltr.transfer.causes.pieces import cut, weigh
from vvvaltr.transfer.causes.standing import find_standing
from vvvaltr.transfer.causes.strength import find_loss
from vvvaltr.transfer.causes.turning import find_turning
from vvvaltr.transfer.methods.registry import make_optimizer
from vvvaltr.twin.engine import Start
from vvvaltr.twin.presets import TWINS
from vvvaltr.twin.scatter import Scatter, TrackerNoise, parse_scatter

SETTINGS = TrialSettings(duration_s=5.0)
LOOKS = (5, 10, 20)


def _gaits(random: np.random.Generator, count: int, high_hz: float) -> list[Gait]:
    """Return gaits of a run: new ones, and every third time an earlier one again."""
    chosen: list[Gait] = []
    for number in range(count):
        again = number % 3 == 2
        chosen.append(
            chosen[int(random.integers(number))] if again else Gait(tuple(random.uniform(-high_hz, high_hz, 3)))
        )
    return chosen


def measure_true_drift(body: str, incline_rad: float) -> float:
    """Return the size of the floor's drift in m/s, at the mean sum of squared frequencies."""
    if incline_rad == 0.0:
        return 0.0
    robot = TWINS["spatial"].make(body, scatter=f"careful:drift=0,incline_rad={incline_rad},azimuth_rad=0")
    random, moved = stream(0, 0, "true drift"), []
    for gait in (Gait(tuple(random.uniform(-50.0, 50.0, 3))) for _ in range(10)):
        for quarter in range(4):
            robot.place(1)
            robot.put_down(Start(yaw_rad=quarter * math.pi / 2.0))
            for _ in range(100):
                robot.motors.drive(gait, 0.25)
                robot.clock.sleep(0.05)
            moved.append(robot.engine.nodes_m().mean(axis=0)[0])
    return float(np.mean(moved)) / 5.0


def run_floor(body: str, incline_rad: float, seed: int) -> list[dict[str, Any]]:
    """Return what is known of the floor after 5, 10 and 20 trials of one run."""
    scatter = f"hurried:incline_rad={incline_rad}"
    robot = TWINS["spatial"].make(body, seed=seed, scatter=scatter)
    azimuth_rad = Scatter().draw_azimuth_rad(seed)
    random, learner = stream(seed, 0, "floor gaits"), DriftLearner()
    pieces, driven, found = list[tuple[Piece, ...]](), list[Gait](), list[dict[str, Any]]()
    for number, gait in enumerate(_gaits(random, max(LOOKS), robot.range_hz[1]), start=1):
        trial = run_trial(robot, gait, SETTINGS, number)
        if trial.outcome.is_valid and (cuts := cut(trial.poses)):
            pieces.append(cuts)
            driven.append(gait)
        if number in LOOKS:
            begun_s = time.process_time()
            drift = learner.learn(driven, pieces, [weigh(gait.frequency_hz) for gait in driven])
            assert drift is not None
            off_rad = abs(math.remainder(drift.azimuth_rad - azimuth_rad, math.tau))
            found.append(
                {
                    "what": "floor", "body": body, "incline_rad": incline_rad, "seed": seed, "trials": number,
                    "speed_m_s": drift.speed_m_s, "off_deg": math.degrees(off_rad), "inclined": drift.is_inclined,
                    "ms": 1000.0 * (time.process_time() - begun_s),
                }
            )  # fmt: skip
    return found


def _search(random: np.random.Generator, trials: int, repeats: float, step: int | None) -> tuple[Array, Array]:
    """Return places and speeds of a run that searches a smooth landscape and repeats its best gaits."""
    bumps, sizes = random.random((6, 3)), random.lognormal(0.0, 0.8, 6)
    places: list[Array] = []
    speeds: list[float] = []
    walk = 0.0
    for number in range(trials):
        if number >= 8 and random.random() < repeats:
            place = places[int(random.choice(np.argsort(speeds)[-4:]))]
        elif number >= 8 and random.random() < 0.6:
            place = np.clip(places[int(np.argmax(speeds))] + random.normal(0.0, 0.12, 3), 0.0, 1.0)
        else:
            place = random.random(3)
        true = 0.1 + float(sizes @ np.exp(-((bumps - place) ** 2).sum(axis=1) / 0.08))
        walk += random.normal(0.0, 0.02)
        lost = math.log(0.5) if step is not None and number >= step else 0.0
        stands = random.random() < 0.05
        places.append(place)
        speeds.append(true * math.exp(walk + lost + random.normal(0.0, 0.12)) * (0.08 if stands else 1.0))
    return np.array(places), np.array(speeds)


def run_strength(repeats: float, halves: bool, seed: int) -> dict[str, Any]:
    """Return when a loss was told in one run of 50 trials."""
    random = stream(seed, int(halves), f"strength {repeats}")
    step = int(random.integers(15, 35)) if halves else None
    places, speeds = _search(random, 50, repeats, step)
    told, since, factor = None, None, None
    for number in range(8, 51):
        loss = find_loss(places[:number], speeds[:number].tolist())
        if told is None and loss is not None and loss.is_told:
            told, since, factor = number, loss.since, loss.factor
    return {
        "what": "strength", "repeats": repeats, "seed": seed, "step": step, "told": told, "since": since,
        "factor": factor,
    }  # fmt: skip


def measure_shaking(seed: int, count: int) -> list[tuple[Gait, int | None, Trial]]:
    """Return drives of the spatial twin seen at 100 Hz without noise; one motor stood still in half of them."""
    text = "careful:not_starting=0.5,telling=no"
    robot = TWINS["spatial"].make(seed=seed, scatter=text, noise=TrackerNoise.none())
    scatter, random, found = parse_scatter(text, 0.0), stream(seed, 0, "shaking"), []
    for number in range(1, count + 1):
        gait = Gait(tuple((random.choice([-1.0, 1.0], 3) * random.uniform(8.0, 50.0, 3)).tolist()))
        failure = scatter.draw_failure(stream(seed, number, "failure"), 3)
        found.append((gait, failure and failure[0], run_trial(robot, gait, replace(SETTINGS, period_s=0.01), number)))
    return found


def judge_shaking(
    drives: list[tuple[Gait, int | None, Trial]], every: int, noise_m: float, markers: bool
) -> dict[str, Any]:
    """Return how many standing and turning motors were told, by a tracker of 100 Hz over ``every`` with noise."""
    random, counts = stream(0, every, f"noise {noise_m}"), Counter[str]()
    for gait, stood, trial in drives:
        if not trial.outcome.is_valid:
            continue
        poses = [_blur(pose, noise_m, markers, random) for pose in trial.poses[::every]]
        for motor, turned in enumerate(find_turning(poses, gait.frequency_hz)):
            counts[f"{'standing' if motor == stood else 'turning'} motor: {turned}"] += 1
    return {"what": "turning", "rate_hz": 100 / every, "noise_m": noise_m, "markers": markers, **counts}


def _blur(pose: Pose, noise_m: float, markers: bool, random: np.random.Generator) -> Pose:
    """Return a pose as a tracker sees it: each coordinate with noise, each angle with 0.002 rad."""
    x_m, y_m, z_m = (np.array(pose.position_m) + random.normal(0.0, noise_m, 3)).tolist()
    angles = np.array([pose.yaw_rad, pose.pitch_rad, pose.roll_rad]) + random.normal(0.0, 0.002, 3)
    yaw_rad, pitch_rad, roll_rad = angles.tolist()
    seen = np.array(pose.markers_m) + random.normal(0.0, noise_m, (len(pose.markers_m), 3)) if markers else np.empty(0)
    marks = tuple((x, y, z) for x, y, z in seen.tolist())
    return Pose(pose.t_s, (x_m, y_m, z_m), yaw_rad, pitch_rad, roll_rad, marks)


def run_laboratory(path: Path) -> list[dict[str, Any]]:
    """Return when a loss was told in each series of a laboratory's repeats."""
    series: dict[str, list[float]] = {}
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            series.setdefault(row["series"], []).append(float(row["displacement_mm"]) / 1000.0)
    found = []
    for name, speeds in series.items():
        looks = ((n, find_loss(np.zeros((n, 3)), speeds[:n])) for n in range(4, len(speeds) + 1))
        told = next(((n, loss) for n, loss in looks if loss is not None and loss.is_told), None)
        found.append({
            "what": "laboratory", "series": name, "trials": len(speeds), "told": told and told[0],
            "factor": told and told[1].factor, "stood": sum(find_standing(speeds)),
        })  # fmt: skip
    return found


def run_standing(cv: float, seed: int) -> dict[str, Any]:
    """Return how many standing trials of 20, and how many moving ones, were taken for standing."""
    random = stream(seed, 0, f"standing {cv}")
    stands = random.random(20) < 0.2
    speeds = np.where(stands, random.uniform(0.05, 0.1, 20), np.abs(random.normal(1.0, cv, 20)))
    called = np.array(find_standing(speeds.tolist()))
    hits, alarms = int(called[stands].sum()), int(called[~stands].sum())
    return {
        "what": "standing", "cv": cv, "stood": int(stands.sum()), "found": hits, "moved": int((~stands).sum()),
        "false": alarms,
    }  # fmt: skip


def _drive_level(twin: str, scatter: str, gaits: list[Gait], repeats: int, seed: int) -> list[float]:
    """Return the true speed of each gait in m/s: on a level floor, from fresh starts, all motors at full strength."""
    preset = TWINS[twin]
    robot = preset.make(seed=seed, scatter=parse_scatter(scatter, preset.frequency_scatter).level())
    speeds = []
    for gait in gaits:
        trials = [run_trial(robot, gait, SETTINGS, number) for number in range(1, repeats + 1)]
        valid = [score(trial) for trial in trials if trial.outcome.is_valid]
        speeds.append(float(np.mean(valid)) if valid else math.nan)
    return speeds


@cache
def known_gaits(twin: str) -> tuple[list[Gait], list[float]]:
    """Return gaits that no run is told of, and their true speeds: what a model's ranking is judged by."""
    high_hz = TWINS[twin].make().range_hz[1]
    random = stream(0, 0, "known gaits")
    gaits = [Gait(tuple(random.uniform(-high_hz, high_hz, 3))) for _ in range(30)]
    return gaits, _drive_level(twin, "careful", gaits, 1, seed=9_999)


class AsTold:
    """``Optimizer``: one that is told scores alone, and so corrects nothing."""

    def __init__(self, inner: Optimizer) -> None:
        self.ask, self.tell, self.recommend = inner.ask, inner.tell, inner.recommend
        self.predict, self.promising, self.improvement = inner.predict, inner.promising, inner.improvement


def _make(space: GaitSpace, method: str, seed: int, corrects: bool) -> Optimizer:
    optimizer = make_optimizer(method, space, seed)
    return optimizer if corrects else AsTold(optimizer)


def _rank(optimizer: Optimizer, twin: str) -> float:
    gaits, true_m_s = known_gaits(twin)
    expected = [estimate.mean for estimate in optimizer.predict(gaits)]
    return float(spearmanr(expected, true_m_s, nan_policy="omit").statistic)


def run_learning(twin: str, scatter: str, method: str, seed: int, corrects: bool) -> dict[str, Any]:
    """Return true speeds in m/s of what a method recommends after 20 and 40 trials under a scatter, and how it ranks.

    ``corrects`` says whether it corrects for the causes of scatter.
    """
    robot = TWINS[twin].make(seed=seed, scatter=scatter)
    high_hz = robot.range_hz[1]
    optimizer = _make(GaitSpace.over(robot.motors.motor_count, -high_hz, high_hz), method, seed, corrects)
    trials, recommended, ranks = list[LoggedTrial](), list[Gait](), list[float]()
    guarded = GuardedRobot(robot, Limits(robot.max_hz))
    for logged in learn(guarded, optimizer, SETTINGS, Budget(40), trials.append):
        if logged.score is not None and sum(it.score is not None for it in trials) in (20, 40):
            recommended.append(optimizer.recommend().gait)
            ranks.append(_rank(optimizer, twin))
    return {
        "what": "learning", "twin": twin, "scatter": scatter, "method": method, "corrects": corrects, "seed": seed,
        "true_m_s": _drive_level(twin, scatter, recommended, 6, seed + 10_000), "rank": ranks,
        "suspects": sum(logged.review.is_suspect for logged in trials), "trials": len(trials),
        "loss": find_loss_in(trials) is not None,
    }  # fmt: skip


def run_gain(twin: str, scatter: str, method: str, seed: int) -> Iterator[dict[str, Any]]:
    """Yield what a method makes of the same 20 trials, not corrected and corrected; the former chose them."""
    robot = TWINS[twin].make(seed=seed, scatter=scatter)
    high_hz = robot.range_hz[1]
    space = GaitSpace.over(robot.motors.motor_count, -high_hz, high_hz)
    optimizer, trials = _make(space, method, seed, corrects=False), list[LoggedTrial]()
    for _ in learn(GuardedRobot(robot, Limits(robot.max_hz)), optimizer, SETTINGS, Budget(20), trials.append):
        pass
    corrected = _make(space, method, seed, corrects=True)
    tell_history(corrected, trials)
    gaits = [optimizer.recommend().gait, corrected.recommend().gait]
    true_m_s = _drive_level(twin, scatter, gaits, 4, seed + 10_000)
    for each, corrects, speed_m_s in zip((optimizer, corrected), (False, True), true_m_s, strict=True):
        yield {
            "what": "gain", "twin": twin, "scatter": scatter, "method": method, "corrects": corrects, "seed": seed,
            "true_m_s": [speed_m_s], "rank": [_rank(each, twin)],
        }  # fmt: skip


def summarise_learning(rows: list[dict[str, Any]]) -> None:
    """Print true speeds and rank correlations of each kind of run, with standard errors."""
    groups: dict[tuple[str, str, str, bool], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["twin"], row["scatter"], row["method"], row["corrects"]), []).append(row)
    for (twin, scatter, method, corrects), of in groups.items():
        speeds_mm_s, ranks = 1000.0 * np.array([row["true_m_s"] for row in of]), np.array([row["rank"] for row in of])
        error = speeds_mm_s.std(axis=0) / math.sqrt(max(1, len(of) - 1))
        told = ", ".join(f"{m:.2f} +- {e:.2f}" for m, e in zip(speeds_mm_s.mean(axis=0), error, strict=True))
        rank = " and ".join(f"{it:.2f}" for it in ranks.mean(axis=0))
        how = "corrected" if corrects else "not corrected"
        print(f"{twin} {scatter} {method}, {how}, {len(of)} runs: {told} mm/s; rank correlation {rank}", flush=True)


def summarise_floor(rows: list[dict[str, Any]], truth: dict[tuple[str, float], float]) -> None:
    """Print a line for each body, incline and number of trials."""
    for body, incline_rad in truth:
        for trials in LOOKS:
            of = [r for r in rows if (r["body"], r["incline_rad"], r["trials"]) == (body, incline_rad, trials)]
            speeds_mm = 5000.0 * np.array([r["speed_m_s"] for r in of])
            off = np.array([r["off_deg"] for r in of])
            true_mm = 5000.0 * truth[body, incline_rad]
            near = np.abs(speeds_mm / true_mm - 1.0) < 0.3 if true_mm else np.zeros(len(of))
            print(
                f"{body:13} {incline_rad:5.3f} rad, {trials:2} trials, {len(of)} runs: drift in 5 s "
                f"{np.median(speeds_mm):5.1f} mm (80 %: {np.quantile(speeds_mm, 0.8):5.1f}; true {true_mm:5.1f}); "
                f"direction off by {np.median(off):5.1f} deg (80 %: {np.quantile(off, 0.8):5.1f}); "
                f"size within 30 % in {near.mean():.0%}; {np.median([r['ms'] for r in of]):.0f} ms"
            )


def main() -> None:
    """Run one part, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", choices=["floor", "strength", "standing", "turning", "laboratory", "learning", "gain"])
    parser.add_argument("--seeds", type=int, nargs=2, default=[1000, 1010], metavar=("FIRST", "END"))
    parser.add_argument("--twin", default="planar", help="of the part learning")
    parser.add_argument("--method", default="plain", help="of the parts learning and gain")
    parser.add_argument("--scatters", nargs="+", default=["careful", "hurried"], help="of the parts learning and gain")
    parser.add_argument("--bodies", nargs="+", default=["prism3", "icosahedron6"])
    parser.add_argument("--inclines", nargs="+", type=float, default=[0.0, 0.02, 0.05])
    parser.add_argument("--csv", type=Path, help="a laboratory's repeats, for the part laboratory")
    parser.add_argument("--out", type=Path, default=Path("causes.jsonl"))
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []

    def keep(row: dict[str, Any]) -> None:
        rows.append(row)
        with arguments.out.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")

    seeds = range(*arguments.seeds)
    if arguments.part == "floor":
        conditions = [(body, incline) for body in arguments.bodies for incline in arguments.inclines]
        truth = {each: measure_true_drift(*each) for each in conditions}
        for seed in seeds:
            for body, incline in conditions:
                for row in run_floor(body, incline, seed):
                    keep(row)
        summarise_floor(rows, truth)
    elif arguments.part == "strength":
        for repeats in (0.4, 0.2, 0.1):
            for halves in (True, False):
                for seed in seeds:
                    keep(run_strength(repeats, halves, seed))
            of = [row for row in rows if row["repeats"] == repeats]
            stepped = [row for row in of if row["step"] is not None]
            delays = [row["told"] - row["step"] if (row["told"] or 0) > row["step"] else math.inf for row in stepped]
            early = [row for row in of if row["told"] and (row["step"] is None or row["told"] <= row["step"])]
            factors = [row["factor"] for row, delay in zip(stepped, delays, strict=True) if delay < math.inf]
            within = np.mean(np.array(delays) <= 10)
            near = np.mean(np.abs(np.array(factors) / 0.5 - 1.0) < 0.2)
            print(
                f"{repeats:.0%} repeats, {len(stepped)} + {len(of) - len(stepped)} runs: told within 10 trials in "
                f"{within:.0%} (median delay {np.median(delays):g}); false alarms in {len(early)} of {len(of)} runs; "
                f"factor within 20 % in {near:.0%}"
            )
    elif arguments.part == "learning":
        for seed in seeds:
            for scatter in arguments.scatters:
                for corrects in (True, False):
                    keep(run_learning(arguments.twin, scatter, arguments.method, seed, corrects))
        summarise_learning(rows)
    elif arguments.part == "gain":
        for seed in seeds:
            for scatter in arguments.scatters:
                for row in run_gain(arguments.twin, scatter, arguments.method, seed):
                    keep(row)
        summarise_learning(rows)
    elif arguments.part == "turning":
        drives = measure_shaking(seeds.start, len(seeds))
        for every, noise_m, markers in ((1, 0.0003, False), (1, 0.0003, True), (1, 0.001, False), (2, 0.0003, False),
                                        (5, 0.0003, False)):  # fmt: skip
            keep(judge_shaking(drives, every, noise_m, markers))
            print(rows[-1], flush=True)
    elif arguments.part == "standing":
        for cv in (0.1, 0.2, 0.3, 0.4):
            of = [run_standing(cv, seed) for seed in seeds]
            found, stood = sum(r["found"] for r in of), sum(r["stood"] for r in of)
            false, moved = sum(r["false"] for r in of), sum(r["moved"] for r in of)
            print(f"CV {cv}: {found} of {stood} standing trials found, {false} of {moved} moving ones taken for it")
    else:
        for row in run_laboratory(arguments.csv):
            print(row)


if __name__ == "__main__":
    main()
