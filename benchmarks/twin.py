"""Speed of the twins as a multiple of real time: gaits on one core, in the steps of 50 ms that a trial makes.

For the spatial twin also the time to start, and the gain of a second thread.

python -m benchmarks.twin --json
"""

from __future__ import annotations

import time
import timeit
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from benchmarks.figures import make_parser, print_figures

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vvvaltr.twin.engine import Engine

PLANAR_HZ = ((12.0, 14.0, 16.0), (16.0, 9.0, 13.0), (-14.0, 12.0, 15.0))
SPATIAL_HZ = ((25.0, 32.0, 41.0), (45.0, 20.0, 33.0), (-30.0, 38.0, 12.0))
CALL_S, CALLS = 0.05, 100
"""Simulated time of each call, and number of calls."""

REPEATS = 10
"""Repeats of each gait; the fastest counts."""


def times_real_time(engine: Engine, gaits_hz: Sequence[tuple[float, ...]]) -> float:
    """Return simulated seconds per measured second.

    Repeats are the same motion bit for bit, so each call counts with its fastest repeat, the one least disturbed.
    """
    least_s: float = sum(min(times_s) for gait in gaits_hz for times_s in zip(*_repeats(engine, gait), strict=True))
    return len(gaits_hz) * CALLS * CALL_S / least_s


def _repeats(engine: Engine, frequency_hz: tuple[float, ...]) -> list[list[float]]:
    """Return the time of each call in each repeat, in seconds."""
    from vvvaltr.controller.core.gaits import Gait

    gait, repeats = Gait(frequency_hz), []
    for _ in range(REPEATS):
        engine.reset()
        times_s = [time.perf_counter()]
        for _ in range(CALLS):
            engine.step(gait, CALL_S)
            times_s.append(time.perf_counter())
        repeats.append([end_s - begin_s for begin_s, end_s in pairwise(times_s)])
    return repeats


def measure_planar() -> dict[str, float]:
    """Return the planar twin's figures, at its own time steps: 2 ms for three struts, 1 ms for six."""
    from vvvaltr.twin.bodies import BODIES
    from vvvaltr.twin.planar.engine import PlanarEngine
    from vvvaltr.twin.presets import PLANAR_PARTS
    from vvvaltr.twin.world import PLAIN

    return {
        f"planar_{name}_x_real_time": round(times_real_time(PlanarEngine(body(PLANAR_PARTS), PLAIN), PLANAR_HZ), 1)
        for name, body in BODIES.items()
    }


def measure_spatial() -> dict[str, float]:
    """Return the spatial twin's figures, at its own time step of 0.5 ms."""
    from vvvaltr.twin.bodies import BODIES, icosahedron6
    from vvvaltr.twin.presets import SPATIAL_PARTS
    from vvvaltr.twin.spatial.engine import TIME_STEP_S, SpatialEngine
    from vvvaltr.twin.spatial.model import compile_model
    from vvvaltr.twin.world import PLAIN, Hills, World

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
            "spatial_compile_ms": round(1000.0 * _least_s(lambda: compile_model(body, PLAIN, TIME_STEP_S)), 2),
            "spatial_compile_hills_ms": round(1000.0 * _least_s(lambda: compile_model(body, hills, TIME_STEP_S)), 2),
            "spatial_reset_ms": round(1000.0 * _least_s(engines["icosahedron6"].reset), 3),
        }
    )


def _rollouts() -> dict[str, float]:
    """Return the speed of ``mujoco.rollout`` by itself, and the gain of a second thread.

    On a busy computer the second thread finds no free processor. Its cost then shows in the processor time of both
    threads together, divided by that of one alone: at 1 it costs nothing.
    """
    from mujoco import MjData
    from mujoco.rollout import Rollout

    model, starts, controls = _driven_motions()
    one, two = [MjData(model)], [MjData(model), MjData(model)]
    with Rollout(nthread=0) as alone, Rollout(nthread=2) as together:
        calls = (
            lambda: alone.rollout(model, one, starts, controls, chunk_size=1),
            lambda: together.rollout(model, two, starts, controls, chunk_size=1),
        )
        one_s, two_s = _least_by_turns_s(calls)
        one_busy_s, two_busy_s = _least_by_turns_s(calls, time.process_time)
    return {
        "spatial_rollout_x_real_time": round(len(starts) * controls.shape[1] * model.opt.timestep / one_s, 1),
        "spatial_two_threads_over_one": round(one_s / two_s, 2),
        "spatial_two_threads_processor_time": round(two_busy_s / one_busy_s, 2),
    }


def _driven_motions() -> tuple[Any, NDArray[np.float64], NDArray[np.float64]]:
    """Return a model, the states in which eight motions start, and the controls of 50 ms with the motors at speed."""
    import numpy as np
    from mujoco import MjData, mj_stateSize, mjtState
    from mujoco.rollout import rollout

    from vvvaltr.controller.core.gaits import Gait
    from vvvaltr.twin.bodies import icosahedron6
    from vvvaltr.twin.presets import SPATIAL_PARTS
    from vvvaltr.twin.rotors import Rotors
    from vvvaltr.twin.spatial.engine import TIME_STEP_S
    from vvvaltr.twin.spatial.model import compile_model
    from vvvaltr.twin.world import PLAIN

    body, gait = icosahedron6(SPATIAL_PARTS), Gait(SPATIAL_HZ[0])
    model = compile_model(body, PLAIN, TIME_STEP_S)
    start = np.zeros(mj_stateSize(model, mjtState.mjSTATE_FULLPHYSICS))
    start[1 : 1 + model.nq] = model.qpos0
    start[3 : 1 + model.nq : 7] += SPATIAL_PARTS.radius_m
    _, forces_n = Rotors(body.motors, TIME_STEP_S).spin(gait, 1000)
    controls = np.stack([forces_n.real, forces_n.imag, 0.0 * forces_n.real], axis=2).reshape(1, 1000, -1)
    states, _ = rollout(model, MjData(model), start, controls[:, :900])
    return model, np.tile(states[0, -1], (8, 1)), np.tile(controls[:, 900:], (8, 1, 1))


def _least_s(call: Callable[[], object]) -> float:
    """Return the time of a call in seconds, when other programs disturb it least."""
    return _least_by_turns_s([call])[0]


def _least_by_turns_s(
    calls: Sequence[Callable[[], object]], timer: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Return the same for several calls, made in turns so that all meet the same disturbances."""
    took_s = [[timeit.timeit(call, timer=timer, number=1) for call in calls] for _ in range(200)]
    return [min(of_call_s) for of_call_s in zip(*took_s, strict=True)]


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    arguments = parser.parse_args()
    figures = measure_planar() | measure_spatial()
    print_figures(figures, arguments.json)


if __name__ == "__main__":
    main()
