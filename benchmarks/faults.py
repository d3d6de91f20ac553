"""Random faults in the middle of learning: no motor may stay on, and no spoilt trial may be learned from.

A trial is spoilt if a motor was off for a while, or if its score is not the distance that the twin of the mock went.
Faults are those of devices and lines, and of what the tracker shows.

python -m benchmarks.faults --json
"""

from __future__ import annotations

import json
import math
import random
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Collection, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from functools import partial
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path

from benchmarks.figures import make_parser
from benchmarks.observed import Change, ObservedDevice
from vvvaltr.controller.core.errors import DeviceError, TrackingLost, UserError
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Vector
from vvvaltr.controller.loop.trial_runner import TrialCrashed
from vvvaltr.controller.robot.mock import DEVICES
from vvvaltr.controller.runs.run import RunDirectory
from vvvaltr.drivers.mocking.faults import POSE_KINDS, RADIO_KINDS, Fault, Kind

_DURATION_S = 0.7
_FAULTS_PER_RUN = 20
_REST_S = 1.0
_ATTEMPTS = 40  # to continue after a fault: the longest spoils 30 replies, and an attempt may ask for just one
_GREATEST_ERROR_M = 0.005  # several times what the noise of tracker and coming to rest make
_RAMP_S, _END_S = 0.35, 0.1  # beginning and end of a trial, in which motors may be off


def draw_fault(dice: random.Random, device: str, among: Collection[Kind] = tuple(Kind)) -> Fault:
    """Return a fault that begins at once. A qik gets no stalled motor, because it cannot notice one."""
    impossible = {"qik": {Kind.STALL} | RADIO_KINDS, "struts": set()}.get(device, RADIO_KINDS)
    kinds = [kind for kind in Kind if kind in among and kind not in impossible]
    return Fault(
        kind=dice.choice(kinds),
        at_s=0.0,
        duration_s=dice.uniform(0.05, 1.2),
        replies=dice.choice((1, 1, 2, 5, 30)),
        delay_s=dice.uniform(0.01, 0.5),
        motor=dice.randint(1, 3),
        size_m=dice.choice((0.1, 0.5, 100.0)),
        step_s=dice.choice((-3600.0, -0.5, -0.19, -0.16, -0.05, 0.19, 3600.0)),
    )


def measure_error_m(logged: LoggedTrial, from_m: Vector, to_m: Vector) -> float:
    """Return by how much the distance that a trial measured differs from the one that its robot went."""
    if logged.score is None:
        return 0.0
    return abs(logged.score * logged.trial.duration_s - math.dist(from_m[:2], to_m[:2]))


def measure_off_s(changes: Sequence[Change], duration_s: float) -> float:
    """Return how long, in seconds, a motor was off within a trial that has just ended, except in its ramp and end."""
    ends_s = [change.t_s for change in changes if change.are_all_off]
    if not ends_s:
        return duration_s
    begin_s, end_s = ends_s[-1] - duration_s + _RAMP_S, ends_s[-1] - _END_S
    before = Change(-math.inf, are_all_on=False, are_all_off=True)
    off = [
        (max(begin_s, since.t_s), min(end_s, until.t_s))
        for since, until in pairwise([before, *changes])
        if not since.are_all_on
    ]
    return sum(max(0.0, until_s - since_s) for since_s, until_s in off)


