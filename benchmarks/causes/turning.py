"""A motor that does not turn, from the shaking that a tracker sees: as many drives of the spatial twin as seeds."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.causes.driving import SETTINGS
from benchmarks.causes.rows import Row, Rows
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Pose, Trial
from vvvaltr.controller.loop.trial_runner import run_trial
from vvvaltr.transfer.causes.turning import find_turning
from vvvaltr.twin.presets import TWINS
from vvvaltr.twin.scatter import TrackerNoise, parse_scatter

TRACKERS = ((1, 0.0003, False), (1, 0.0003, True), (1, 0.001, False), (2, 0.0003, False), (5, 0.0003, False))
"""Of 100 poses a second every so many are seen, with so much noise in m, with or without strut ends."""

Drive = tuple[Gait, int | None, Trial]


def drive(seed: int, count: int) -> list[Drive]:
    """Return drives of the spatial twin seen at 100 Hz without noise; one motor stood still in half of them."""
    text = "careful:not_starting=0.5,telling=no"
    robot = TWINS["spatial"].make(seed=seed, scatter=text, noise=TrackerNoise.none())
    scatter, random, found = parse_scatter(text, 0.0), stream(seed, 0, "shaking"), []
    for number in range(1, count + 1):
        gait = Gait(tuple((random.choice([-1.0, 1.0], 3) * random.uniform(8.0, 50.0, 3)).tolist()))
        failure = scatter.draw_failure(stream(seed, number, "failure"), 3)
        found.append((gait, failure and failure[0], run_trial(robot, gait, replace(SETTINGS, period_s=0.01), number)))
    return found


def judge(drives: list[Drive], every: int, noise_m: float, markers: bool) -> Row:
    """Return how many standing and turning motors were told, by a tracker of 100 Hz over ``every`` with noise."""
    random, counts = stream(0, every, f"noise {noise_m}"), Counter[str]()
    for gait, stood, trial in drives:
        if not trial.outcome.is_valid:
            continue
        poses = [blur(pose, noise_m, markers, random) for pose in trial.poses[::every]]
        for motor, turned in enumerate(find_turning(poses, gait.frequency_hz)):
            counts[f"{'standing' if motor == stood else 'turning'} motor: {turned}"] += 1
    return dict(counts)


def blur(pose: Pose, noise_m: float, markers: bool, random: np.random.Generator) -> Pose:
    """Return a pose as a tracker sees it: each coordinate with noise, each angle with 0.002 rad."""
    x_m, y_m, z_m = (np.array(pose.position_m) + random.normal(0.0, noise_m, 3)).tolist()
    angles = np.array([pose.yaw_rad, pose.pitch_rad, pose.roll_rad]) + random.normal(0.0, 0.002, 3)
    yaw_rad, pitch_rad, roll_rad = angles.tolist()
    seen = np.array(pose.markers_m) + random.normal(0.0, noise_m, (len(pose.markers_m), 3)) if markers else np.empty(0)
    marks = tuple((x, y, z) for x, y, z in seen.tolist())
    return Pose(pose.t_s, (x_m, y_m, z_m), yaw_rad, pitch_rad, roll_rad, marks)


def measure(rows: Rows, arguments: Namespace) -> None:
    """Print how many standing and turning motors are told by each tracker."""
    drives = drive(arguments.seeds.start, len(arguments.seeds))
    for every, noise_m, markers in TRACKERS:
        names = {"what": "turning", "rate_hz": 100 / every, "noise_m": noise_m, "markers": markers}
        names |= {"first": arguments.seeds.start, "drives": len(drives)}
        print(rows.get(names, partial(judge, drives, every, noise_m, markers)), flush=True)
