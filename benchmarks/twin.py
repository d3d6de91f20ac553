"""How much faster than real time the twins run on one core: driven gaits, in the steps of 50 ms that a trial takes.

python -m benchmarks.twin --json
"""

from __future__ import annotations

import argparse
import json
import time
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from twin.engine import Engine

GAITS_HZ = ((12.0, 14.0, 16.0), (16.0, 9.0, 13.0), (-14.0, 12.0, 15.0))
CALL_S, CALLS = 0.05, 100
REPEATS = 10


def times_real_time(engine: Engine) -> float:
    """Return simulated over measured seconds.

    Repeats are the same motion bit for bit, so each call counts with the repeat that other programs disturbed least.
    """
    least_s: float = sum(min(times_s) for gait in GAITS_HZ for times_s in zip(*_repeats(engine, gait), strict=True))
    return len(GAITS_HZ) * CALLS * CALL_S / least_s


def _repeats(engine: Engine, frequency_hz: tuple[float, ...]) -> list[list[float]]:
    """Return how long each call took in each repeat."""
    from controller.types import Gait

    gait, repeats = Gait(frequency_hz), []
    for _ in range(REPEATS):
        engine.reset()
        times_s = [time.perf_counter()]
        for _ in range(CALLS):
            engine.step(gait, CALL_S)
            times_s.append(time.perf_counter())
        repeats.append([end_s - begin_s for begin_s, end_s in pairwise(times_s)])
    return repeats


def planar() -> dict[str, float]:
    """Return the planar twin's figures, at its own time steps: 2 ms for three struts, 1 ms for six."""
    from twin.body import BODIES
    from twin.planar import PLANAR_PARTS, PlanarEngine
    from twin.world import PLAIN

    return {
        f"planar_{name}_x_real_time": round(times_real_time(PlanarEngine(body(PLANAR_PARTS), PLAIN)), 1)
        for name, body in BODIES.items()
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    arguments = parser.parse_args()
    figures = planar()
    for name, figure in figures.items():
        print(f"{name:32} {figure:8.1f}")
    if arguments.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
