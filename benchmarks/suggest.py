"""Time of one suggestion with three motors, on one core: tell one trial, ask for the next.

python -m benchmarks.suggest --json

It is processor time, so that a busy machine does not disturb it much.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from benchmarks.figures import make_parser, print_figures

if TYPE_CHECKING:
    from vvvaltr.controller.core.protocols import Optimizer

RUNS = 3
TIMED = range(46, 56)
"""Trials of each run after which the suggestion is timed: about the 50th."""


def median_ms(begin: Callable[[int], Optimizer]) -> float:
    """Return the median time of a suggestion in ms; ``begin`` makes the optimiser of a run from its seed."""
    import numpy as np

    from benchmarks.surfaces import gait3
    from vvvaltr.controller.core.values import GaitSpace

    times_ms, space = [], GaitSpace.over(3, 0.0, 1.0)
    for seed in range(RUNS):
        optimizer, surface, rng = begin(seed), gait3(seed), np.random.default_rng(seed)
        gait = optimizer.ask().gait
        for trial in range(1, TIMED.stop):
            score = surface.observed(space.to_unit(gait), rng)
            start_s = time.thread_time()
            optimizer.tell(gait, score)
            gait = optimizer.ask().gait
            if trial in TIMED:
                times_ms.append(1e3 * (time.thread_time() - start_s))
    return float(np.median(times_ms))


def measure() -> dict[str, float]:
    """Return the median of both methods in ms."""
    import numpy as np

    from benchmarks.surfaces import gait3
    from vvvaltr.controller.core.values import GaitSpace, Source
    from vvvaltr.transfer.methods.registry import make_optimizer

    space, surface, rng = GaitSpace.over(3, 0.0, 1.0), gait3(0), np.random.default_rng(0)
    x = rng.random((50, 3))
    source = Source("earlier", tuple(map(space.from_unit, x)), tuple(surface.observed(place, rng) for place in x))
    return {
        "plain_ms": round(median_ms(lambda seed: make_optimizer("plain", space, seed)), 2),
        "efficient_ms": round(median_ms(lambda seed: make_optimizer("efficient", space, seed, [source])), 2),
    }


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    arguments = parser.parse_args()
    # Before numpy is imported, which reads this once.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    figures = measure()
    print_figures(figures, arguments.json, width=16)


if __name__ == "__main__":
    main()