def count_events(device: str, faults: int, seed: int, kinds: Collection[Kind] = tuple(Kind)) -> Counter[str]:
    """Learn on one device while faults of these kinds happen, and count what happened, by name."""
    dice, counts = random.Random(f"{device} {seed}"), Counter[str]()
    with tempfile.TemporaryDirectory() as directory, ObservedDevice(device, Path(directory, "port")) as observed:
        file = observed.robot_file
        file.write_text(file.read_text(encoding="utf-8").replace("settle_s = 0.3", "settle_s = 0.1"), encoding="utf-8")
        for number in range(faults):
            path = Path(directory, f"run{number // _FAULTS_PER_RUN}")
            fault = draw_fault(dice, device, kinds)
            timer = threading.Timer(dice.uniform(0.2, 1.6), observed.inject, (fault,))
            timer.start()
            spoilt = counts["spoilt_trials_learned_from"]
            counts[f"fault_{fault.kind}"] += 1
            counts += _learn(path, observed, number % _FAULTS_PER_RUN + 2)
            timer.join()
            if counts["spoilt_trials_learned_from"] > spoilt:
                print(f"{device}: spoilt by {fault}", flush=True)
            counts["motors_left_running"] += not _wait_for_rest(observed)
    return counts


def _wait_for_rest(observed: ObservedDevice) -> bool:
    """Wait until all motors are off, and return whether they are."""
    try:
        observed.rested_s(_REST_S)
    except TimeoutError:
        return False
    return True


def _learn(path: Path, observed: ObservedDevice, trials: int) -> Counter[str]:
    """Learn until a run has ``trials`` valid trials, resuming it whenever it ends before."""
    counts: Counter[str] = Counter()
    for _ in range(_ATTEMPTS):
        try:
            asked = {"trials": trials, "duration_s": _DURATION_S, "robot": {"name": str(observed.robot_file)}}
            run = RunDirectory.resume(path, {"trials": trials}) if path.exists() else RunDirectory.create(path, asked)
        except (DeviceError, TrackingLost):
            counts["opening_failed"] += 1  # the fault is still there; an operator would try again
            time.sleep(0.2)
            continue
        with closing(run):
            counts += _watch(run, observed)
        if sum(logged.score is not None for logged in run.trials) >= trials:
            return counts
        counts["resumed"] += 1
    counts["not_resumable"] += 1
    return counts


def _watch(run: RunDirectory, observed: ObservedDevice) -> Counter[str]:
    counts: Counter[str] = Counter()
    before = observed.note()
    try:
        for logged in run.learn():
            counts[f"trials_{logged.trial.outcome}"] += 1
            if logged.score is None:  # a watchdog may stop it later; the next trial begins there
                _wait_for_rest(observed)
            note = observed.note()
            off_s = measure_off_s(note.changes, logged.trial.duration_s)
            error_m = measure_error_m(logged, before.place_m, note.place_m)
            before = note
            if logged.score is not None and (off_s > 0.1 or error_m > _GREATEST_ERROR_M):
                counts["spoilt_trials_learned_from"] += 1
                wrong = f"off for {off_s:.2f} s, wrong by {1000.0 * error_m:.1f} mm"
                print(f"spoilt: {run.config.robot.name} trial {logged.trial.number}: {wrong}", flush=True)
    except UserError:
        counts["gave_up"] += 1  # after several failures in a row, so that somebody looks at the robot
    except TrialCrashed:
        counts["crashed"] += 1
    return counts


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument("--faults", type=int, default=1000, help="number of faults over all devices (default 1000)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the faults (default 0)")
    parser.add_argument("--poses", action="store_true", help="faults of poses alone")
    arguments = parser.parse_args()
    kinds = POSE_KINDS if arguments.poses else tuple(Kind)
    share = -(-arguments.faults // len(DEVICES))
    with ProcessPoolExecutor(len(DEVICES), mp_context=get_context("spawn")) as pool:
        counts = list(pool.map(partial(count_events, faults=share, seed=arguments.seed, kinds=kinds), DEVICES))
    bad = ("motors_left_running", "spoilt_trials_learned_from", "not_resumable", "crashed")
    figures = {"faults": share * len(DEVICES), **{name: sum(count[name] for count in counts) for name in bad}}
    for device, count in zip(DEVICES, counts, strict=True):
        print(device, dict(sorted(count.items())))
    print(figures)
    if arguments.json:
        print(json.dumps({**figures, **{device: count for device, count in zip(DEVICES, counts, strict=True)}}))


if __name__ == "__main__":
    main()
