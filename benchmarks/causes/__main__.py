"""Whether the causes of scatter are found in a run's own trials, and what it is worth: ``python -m benchmarks.causes``.

    python -m benchmarks.causes floor --seeds 1000 1020 --out floor.jsonl

Each part is a module beside this one, which says how it measures. A finished run is a line in the file of ``--out``,
and what the file has is not measured again.
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.causes import floor, gain, standing, strength, turning
from benchmarks.causes.rows import Rows
from benchmarks.figures import make_parser

PARTS = {
    "floor": floor.measure,
    "strength": strength.measure,
    "laboratory": strength.measure_laboratory,
    "standing": standing.measure,
    "turning": turning.measure,
    "gain": gain.measure_gain,
    "learning": gain.measure_learning,
}


def main() -> None:
    """Measure one part, and print what was found."""
    parser = make_parser(__doc__)
    parser.add_argument("part", choices=PARTS, help="what to measure")
    parser.add_argument(
        "--seeds",
        type=int,
        nargs=2,
        default=[1000, 1010],
        metavar=("FIRST", "END"),
        help="seeds of the runs; END is not one of them",
    )
    parser.add_argument("--twin", default="spatial", help="twin of gain and learning")
    parser.add_argument("--method", default="drive", help="method of gain and learning")
    parser.add_argument("--scatters", nargs="+", default=["careful", "hurried"], help="scatters of gain and learning")
    parser.add_argument(
        "--looks", nargs="+", type=int, default=[20, 40], help="trials after which gain and learning look"
    )
    parser.add_argument("--bodies", nargs="+", default=["prism3", "icosahedron6"], help="bodies of floor")
    parser.add_argument("--inclines", nargs="+", type=float, default=[0.0, 0.02, 0.05], help="inclines of floor in rad")
    parser.add_argument("--csv", type=Path, help="table of laboratory, with the columns series and displacement_mm")
    parser.add_argument("--out", type=Path, default=Path("causes.jsonl"), help="file of the finished runs")
    arguments = parser.parse_args()
    if arguments.part == "laboratory" and arguments.csv is None:
        parser.error("the part laboratory reads a table of repeats: give --csv FILE")
    arguments.seeds = range(*arguments.seeds)
    PARTS[arguments.part](Rows(arguments.out), arguments)


if __name__ == "__main__":
    main()
