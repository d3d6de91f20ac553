"""Strength: synthetic runs that search and repeat, half of them with a halving, and a laboratory's table of repeats."""

from __future__ import annotations

import csv
import math
from argparse import Namespace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.causes.rows import Row, Rows
from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.streams import stream
from vvvaltr.transfer.causes.standing import find_standing
from vvvaltr.transfer.causes.strength import find_loss


def search(random: np.random.Generator, trials: int, repeats: float, step: int | None) -> tuple[Array, Array]:
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


def watch(repeats: float, halves: bool, seed: int) -> Row:
    """Return when a loss was told in one run of 50 trials."""
    random = stream(seed, int(halves), f"strength {repeats}")
    step = int(random.integers(15, 35)) if halves else None
    places, speeds = search(random, 50, repeats, step)
    for number in range(8, 51):
        loss = find_loss(places[:number], speeds[:number].tolist())
        if loss is not None and loss.is_told:
            return {"step": step, "told": number, "factor": loss.factor}
    return {"step": step, "told": None, "factor": None}


def measure(rows: Rows, arguments: Namespace) -> None:
    """Print how often, how soon and how rightly a loss is told, by the share of repeats."""
    for repeats in (0.4, 0.2, 0.1):
        runs = [
            rows.get({"what": "strength", "repeats": repeats, "halves": halves, "seed": seed},
                     partial(watch, repeats, halves, seed))
            for halves in (True, False) for seed in arguments.seeds
        ]  # fmt: skip
        _tell(repeats, runs)


def _tell(repeats: float, runs: list[Row]) -> None:
    stepped = [run for run in runs if run["step"] is not None]
    early = [run for run in runs if run["told"] and (run["step"] is None or run["told"] <= run["step"])]
    right = [run for run in stepped if run["told"] and run["told"] > run["step"]]
    delays = [run["told"] - run["step"] for run in right] + [math.inf] * (len(stepped) - len(right))
    near = np.mean([abs(run["factor"] / 0.5 - 1.0) < 0.2 for run in right])
    print(
        f"{repeats:.0%} repeats, {len(stepped)} runs with a halving: told within 10 trials in "
        f"{np.mean(np.array(delays) <= 10):.0%} (median {np.median(delays):g}), factor within 20 % in {near:.0%}; "
        f"told falsely in {len(early)} of {len(runs)} runs", flush=True,
    )  # fmt: skip


def measure_laboratory(rows: Rows, arguments: Namespace) -> None:
    """Print when a loss is told in each series of a laboratory's repeats."""
    for name, speeds in read_series(arguments.csv).items():
        row = rows.get({"what": "laboratory", "series": name}, partial(watch_series, speeds))
        print(f"{name}, {len(speeds)} trials: {row}", flush=True)


def read_series(path: Path) -> dict[str, list[float]]:
    """Return the speeds of each series of a table."""
    series: dict[str, list[float]] = {}
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            series.setdefault(row["series"], []).append(float(row["displacement_mm"]) / 1000.0)
    return series


def watch_series(speeds: list[float]) -> Row:
    """Return when a loss was told in repeats of one gait, and how many of them stood still."""
    looks = ((n, find_loss(np.zeros((n, 3)), speeds[:n])) for n in range(4, len(speeds) + 1))
    told = next(((n, loss.factor) for n, loss in looks if loss is not None and loss.is_told), (None, None))
    return {"told": told[0], "factor": told[1], "stood": sum(find_standing(speeds))}
