"""Long runs and large sources: processor time on one core, and memory.

python -m benchmarks.scale --json

It is processor time, so that a busy machine does not disturb it much. The run on disk is one of a planar twin, 10 s a
trial; making it takes some minutes.
"""

from __future__ import annotations

import os
import random
import resource
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

from benchmarks.figures import make_parser, print_figures

if TYPE_CHECKING:
    from vvvaltr.controller.core.gaits import GaitSpace
    from vvvaltr.controller.core.protocols import Optimizer
    from vvvaltr.controller.core.values import Source, Trial

COUNTED = (50, 200, 500, 1000)
"""Numbers of trials told; a figure is the mean over the last tenth of them, so that new fits are counted."""


def time_trials(optimizer: Optimizer, space: GaitSpace, most: int, corrects: bool = False) -> list[float]:
    """Return what each of ``most`` trials costs in ms: ask, tell and recommend.

    With ``corrects``, the optimiser is told all that a trial shows, and corrects the scores for the causes of their
    scatter.
    """
    import numpy as np

    from benchmarks.suggest import walk
    from benchmarks.surfaces import gait3
    from vvvaltr.controller.core.protocols import Listening
    from vvvaltr.controller.core.records import Told

    assert isinstance(optimizer, Listening)
    surface, rng, times_ms = gait3(0), np.random.default_rng(0), []
    for _ in range(most):
        begin_s = time.process_time()
        gait = optimizer.ask().gait
        asked_s = time.process_time() - begin_s
        score = surface.observed(space.to_unit(gait), rng)
        told = Told(gait, score, None, walk(score, rng) if corrects else None)
        begin_s = time.process_time()
        optimizer.tell_trial(told)
        optimizer.recommend()
        times_ms.append(1e3 * (asked_s + time.process_time() - begin_s))
    return times_ms


def make_source(space: GaitSpace, rows: int) -> Source:
    """Return a source of so many random gaits."""
    import numpy as np

    from benchmarks.surfaces import gait3
    from vvvaltr.controller.core.values import Source

    rng, surface = np.random.default_rng(1), gait3(1)
    x = rng.random((rows, 3))
    return Source("earlier", tuple(map(space.from_unit, x)), tuple(surface.observed(place, rng) for place in x))


def measure_learning() -> dict[str, float]:
    """Return the cost of a trial late in a run, and beside a large source."""
    from vvvaltr.controller.core.gaits import GaitSpace
    from vvvaltr.transfer.methods.registry import make_optimizer

    space, figures = GaitSpace.over(3, 0.0, 1.0), {}
    for method in ("plain", "drive"):
        times_ms = time_trials(make_optimizer(method, space, 0), space, max(COUNTED), corrects=method == "drive")
        for count in COUNTED:
            figures[f"{method}_{count}_ms"] = _mean(times_ms[count - count // 10 : count])
    alone_ms = _mean(time_trials(make_optimizer("plain", space, 0), space, 30))
    for rows in (2000, 20_000):
        begin_s = time.process_time()
        optimizer = make_optimizer("guarded", space, 0, [make_source(space, rows)])
        figures[f"source_{rows}_begin_s"] = time.process_time() - begin_s
        figures[f"source_{rows}_more_ms"] = _mean(time_trials(optimizer, space, 30)) - alone_ms
    return figures


def measure_import(folder: Path, rows: int = 100_000) -> dict[str, float]:
    """Return how long the import of a table of so many rows takes."""
    from vvvaltr.controller.cli.main import main

    table, draw = folder / "table.csv", random.Random(0)
    lines = (f"{draw.randint(-900, 900)},{draw.randint(-900, 900)},{100 * draw.random():.1f}" for _ in range(rows))
    table.write_text("RPM_1,RPM_2,mm\n" + "\n".join(lines) + "\n")
    how = [
        "--gait",
        "RPM_1,RPM_2",
        "--unit",
        "rpm",
        "--score",
        "mm",
        "--score-unit",
        "mm",
        "--duration",
        "20",
        "--zero",
        "keep",
    ]
    seconds = _time(lambda: main(["import", str(table), *how, "--out", str(folder / "imported")]))
    return {"import_100000_s": seconds}


def measure_run(folder: Path, trials: int = 1000) -> dict[str, float]:
    """Return what a long run on a twin costs: memory on the way, resuming, viewing."""
    from vvvaltr.controller.core.disk import write_whole
    from vvvaltr.controller.runs.run import RunDirectory
    from vvvaltr.controller.view.showing import save_run

    asked = {"trials": trials, "duration_s": 10.0}
    memory_mb, path = {}, folder / "run"
    run = RunDirectory.create(path, asked)
    loop_ms: list[float] = []
    with _timed_trials() as take_s:
        before_s = time.process_time()
        for logged in run.learn():
            loop_ms.append(1e3 * (time.process_time() - before_s - take_s()))
            if logged.trial.number in (trials // 10, trials):
                memory_mb[logged.trial.number] = _memory_mb()
            if logged.trial.number == trials // 2:
                write_whole(folder / "half.mcap", (path / "trials.mcap").read_bytes())
            before_s = time.process_time()
    run.close()
    first, last = memory_mb[trials // 10], memory_mb[trials]
    figures = {"memory_mb": first, "memory_bytes_a_trial": 1e6 * (last - first) / (trials - trials // 10)}
    figures |= {f"loop_{count}_ms": _mean(loop_ms[count - count // 10 : count]) for count in COUNTED if count <= trials}
    figures["resume_1000_s"] = _time(lambda: _resume(path, trials))
    (path / "trials.mcap").write_bytes((folder / "half.mcap").read_bytes())
    figures["view_500_s"] = _time(lambda: save_run(path, folder / "run.rrd"))
    return figures


@contextmanager
def _timed_trials() -> Iterator[Callable[[], float]]:
    """Yield what returns the processor time of the trials since it was asked last, in s: what is left is the loop's."""
    from vvvaltr.controller.loop.trial_runner import run_trial

    sums_s = [0.0]

    def timed(*arguments: Any) -> Trial:
        sums_s.append(_time(lambda: made.append(run_trial(*arguments))))
        return made.pop()

    def take() -> float:
        taken_s = sum(sums_s)
        sums_s.clear()
        return taken_s

    made: list[Trial] = []
    with patch("vvvaltr.controller.loop.learn.run_trial", timed):
        yield take


def _resume(path: Path, trials: int) -> None:
    """Open a run of so many trials and make one more."""
    from vvvaltr.controller.runs.run import RunDirectory

    run = RunDirectory.resume(path, {"trials": trials + 1})
    next(iter(run.learn()))
    run.close()


def _memory_mb() -> float:
    """Return the memory of this process that is in use now, in MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def _time(act: Callable[[], object]) -> float:
    """Return the processor time of an act in s."""
    begin_s = time.process_time()
    act()
    return time.process_time() - begin_s


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    arguments = parser.parse_args()
    # Before numpy is imported, which reads this once.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with tempfile.TemporaryDirectory(prefix="vvvaltr-") as name:
        figures = {**measure_learning(), **measure_import(Path(name)), **measure_run(Path(name))}
    print_figures(figures, arguments.json, width=30)


if __name__ == "__main__":
    main()
