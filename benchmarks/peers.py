"""Comparison with peers from PyPI: time of a suggestion with 50 + 50 trials, and regret after 40 trials.

python -m benchmarks.peers --json

The peers are installed into an environment of their own below the cache folder. All programs run in one thread, with
the same functions, seeds and noise.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from benchmarks.figures import make_parser, print_figures

if TYPE_CHECKING:
    import numpy as np

    from vvvaltr.controller.core.arrays import Array
    from vvvaltr.controller.core.gaits import GaitSpace

TRIALS = 40
POINTS = 50
TIMINGS = 5
REQUIREMENTS = (("torch==2.13.0",), ("botorch", "scikit-optimize"))
PROBLEMS = ("hartmann3", "hartmann6", "twin_rough", "twin_damaged")
PEERS = ("botorch", "scikit-optimize")


class Problem(Protocol):
    """A function over the unit cube to maximise."""

    @property
    def dimension(self) -> int:
        """Dimension of the cube."""
        ...

    def true(self, x: Array) -> Array:
        """Return the true values (m,) at places (m, d)."""
        ...

    def observed(self, x: Array, rng: np.random.Generator) -> float:
        """Return a noisy value at a place (d,)."""
        ...


class TwinProblem:
    """Speed of the planar twin, in m/s, over its motors' frequencies, with the scatter of its repeats.

    The true speed is the mean of 20 fresh starts.

    Args:
        condition: name of a condition of the experiments.
    """

    def __init__(self, condition: str) -> None:
        from vvvaltr.controller.loop.trial_runner import TrialSettings
        from vvvaltr.transfer.experiments.thesis import list_pairs
        from vvvaltr.transfer.experiments.unit import Settings, open_condition

        target = next(pair.target for pair in list_pairs("planar") if pair.target.name == condition)
        self._robot, self.gaits = open_condition(Settings(), target, seed=0)
        self._settings = TrialSettings()
        self.dimension = self.gaits.dimension

    def observed(self, x: Array, rng: np.random.Generator) -> float:
        """See Problem."""
        return self._speed_m_s(x, int(rng.integers(20, 60)))  # as a trial of a run; the first 20 tell the truth

    def true(self, x: Array) -> Array:
        """See Problem."""
        import numpy as np

        return np.array([np.mean([self._speed_m_s(place, start) for start in range(20)]) for place in x])

    def _speed_m_s(self, x: Array, start: int) -> float:
        from vvvaltr.controller.loop.scoring import score
        from vvvaltr.controller.loop.trial_runner import run_trial

        return score(run_trial(self._robot, self.gaits.from_unit(x), self._settings, start))


class Ours:
    """Our default without a source, behind the peers' interface."""

    def __init__(self) -> None:
        self.gaits: GaitSpace | None = None  # what the problem's cube stands for; None for a function of mere numbers

    def begin(self, dimension: int, seed: int) -> None:
        """Begin a new run."""
        from vvvaltr.controller.core.gaits import GaitSpace
        from vvvaltr.transfer.methods.drive import DriveBO

        self._space = self.gaits or GaitSpace.over(dimension, 0.0, 1.0)
        self._search = DriveBO(self._space, seed, has_drive=self.gaits is not None)

    def ask(self, x: Array, y: Array) -> Array:
        """Return the next place."""
        if len(x):
            self._search.tell(self._space.from_unit(x[-1]), float(y[-1]))
        return self._space.to_unit(self._search.ask().gait)

    def recommend(self, x: Array, y: Array) -> Array:
        """Return the place of the greatest posterior mean."""
        self._search.tell(self._space.from_unit(x[-1]), float(y[-1]))
        return self._space.to_unit(self._search.recommend().gait)


class PeerProcess:
    """A peer in its own environment, behind a pipe."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def begin(self, dimension: int, seed: int) -> None:
        """Begin a new run."""
        self._call({"do": "begin", "dimension": dimension, "seed": seed})

    def ask(self, x: Array, y: Array) -> Array:
        """Return the next place."""
        return self._place({"do": "ask", "x": x.tolist(), "y": y.tolist()})

    def recommend(self, x: Array, y: Array) -> Array:
        """Return the place of the greatest posterior mean."""
        return self._place({"do": "recommend", "x": x.tolist(), "y": y.tolist()})

    def seconds(self, x: Array, y: Array, source: tuple[Array, Array] | None) -> float:
        """Return the processor time of a suggestion in seconds."""
        command: dict[str, Any] = {"do": "ask", "x": x.tolist(), "y": y.tolist()}
        if source is not None:
            command["source"] = {"x": source[0].tolist(), "y": source[1].tolist()}
        return float(self._call(command)["seconds"])

    def _place(self, command: dict[str, Any]) -> Array:
        import numpy as np

        return np.array(self._call(command)["x"])

    def _call(self, command: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps(command) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit("a peer ended; its message is above")
        answer: dict[str, Any] = json.loads(line)
        return answer


@contextmanager
def run_peer(name: str, python: Path) -> Iterator[PeerProcess]:
    """Run a peer until the block is left."""
    script = Path(__file__).with_name("peer_process.py")
    command = [str(python), str(script), name]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield PeerProcess(process)
        finally:
            process.terminate()


def make_environment(folder: Path) -> Path:
    """Return the Python of the peers' environment, and make it where it does not exist yet."""
    python, complete = folder / "bin" / "python", folder / "complete"
    if not complete.exists():
        print(f"installing {', '.join(PEERS)} into {folder}", file=sys.stderr, flush=True)
        venv.create(folder, with_pip=True, clear=True)
        for requirements in REQUIREMENTS:
            subprocess.run([python, "-m", "pip", "install", "-q", *requirements], check=True, stdout=sys.stderr)
        complete.touch()
    return python


