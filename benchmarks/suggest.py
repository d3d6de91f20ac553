"""How long one suggestion takes with three motors, on one core: tell one trial, ask for the next.

python -m benchmarks.suggest --json
"""

from __future__ import annotations

import argparse
import copy
import json
import os
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from transfer.search import Search

TRIALS = 50
REPEATS = 30


def median_ms(search: Search, seed: int) -> float:
    """Return the median time of the suggestion that follows trial ``TRIALS``, over ``REPEATS`` such trials."""
    import numpy as np

    from benchmarks.surfaces import gait3
    from controller.types import GaitSpace

    surface, space, rng = gait3(seed), GaitSpace.over(3, 0.0, 1.0), np.random.default_rng(seed)
    for _ in range(TRIALS - 1):
        gait = search.ask().gait
        search.tell(gait, surface.observed(space.to_unit(gait), rng))
    times_ms = []
    for _ in range(REPEATS):
        # A search only ever replaces its values, so a shallow copy is as good as running to this trial again.
        once, x = copy.copy(search), rng.random(3)
        score = surface.observed(x, rng)
        start_s = time.perf_counter()
        once.tell(space.from_unit(x), score)
        once.ask()
        times_ms.append(1e3 * (time.perf_counter() - start_s))
    return float(np.median(times_ms))


def measured() -> dict[str, float]:
    """Return the medians of both methods."""
    import numpy as np

    from benchmarks.surfaces import gait3
    from controller.types import GaitSpace, Source
    from transfer.efficient_bo import EfficientBO
    from transfer.plain_bo import PlainBO

    space, surface, rng = GaitSpace.over(3, 0.0, 1.0), gait3(0), np.random.default_rng(0)
    x = rng.random((TRIALS, 3))
    source = Source("earlier", tuple(map(space.from_unit, x)), tuple(surface.observed(place, rng) for place in x))
    return {
        "plain_ms": round(median_ms(PlainBO(space, 0), 0), 2),
        "efficient_ms": round(median_ms(EfficientBO(space, 0, [source]), 0), 2),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    arguments = parser.parse_args()
    # Before numpy is imported, which reads it once.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    figures = measured()
    for name, figure in figures.items():
        print(f"{name:16} {figure:8.2f}")
    if arguments.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
