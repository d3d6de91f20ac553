"""How much repeats of a gait scatter, by how far apart two of its motors turn: ``python -m benchmarks.beating``.

The first of the two motors turns at 85 to 100 % of the greatest frequency, the third at 30 to 70 %; which motors these
are, and in which senses they turn, is drawn for each gait. Figures are the root mean square over the gaits of the
standard deviations of their repeats, in mm/s.
"""

from __future__ import annotations

import numpy as np

from benchmarks.causes.driving import SETTINGS
from benchmarks.figures import make_parser, print_figures
from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import run_trial
from vvvaltr.twin.presets import TWINS

APART = (0.0, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.12)
"""How far apart the two motors turn, in units of the greatest frequency."""


def measure(twin: str, scatter: str, repeats: int, seed: int) -> list[float]:
    """Return the standard deviation in mm/s of the repeats of one gait, at each distance of ``APART``."""
    preset, random = TWINS[twin], stream(seed, 0, "beating")
    robot = preset.make(seed=seed, scatter=scatter)
    motors, first, third = random.permutation(3).tolist(), random.uniform(0.85, 1.0), random.uniform(0.3, 0.7)
    senses = random.choice([-1.0, 1.0], 3) * robot.range_hz[1]
    gaits = [_place(motors, senses * np.array([first, first - apart, third])) for apart in APART]
    scatters = []
    for gait in gaits:
        trials = [run_trial(robot, gait, SETTINGS, number) for number in range(1, repeats + 1)]
        scatters.append(1e3 * float(np.std([score(it) for it in trials if it.outcome.is_valid], ddof=1)))
    return scatters


def _place(motors: list[int], frequencies_hz: Array) -> Gait:
    placed = np.empty(3)
    placed[motors] = frequencies_hz
    return Gait(tuple(placed.tolist()))


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument("--robot", choices=sorted(TWINS), default="planar", help="the twin (default planar)")
    parser.add_argument("--scatter", default="careful", help="what differs from trial to trial (default careful)")
    parser.add_argument("--gaits", type=int, default=14, help="number of gaits (default 14)")
    parser.add_argument("--repeats", type=int, default=10, help="repeats of each gait (default 10)")
    arguments = parser.parse_args()
    runs = [measure(arguments.robot, arguments.scatter, arguments.repeats, seed) for seed in range(arguments.gaits)]
    figures = np.sqrt(np.square(runs).mean(axis=0))
    names = [f"{apart:g} apart, mm/s" for apart in APART]
    print_figures(dict(zip(names, figures.round(2).tolist(), strict=True)), arguments.json)


if __name__ == "__main__":
    main()
