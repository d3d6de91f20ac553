"""How much faster than real time the twins run: driven gaits on one core, in the steps of 50 ms that a trial takes.

For the spatial twin also what it takes to begin, and what a second thread adds.

python -m benchmarks.twin --json
"""

from __future__ import annotations

import argparse
import json
import time
import timeit
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from twin.engine import Engine

PLANAR_HZ = ((12.0, 14.0, 16.0), (16.0, 9.0, 13.0), (-14.0, 12.0, 15.0))
SPATIAL_HZ = ((25.0, 32.0, 41.0), (45.0, 20.0, 33.0), (-30.0, 38.0, 12.0))
CALL_S, CALLS = 0.05, 100
REPEATS = 10


def times_real_time(engine: Engine, gaits_hz: Sequence[tuple[float, ...]]) -> float:
    """Return simulated over measured seconds.

    Repeats are the same motion bit for bit, so each call counts with the repeat that other programs disturbed least.
    """
    least_s: float = sum(min(times_s) for gait in gaits_hz for times_s in zip(*_repeats(engine, gait), strict=True))
    return len(gaits_hz) * CALLS * CALL_S / least_s


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
        f"planar_{name}_x_real_time": round(times_real_time(PlanarEngine(body(PLANAR_PARTS), PLAIN), PLANAR_HZ), 1)
        for name, body in BODIES.items()
    }


def spatial() -> dict[str, float]:
    """Return the spatial twin's figures, at its own time step of 0.5 ms."""
    from twin.body import BODIES, icosahedron6
    from twin.spatial import SPATIAL_PARTS, TIME_STEP_S, SpatialEngine
    from twin.spatial_model import compiled
    from twin.world import PLAIN, Hills, World

    body, hills = icosahedron6(SPATIAL_PARTS), World(ground=Hills())
    engines = {name: SpatialEngine(make(SPATIAL_PARTS), PLAIN) for name, make in BODIES.items()}
    engines["icosahedron6_on_hills"] = SpatialEngine(body, hills)
    speeds = {
        f"spatial_{name}_x_real_time": round(times_real_time(engine, SPATIAL_HZ), 1) for name, engine in engines.items()
    }
    return (
        speeds
        | _rollouts()
        | {
            "spatial_compile_ms": round(1000.0 * _least_s(lambda: compiled(body, PLAIN, TIME_STEP_S)), 2),
            "spatial_compile_hills_ms": round(1000.0 * _least_s(lambda: compiled(body, hills, TIME_STEP_S)), 2),
            "spatial_reset_ms": round(1000.0 * _least_s(engines["icosahedron6"].reset), 3),
        }
    )


def _least_s(call: Callable[[], object], repeats: int = 100) -> float:
    """Return how long a call takes when other programs disturb it least."""
    return min(timeit.repeat(call, number=1, repeat=repeats))


def _rollouts() -> dict[str, float]:
    """Return how fast ``mujoco.rollout`` is by itself: eight motions of 50 ms, over one thread and over two."""
    import numpy as np
    from mujoco import MjData, mj_stateSize, mjtState
    from mujoco.rollout import Rollout

    from controller.types import Gait
    from twin.body import icosahedron6
    from twin.rotors import Rotors
    from twin.spatial import SPATIAL_PARTS, TIME_STEP_S
    from twin.spatial_model import compiled
    from twin.world import PLAIN

    body, steps, motions = icosahedron6(SPATIAL_PARTS), 100, 8
    model = compiled(body, PLAIN, TIME_STEP_S)
    start = np.zeros(mj_stateSize(model, mjtState.mjSTATE_FULLPHYSICS))
    start[1 : 1 + model.nq] = model.qpos0
    start[3 : 1 + model.nq : 7] += SPATIAL_PARTS.radius_m
    _, forces_n = Rotors(body.motors, TIME_STEP_S).turn(Gait(SPATIAL_HZ[0]), steps)
    controls = np.stack([forces_n.real, forces_n.imag, 0.0 * forces_n.real], axis=2).reshape(1, steps, -1)
    states = np.empty((motions, steps, len(start)))
    one, two = [MjData(model)], [MjData(model), MjData(model)]
    with Rollout(nthread=0) as alone, Rollout(nthread=2) as together:
        settled = alone.rollout(model, one, start, np.zeros((1, 2000, model.nu)))[0][0, -1]
        starts, alike = np.tile(settled, (motions, 1)), np.tile(controls, (motions, 1, 1))
        # By turns, so that both meet the computer in the same mood.
        took_s = [
            _least_s(partial(pool.rollout, model, data, starts, alike, state=states, chunk_size=1), repeats=1)
            for _ in range(400)
            for pool, data in ((alone, one), (together, two))
        ]
    alone_s, together_s = min(took_s[0::2]), min(took_s[1::2])
    return {
        "spatial_rollout_x_real_time": round(motions * steps * TIME_STEP_S / alone_s, 1),
        "spatial_two_threads_over_one": round(alone_s / together_s, 2),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    arguments = parser.parse_args()
    figures = planar() | spatial()
    for name, figure in figures.items():
        print(f"{name:32} {figure:8.1f}")
    if arguments.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
