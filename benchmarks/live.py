"""What a live view costs the loop of a trial at 50 Hz: lateness of the commands with and without it, in turn.

python -m benchmarks.live --json
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from benchmarks.figures import make_parser
from benchmarks.observed import ObservedDevice
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.records import Run
from vvvaltr.controller.core.values import Suggestion, Trial
from vvvaltr.controller.loop.movement import complete_record
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.hardware import HardwareRobot, open_hardware
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.controller.view.recording import LiveView

_GAIT = Gait((9.0, -12.0, 15.0))
_PERIOD_S = 0.02


def drive(robot: Robot, number: int, duration_s: float) -> Trial:
    """Make one trial at 50 Hz."""
    settings = TrialSettings(duration_s=duration_s, period_s=_PERIOD_S, heading_limit_rad=None)
    return run_trial(robot, _GAIT, settings, number)


def measure_lateness_ms(trial: Trial) -> list[float]:
    """Return by how much each command came later after the one before it than the period."""
    times_s = np.array([command.t_s for command in trial.commands])
    return [1000.0 * (gap_s - _PERIOD_S) for gap_s in np.diff(times_s)[:-1].tolist()]


def measure(robot: HardwareRobot, pairs: int, duration_s: float) -> dict[str, float]:
    """Return the lateness with and without a live view, in trials that take turns."""
    late: dict[str, list[float]] = {"plain": [], "live": []}
    with closing(LiveView(Run(robot.structure), "benchmark")) as view:
        watched = view.watch(robot)
        for number in range(1, 2 * pairs + 1):
            is_live = number % 2 == 0
            trial = drive(watched if is_live else robot, number, duration_s)
            if not trial.outcome.is_valid:
                raise RuntimeError(f"trial {number}: {trial.outcome}: {trial.reason}")
            late["live" if is_live else "plain"] += measure_lateness_ms(trial)
            if is_live:
                view.on_trial(complete_record(Suggestion(_GAIT, "benchmark"), trial))
    figures = {f"{name}_{key}_ms": value for name, each in late.items() for key, value in _spread(each).items()}
    figures["live_costs_p99_ms"] = figures["live_p99_ms"] - figures["plain_p99_ms"]
    figures["frames_per_s"] = view.frames / (pairs * duration_s)
    return figures


def _spread(values_ms: Sequence[float]) -> dict[str, float]:
    p50, p99 = np.percentile(values_ms, [50, 99])
    return {"p50": float(p50), "p99": float(p99), "worst": max(values_ms)}


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument("--pairs", type=int, default=10, help="pairs of a trial with and one without the view")
    parser.add_argument("--duration", type=float, default=5.0, help="time of each trial in s")
    arguments = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        ObservedDevice("qik", Path(folder) / "qik") as device,
        closing(open_hardware(load_robot_file(device.robot_file))) as robot,
    ):
        figures = measure(robot, arguments.pairs, arguments.duration)
    for key, figure in figures.items():
        print(f"{key:24} {figure:8.3f}")
    if arguments.json:
        print(json.dumps({key: round(figure, 3) for key, figure in figures.items()}))


if __name__ == "__main__":
    main()
