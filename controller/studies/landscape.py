"""Speed over two motors with the third off: one panel for each motor that is off.

After section 8.1 of "Transfer Learning for Faster Discovery of Tensegrity Robot Gaits", Union College, 2018.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.choice import RobotChoice
from vvvaltr.controller.robot.opening import make_twin
from vvvaltr.twin.batch import run_all
from vvvaltr.twin.robot import TwinRobot


@dataclass(frozen=True, slots=True)
class Panel:
    """Speeds over two motors, the others off.

    Args:
        motors: indices of the two motors.
        frequency_hz: frequencies of both axes, (grid,).
        speed_m_s: mean scores, (grid, grid): ``[i, j]`` at frequency i of the second motor and j of the first; NaN
            where no trial was valid.
    """

    motors: tuple[int, int]
    frequency_hz: tuple[float, ...]
    speed_m_s: Array


@dataclass(frozen=True, slots=True)
class Survey:
    """What to measure: ``grid`` x ``grid`` gaits for each pair of motors, each the mean of ``repeats`` trials.

    Args:
        choice: robot and condition.
        seed: seed of the scatter.
        settings: settings of each trial.
        score_name: name of the score.
        range_hz: lowest and highest frequency.
        motor_count: number of motors.
        grid: number of frequencies along each axis.
        repeats: number of trials per gait.
    """

    choice: RobotChoice
    seed: int
    settings: TrialSettings
    score_name: str
    range_hz: tuple[float, float]
    motor_count: int
    grid: int
    repeats: int

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The pairs of motors that run; the first motor is off in the last pair."""
        return tuple(combinations(range(self.motor_count), 2))

    @property
    def frequency_hz(self) -> tuple[float, ...]:
        """The frequencies of each axis."""
        return tuple(np.linspace(*self.range_hz, self.grid).tolist())

    def gaits(self) -> Iterator[Gait]:
        """Yield all gaits, panel by panel and row by row."""
        for first, second in self.pairs:
            for second_hz in self.frequency_hz:
                for first_hz in self.frequency_hz:
                    frequencies = [0.0] * self.motor_count
                    frequencies[first], frequencies[second] = first_hz, second_hz
                    yield Gait(tuple(frequencies))


def measure(survey: Survey, jobs: int, progress: Callable[[Iterable[float]], Iterable[float]]) -> tuple[Panel, ...]:
    """Run the survey. The result does not depend on ``jobs``.

    Args:
        survey: what to measure.
        jobs: number of processes or threads.
        progress: wraps the stream of speeds, one per trial, to show the progress.

    Raises:
        KeyboardInterrupt: the program was interrupted; trials that were running are lost.
    """
    trials = [gait for gait in survey.gaits() for _ in range(survey.repeats)]
    tasks = [partial(_speed_m_s, survey, gait, number) for number, gait in enumerate(trials, start=1)]
    with closing(run_all(partial(make_twin, survey.choice, survey.seed, in_any_order=True), tasks, jobs)) as results:
        speeds = np.array(list(progress(results)))
    by_gait = np.ma.masked_invalid(speeds.reshape(len(survey.pairs), survey.grid, survey.grid, survey.repeats))
    means = by_gait.mean(axis=3).filled(np.nan)
    return tuple(Panel(pair, survey.frequency_hz, mean) for pair, mean in zip(survey.pairs, means, strict=True))


def _speed_m_s(survey: Survey, gait: Gait, number: int, robot: TwinRobot) -> float:
    """Return the score of one trial, NaN where it is not valid."""
    trial = run_trial(robot, gait, survey.settings, number)
    if trial.outcome is Outcome.INTERRUPTED:
        raise KeyboardInterrupt(trial.reason)
    return score(trial, survey.score_name) if trial.outcome.is_valid else math.nan


def draw(panels: tuple[Panel, ...], title: str, path: Path) -> None:
    """Draw the panels side by side on one colour scale, and write them to ``path`` as PNG, PDF or SVG by its ending.

    Raises:
        ImportError: matplotlib is missing.
        OSError: the file cannot be written.
    """
    from matplotlib.figure import Figure

    fastest_mm_s = 1000.0 * max(float(np.nanmax(panel.speed_m_s, initial=0.0)) for panel in panels)
    figure = Figure(figsize=(4.2 * len(panels) + 1.0, 4.7), layout="constrained")
    figure.suptitle(title, fontsize="x-large")
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        mesh = axes.pcolormesh(
            panel.frequency_hz, panel.frequency_hz, 1000.0 * panel.speed_m_s, vmin=0.0, vmax=fastest_mm_s
        )
        first, second = panel.motors
        off = [motor + 1 for motor in range(3) if motor not in panel.motors]
        axes.set(xlabel=f"motor {first + 1} (Hz)", ylabel=f"motor {second + 1} (Hz)", aspect="equal")
        axes.set_title("motor " + ", ".join(map(str, off)) + " off", fontsize="medium")
    figure.colorbar(mesh, ax=figure.axes, label="speed (mm/s)")
    figure.savefig(path, dpi=150)
