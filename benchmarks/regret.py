"""Distance of the recommended point from the optimum after 40 trials, in percent of the optimum's value.

python -m benchmarks.regret --json
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.figures import make_parser, print_figures
from benchmarks.surfaces import Surface, gait3, hartmann3, hartmann6
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.transfer.methods.plain_bo import PlainBO

TRIALS = 40
SURFACES: dict[str, Callable[[int], Surface]] = {
    "hartmann3": lambda _: hartmann3(),
    "hartmann6": lambda _: hartmann6(),
    "gait3": gait3,
}


def regret_percent(surface: Surface, seed: int) -> tuple[float, bool]:
    """Return the simple regret of one run in percent, and whether its interval holds the true value."""
    space = GaitSpace.over(surface.dimension, 0.0, 1.0)
    noise = np.random.default_rng([seed, 1])
    optimizer = PlainBO(space, seed)
    for _ in range(TRIALS):
        gait = optimizer.ask().gait
        optimizer.tell(gait, surface.observed(space.to_unit(gait), noise))
    recommended = optimizer.recommend()
    true = float(surface.true(space.to_unit(recommended.gait)[None, :])[0])
    covered = recommended.estimate.low <= true <= recommended.estimate.high
    return 100.0 * (surface.best - true) / surface.best, covered


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="runs of each function (default 20)")
    arguments = parser.parse_args()
    figures: dict[str, float] = {"trials": TRIALS, "seeds": arguments.seeds}
    for name, surface in SURFACES.items():
        runs = [regret_percent(surface(seed), seed) for seed in range(arguments.seeds)]
        regrets = np.array([regret for regret, _ in runs])
        figures[f"{name}_regret_percent"] = round(float(regrets.mean()), 2)
        figures[f"{name}_standard_error"] = round(float(regrets.std(ddof=1) / np.sqrt(len(regrets))), 2)
        figures[f"{name}_interval_coverage_percent"] = round(100.0 * float(np.mean([held for _, held in runs])), 1)
    print_figures(figures, arguments.json)


if __name__ == "__main__":
    main()