def run_program(program: Ours | PeerProcess, problem: Problem, seed: int) -> Array:
    """Return the place (d,) that a program recommends after ``TRIALS`` trials."""
    import numpy as np

    program.begin(problem.dimension, seed)
    x, y = np.empty((0, problem.dimension)), np.empty(0)
    for trial in range(TRIALS):
        place = program.ask(x, y)
        value = problem.observed(place, np.random.default_rng([seed, trial]))
        x, y = np.vstack([x, place]), np.append(y, value)
    return program.recommend(x, y)


def make_problem(name: str) -> Problem:
    """Return the problem called ``name``, one of ``PROBLEMS``."""
    from benchmarks import surfaces

    return TwinProblem(name.removeprefix("twin_")) if name.startswith("twin_") else getattr(surfaces, name)()


def measure_regrets(
    programs: dict[str, Ours | PeerProcess], problems: dict[str, Problem], seeds: Sequence[int]
) -> dict[str, float]:
    """Return mean simple regrets in percent of the best value, with their standard errors.

    The best value of a twin is not known: the greatest true speed of all recommended gaits stands in for it.
    """
    import numpy as np

    figures: dict[str, float] = {}
    for problem_name, problem in problems.items():
        for program in programs.values():
            if isinstance(program, Ours):
                program.gaits = problem.gaits if isinstance(problem, TwinProblem) else None
        true = {name: np.empty(len(seeds)) for name in programs}
        for index, seed in enumerate(seeds):
            for name, program in programs.items():
                true[name][index] = problem.true(run_program(program, problem, seed)[None, :])[0]
            so_far = ", ".join(f"{name} {values[: index + 1].mean():.4g}" for name, values in true.items())
            print(f"{problem_name}, {index + 1} of {len(seeds)} seeds: {so_far}", file=sys.stderr, flush=True)
        best = getattr(problem, "best", max(float(values.max()) for values in true.values()))
        for name, values in true.items():
            percent = 100.0 * (best - values) / best
            key = f"{problem_name}_regret_percent_{name}"
            figures[key] = round(float(percent.mean()), 2)
            if len(seeds) > 1:
                figures[f"{key}_standard_error"] = round(float(percent.std(ddof=1) / np.sqrt(len(seeds))), 2)
    return figures


def measure_times_ms(peers: dict[str, PeerProcess]) -> dict[str, float]:
    """Return the median processor times of a suggestion in ms, with 50 trials of a source and 50 of the target.

    ``botorch`` has a multi-task process; ``botorch_alone`` is lighter and treats all 100 as trials of one task, as
    scikit-optimize does.
    """
    import numpy as np

    from benchmarks.suggest import median_ms
    from benchmarks.surfaces import gait3
    from vvvaltr.controller.core.gaits import GaitSpace
    from vvvaltr.controller.core.values import Source
    from vvvaltr.transfer.methods.registry import METHODS, make_optimizer

    surface, space, rng = gait3(0), GaitSpace.over(3, 0.0, 1.0), np.random.default_rng(0)
    x = rng.random((2 * POINTS, 3))
    y = np.array([surface.observed(place, rng) for place in x])
    source = Source("earlier", tuple(map(space.from_unit, x[:POINTS])), tuple(y[:POINTS].tolist()))
    figures = {}
    for name in (name for name, method in METHODS.items() if method.uses_sources):
        figures[f"{name}_ms"] = median_ms(partial(make_optimizer, name, space, sources=[source]))
    first, own = (x[:POINTS], y[:POINTS]), (x[POINTS:], y[POINTS:])
    for name, process in peers.items():
        process.begin(3, 0)
        figures[f"{name}_ms"] = 1e3 * float(np.median([process.seconds(*own, first) for _ in range(TIMINGS)]))
    peers["botorch"].begin(3, 0)
    alone = [peers["botorch"].seconds(x, y, None) for _ in range(TIMINGS)]
    figures["botorch_alone_ms"] = 1e3 * float(np.median(alone))
    return {name: round(figure, 2) for name, figure in figures.items()}


def compare_times(figures: dict[str, float]) -> dict[str, float]:
    """Return the peers' times of a suggestion as multiples of the default transfer method's."""
    ours = figures.get("guarded_ms", figures["efficient_ms"])
    return {
        "botorch_over_ours": round(min(figures["botorch_ms"], figures["botorch_alone_ms"]) / ours, 1),
        "scikit_optimize_over_ours": round(figures["scikit-optimize_ms"] / ours, 1),
    }


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="runs of each function (default 20)")
    parser.add_argument(
        "--problems", nargs="*", choices=PROBLEMS, default=PROBLEMS, help="functions to maximise (default all)"
    )
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    parser.add_argument(
        "--cache", type=Path, default=cache / "vvvaltr" / "peers", help="folder of the peers' environment"
    )
    arguments = parser.parse_args()
    # Before numpy is imported, here and in the peers, which read these once.
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")
    python = make_environment(arguments.cache)
    with run_peer("botorch", python) as botorch, run_peer("scikit-optimize", python) as skopt:
        peers = {"botorch": botorch, "scikit-optimize": skopt}
        figures = measure_times_ms(peers)
        chosen = {name: make_problem(name) for name in arguments.problems}
        figures |= compare_times(figures) | measure_regrets(
            {"ours": Ours(), "botorch": botorch}, chosen, range(arguments.seeds)
        )
    print_figures({"seeds": arguments.seeds, "trials": TRIALS, **figures}, arguments.json, width=55)


if __name__ == "__main__":
    main()
