"""Time of one suggestion with three motors, on one core: tell one trial, ask for the next.

python -m benchmarks.suggest --json

It is processor time, so that a busy machine does not disturb it much.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from benchmarks.figures import make_parser, print_figures

if TYPE_CHECKING:
    import numpy as np

    from vvvaltr.controller.core.gaits import GaitSpace
    from vvvaltr.controller.core.protocols import Optimizer
    from vvvaltr.controller.core.records import Evidence

RUNS = 3
TIMED = range(46, 56)
"""Trials of each run after which the suggestion is timed: about the 50th."""
TIMED_METHODS = ("plain", "drive", "efficient", "guarded")


def walk(score: float, rng: np.random.Generator) -> Evidence:
    """Return what a drive of 5 s shows that turns while it walks at a speed: what there is to correct for."""
    from vvvaltr.controller.core.records import Evidence, Piece

    yaw_rad = float(rng.uniform(-math.pi, math.pi))
    headings = [(math.cos(yaw_rad + 0.3 * second), math.sin(yaw_rad + 0.3 * second)) for second in range(5)]
    pieces = tuple(
        Piece(1.0, (score * cos + rng.normal(0.0, 0.1), score * sin + rng.normal(0.0, 0.1)), (cos, sin))
        for cos, sin in headings
    )
    return Evidence((score * math.cos(yaw_rad), score * math.sin(yaw_rad)), None, pieces)


def median_ms(begin: Callable[[int], Optimizer], corrects: bool = False, space: GaitSpace | None = None) -> float:
    """Return the median time of a suggestion in ms.

    Args:
        begin: makes the optimiser of a run from its seed.
        corrects: whether it is told all that a trial shows, and corrects the scores for the causes of their scatter.
        space: gaits that it searches; None for frequencies from 0 to 1.
    """
    import numpy as np

    from benchmarks.surfaces import gait3
    from vvvaltr.controller.core.gaits import GaitSpace
    from vvvaltr.controller.core.protocols import Listening
    from vvvaltr.controller.core.records import Told

    times_ms, space = [], space or GaitSpace.over(3, 0.0, 1.0)
    for seed in range(RUNS):
        optimizer, surface, rng = begin(seed), gait3(seed), np.random.default_rng(seed)
        gait = optimizer.ask().gait
        for trial in range(1, TIMED.stop):
            score = surface.observed(space.to_unit(gait), rng)
            told = Told(gait, score, None, walk(score, rng) if corrects else None)
            start_s = time.thread_time()
            if isinstance(optimizer, Listening):
                optimizer.tell_trial(told)
            else:
                optimizer.tell(gait, score)
            gait = optimizer.ask().gait
            if trial in TIMED:
                times_ms.append(1e3 * (time.thread_time() - start_s))
    return float(np.median(times_ms))


def measure() -> dict[str, float]:
    """Return each method's median in ms, as it is and with the causes of scatter corrected for.

    ``drive`` is timed with motors that turn both ways, ``guarded`` and ``efficient`` with 50 trials of a source.
    """
    import numpy as np

    from benchmarks.surfaces import gait3
    from vvvaltr.controller.core.gaits import GaitSpace
    from vvvaltr.controller.core.values import Source
    from vvvaltr.transfer.methods.registry import METHODS, make_optimizer

    space, surface, rng = GaitSpace.over(3, 0.0, 1.0), gait3(0), np.random.default_rng(0)
    x = rng.random((50, 3))
    source = Source("earlier", tuple(map(space.from_unit, x)), tuple(surface.observed(place, rng) for place in x))
    figures = {}
    for name in TIMED_METHODS:
        space = GaitSpace.over(3, -1.0, 1.0) if name == "drive" else GaitSpace.over(3, 0.0, 1.0)
        begin = partial(make_optimizer, name, space, sources=[source] if METHODS[name].uses_sources else [])
        figures[f"{name}_ms"] = round(median_ms(begin, space=space), 2)
        figures[f"{name}_corrected_ms"] = round(median_ms(begin, corrects=True, space=space), 2)
    return figures


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    arguments = parser.parse_args()
    # Before numpy is imported, which reads this once.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    figures = measure()
    print_figures(figures, arguments.json, width=24)


if __name__ == "__main__":
    main()
