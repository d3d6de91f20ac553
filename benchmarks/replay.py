"""Every method on an emulator of real trials: true value of what it recommends, in % of the best candidate.

python -m benchmarks.replay TABLE.csv ... --json
python -m benchmarks.replay TUESDAY.csv --source MONDAY.csv --methods drive,efficient,guarded

A table has a line of column names and then one line per trial: the motors' speeds in columns RPM_1, RPM_2 and so on,
whose signs are the senses of rotation, and the score in the column Displacement_mm. All tables are pooled. Speeds are
placed in the unit cube over plus and minus the greatest of them.

A trial of the emulator has the score of one of the 4 nearest real trials, drawn at random; the true value of a gait is
the mean of the 12 nearest (6 where there are fewer than 200 trials). The best is sought among 700 candidates: 500
uniform ones, and 200 with one to three motors at full speed. A method that learns from an earlier run is given 40
trials of Plain-BO on the spatial twin, where that has as many motors, or the trials of another table. Everything is
fixed, so that figures of different versions compare. ``benchmarks/replay_twin.csv`` is an example: 100 random gaits of
the planar twin.
"""

from __future__ import annotations

import csv
import json
import sys
from argparse import ArgumentTypeError
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.figures import make_parser
from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.methods.registry import METHODS, make_optimizer

SCORE, SPEED = "Displacement_mm", "RPM_"
DRAWN, AVERAGED, AVERAGED_OF_FEW, FEW = 4, 12, 6, 200
UNIFORM, FULL, CANDIDATE_SEED = 500, 200, 77
CHECKPOINTS = (5, 10, 15, 20)
REPLAYS = 120
SOURCE_TRIALS, TRIAL_S = 40, 20.0


@dataclass(frozen=True, slots=True)
class Emulator:
    """Real trials in place of a robot.

    Args:
        space: gaits to search.
        x: places (n, d) of the real trials in the unit cube.
        scores_mm: their scores (n,).
    """

    space: GaitSpace
    x: Array
    scores_mm: Array

    @classmethod
    def of(cls, tables: Sequence[Path]) -> Emulator:
        """Return the emulator of the trials in all tables. Exits with the reason where one cannot be used."""
        rows = np.vstack([read_table(table) for table in tables])
        speeds, scores_mm = rows[:, :-1], rows[:, -1]
        greatest = float(np.abs(speeds).max())
        space = GaitSpace.over(speeds.shape[1], -greatest / 60.0, greatest / 60.0)
        return cls(space, 0.5 + 0.5 * speeds / greatest, scores_mm)

    def draw_mm(self, x: Array, rng: np.random.Generator) -> float:
        """Return the score of a trial at a place (d,)."""
        return float(self.scores_mm[rng.choice(self._nearest(x[None, :], DRAWN)[0])])

    def true_mm(self, x: Array) -> Array:
        """Return the true values (m,) at places (m, d)."""
        averaged = AVERAGED if len(self.scores_mm) >= FEW else AVERAGED_OF_FEW
        return np.asarray(self.scores_mm[self._nearest(x, averaged)].mean(axis=1))

    def best_mm(self) -> float:
        """Return the greatest true value of all candidates."""
        rng, motors = np.random.default_rng(CANDIDATE_SEED), self.space.dimension
        uniform, full = rng.random((UNIFORM, motors)), rng.random((FULL, motors))
        for place in full:
            chosen = rng.permutation(motors)[: rng.integers(1, min(motors, 3) + 1)]
            place[chosen] = rng.integers(0, 2, len(chosen))
        return float(self.true_mm(np.vstack([uniform, full])).max())

    def _nearest(self, x: Array, count: int) -> np.ndarray:
        distances = ((x[:, None, :] - self.x) ** 2).sum(axis=2)
        return np.argsort(distances, axis=1, kind="stable")[:, :count]


