"""How repeats of one gait scatter on the twins, and in a laboratory's table: ``python -m benchmarks.repeats``.

Per series of repeats: coefficient of variation, short-term coefficient of variation sqrt(mean(d^2) / 2) / mean of
neighbours' differences d, correlation of neighbours, and the share of trials below a quarter of the series' median.
A table of a laboratory (``--csv``) has the columns series, protocol, and displacement_mm.
"""

from __future__ import annotations

import csv
import json
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.figures import make_parser
from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.twin.presets import TWINS
from vvvaltr.twin.scatter import Scatter

SETTINGS = TrialSettings(duration_s=5.0, period_s=0.1)
LIVE_M_S = 0.002
KEYS = ("cv", "short_term_cv", "lag_1", "standing")


def describe(values: Array) -> tuple[float, ...]:
    """Return the four numbers of a series, in the order of ``KEYS``."""
    mean, d = values.mean(), np.diff(values)
    centred = values - mean
    lag = float((centred[1:] * centred[:-1]).sum() / max((centred**2).sum(), 1e-30))
    short = np.sqrt((d**2).mean() / 2.0) / mean
    return float(values.std(ddof=1) / mean), float(short), lag, float((values < 0.25 * np.median(values)).mean())


def measure_series(twin: str, scatter: str, repeats: int, seed: int) -> tuple[float, ...] | None:
    """Return the numbers of one random gait's repeats; None for a gait that does not move."""
    random = stream(seed, 0, "repeats")
    still = TWINS[twin].make(seed=seed, scatter=Scatter.none())
    high_hz = still.range_hz[1]
    gait = Gait(tuple(random.uniform(-high_hz, high_hz, still.motors.motor_count)))
    first = run_trial(still, gait, SETTINGS)
    if not first.outcome.is_valid or score(first) < LIVE_M_S:
        return None
    robot = TWINS[twin].make(seed=seed, scatter=scatter)
    trials = [run_trial(robot, gait, SETTINGS, number) for number in range(1, repeats + 1)]
    return describe(np.array([score(trial) for trial in trials if trial.outcome.is_valid]))


def read_table(path: Path) -> dict[str, tuple[float, ...]]:
    """Return the numbers of each series of a laboratory's table."""
    series: dict[str, list[float]] = {}
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            series.setdefault(f"{row['series']} ({row['protocol']})", []).append(float(row["displacement_mm"]))
    return {name: describe(np.array(values)) for name, values in series.items()}


def main() -> None:
    """Measure, and print a line a series or setting."""
    parser = make_parser(__doc__)
    parser.add_argument("--twins", nargs="+", default=["planar", "spatial"], help="twins to measure")
    parser.add_argument(
        "--scatters", nargs="*", default=["careful", "hurried"], help="what differs from trial to trial"
    )
    parser.add_argument("--gaits", type=int, default=20, help="number of gaits")
    parser.add_argument("--repeats", type=int, default=30, help="repeats of each gait")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first gait; each has its own")
    parser.add_argument("--jobs", type=int, default=1, help="number of processes")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="table of a laboratory, to measure as well")
    arguments = parser.parse_args()
    found = read_table(arguments.csv) if arguments.csv else {}
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.gaits)
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for twin in arguments.twins:
            for scatter in arguments.scatters:
                task = partial(measure_series, twin, scatter, arguments.repeats)
                table = np.array([it for it in pool.map(task, seeds) if it is not None])
                low, middle, high = np.quantile(table, [0.1, 0.5, 0.9], axis=0)
                means = (*middle[:3].tolist(), float(table[:, 3].mean()))
                found[f"{twin} {scatter}, {len(table)} live gaits"] = means
                spread = ", ".join(f"{a:.2f} to {b:.2f}" for a, b in zip(low[:3], high[:3], strict=True))
                print(f"{twin} {scatter}: 80 % of gaits: {spread}", flush=True)
    print(json.dumps({name: dict(zip(KEYS, row, strict=True)) for name, row in found.items()}, indent=None))
    for name, row in found.items():
        print(f"{name:60} " + " ".join(f"{value:6.2f}" for value in row))


if __name__ == "__main__":
    main()