def read_table(path: Path) -> Array:
    """Return the motors' speeds in rpm and, last, the score in mm of every trial, (n, motors + 1)."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            table = csv.DictReader(file)
            columns = [*sorted(name for name in table.fieldnames or () if name.startswith(SPEED)), SCORE]
            rows = np.array([[float(line[column]) for column in columns] for line in table])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SystemExit(f"{path}: {error}: give a table with columns {SPEED}1, {SPEED}2, ... and {SCORE}") from None
    if len(columns) < 2 or len(rows) < AVERAGED_OF_FEW or not np.isfinite(rows).all() or not rows[:, :-1].any():
        raise SystemExit(
            f"{path}: give {AVERAGED_OF_FEW} trials or more, in columns {SPEED}1, {SPEED}2, ... and {SCORE}"
        )
    return rows


def make_source() -> Source:
    """Return trials of Plain-BO on the spatial twin, with speeds up to its highest in both senses, as mm in 20 s."""
    from vvvaltr.transfer.experiments.thesis import list_pairs
    from vvvaltr.transfer.experiments.unit import Settings, Unit, work

    condition = next(pair.target for pair in list_pairs("spatial") if pair.target.name == "rough")
    unit = Unit(condition, "plain", SOURCE_TRIALS, repeat=1, role="source")
    source = work(Settings("spatial", signed=True, seed=CANDIDATE_SEED), unit, None).source("spatial twin", False)
    return Source(source.name, source.gaits, tuple(1e3 * TRIAL_S * score for score in source.scores))


def read_source(table: Path) -> Source:
    """Return the trials of a table as a source. Exits with the reason where it cannot be used."""
    rows = read_table(table)
    return Source(table.stem, tuple(Gait(tuple(row[:-1] / 60.0)) for row in rows), tuple(rows[:, -1].tolist()))


def replay(optimizer: Optimizer, emulator: Emulator, number: int) -> list[float]:
    """Return the true values in mm of what is recommended at the checkpoints."""
    found, rng = [], np.random.default_rng([CANDIDATE_SEED, number])
    for trial in range(1, CHECKPOINTS[-1] + 1):
        gait = optimizer.ask().gait
        optimizer.tell(gait, emulator.draw_mm(emulator.space.to_unit(gait), rng))
        if trial in CHECKPOINTS:
            recommended = emulator.space.to_unit(optimizer.recommend().gait)
            found.append(float(emulator.true_mm(recommended[None, :])[0]))
    return found


def measure(
    emulator: Emulator, methods: Sequence[str], replays: int, source: Path | None = None
) -> tuple[float, dict[str, dict[str, float]]]:
    """Return the best in mm, and for every method the mean true value at each checkpoint in % of it."""
    best_mm, figures, sources = emulator.best_mm(), {}, []
    if any(METHODS[name].uses_sources for name in methods):
        sources = [read_source(source) if source else make_source()]
    for name in methods:
        given = sources if METHODS[name].uses_sources else []
        if given and given[0].gaits[0].motor_count != emulator.space.motor_count:
            print(f"{name:12} is left out: its source, {given[0].name}, has other motors", file=sys.stderr)
            continue
        runs = [replay(make_optimizer(name, emulator.space, r, given), emulator, r) for r in range(replays)]
        percent = 100.0 * np.array(runs) / best_mm
        figures[name] = dict(zip(map(str, CHECKPOINTS), percent.mean(axis=0).round(1).tolist(), strict=True))
        errors = percent.std(axis=0) / np.sqrt(replays)
        cells = (f"{mean:6.1f} +- {error:3.1f}" for mean, error in zip(percent.mean(axis=0), errors, strict=True))
        print(f"{name:12} {'  '.join(cells)}", flush=True)
    return round(best_mm, 1), figures


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument("tables", nargs="+", type=Path, metavar="CSV", help="tables of trials; they are pooled")
    parser.add_argument("--methods", type=_methods, default=tuple(METHODS), help="names, with commas (default all)")
    parser.add_argument("--replays", type=int, default=REPLAYS, help=f"runs of each method (default {REPLAYS})")
    parser.add_argument("--source", type=Path, metavar="CSV", help="trials to learn from first (default the twin's)")
    arguments = parser.parse_args()
    if arguments.replays < 1:
        parser.error(f"--replays is {arguments.replays}: give 1 or more")
    emulator = Emulator.of(arguments.tables)
    print(f"{len(emulator.scores_mm)} trials; % of the best candidate after {CHECKPOINTS} trials, +- standard error")
    best_mm, figures = measure(emulator, arguments.methods, arguments.replays, arguments.source)
    if arguments.json:
        print(json.dumps({"best": best_mm, "methods": figures}))


def _methods(text: str) -> tuple[str, ...]:
    names = tuple(text.split(","))
    for name in names:
        if name not in METHODS:
            raise ArgumentTypeError(f"there is no method {name!r}; choose from {', '.join(METHODS)}")
    return names


if __name__ == "__main__":
    main()
