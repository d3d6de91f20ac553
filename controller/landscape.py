"""Speed over two motors, the third off: one panel for each motor that is off, as in section 8.1 of the thesis.

(Transfer Learning for Faster Discovery of Tensegrity Robot Gaits, Union College, 2018.)
"""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.assembly import Rig, open_rig
from controller.run_config import RobotChoice
from controller.scoring import score
from controller.trial_runner import TrialSettings, run_trial
from controller.types import Gait


@dataclass(frozen=True, slots=True)
class Panel:
    """Speeds over two motors: ``speed_m_s[i, j]`` at ``frequency_hz[i]`` of ``motors[1]`` and ``[j]`` of ``motors[0]``.

    NaN where no trial measured anything.
    """

    motors: tuple[int, int]
    frequency_hz: tuple[float, ...]
    speed_m_s: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Survey:
    """What to measure: ``grid`` x ``grid`` gaits for each pair of motors, each the mean of ``repeats`` trials."""

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
        """The pairs of motors that run; the last one leaves out the first motor."""
        return tuple(combinations(range(self.motor_count), 2))

    @property
    def frequency_hz(self) -> tuple[float, ...]:
        """The frequencies of each axis."""
        return tuple(np.linspace(*self.range_hz, self.grid).tolist())

    def gaits(self) -> Iterator[Gait]:
        """All gaits, panel by panel, row by row."""
        for first, second in self.pairs:
            for second_hz in self.frequency_hz:
                for first_hz in self.frequency_hz:
                    frequencies = [0.0] * self.motor_count
                    frequencies[first], frequencies[second] = first_hz, second_hz
                    yield Gait(tuple(frequencies))


def measure(survey: Survey, jobs: int, progress: Callable[[Iterable[float]], Iterable[float]]) -> tuple[Panel, ...]:
    """Run the survey over ``jobs`` processes; the result does not depend on their number.

    Args:
        survey: what to measure.
        jobs: processes.
        progress: wraps the stream of speeds, one per gait, to show how far it is.
    """
    numbered = list(enumerate(survey.gaits()))
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        chunk = max(1, len(numbered) // (8 * jobs))
        speeds = np.array(list(progress(pool.map(partial(_mean_speed_m_s, survey), numbered, chunksize=chunk))))
    panels = speeds.reshape(len(survey.pairs), survey.grid, survey.grid)
    return tuple(Panel(pair, survey.frequency_hz, panel) for pair, panel in zip(survey.pairs, panels, strict=True))


@cache  # a worker process measures many gaits on one robot
def _rig(choice: RobotChoice, seed: int) -> Rig:
    return open_rig(choice, seed)


def _mean_speed_m_s(survey: Survey, numbered: tuple[int, Gait]) -> float:
    number, gait = numbered
    robot = _rig(survey.choice, survey.seed).robot
    first = 1 + number * survey.repeats
    trials = (run_trial(robot, gait, survey.settings, first + repeat) for repeat in range(survey.repeats))
    speeds = [score(trial, survey.score_name) for trial in trials if trial.outcome.is_valid]
    return float(np.mean(speeds)) if speeds else math.nan


def draw(panels: tuple[Panel, ...], title: str, path: Path) -> None:
    """Draw the panels side by side on one colour scale, and write a PNG, PDF or SVG by the path's ending.

    Raises:
        ImportError: matplotlib is missing.
    """
    from matplotlib.figure import Figure

    fastest_mm_s = 1000.0 * max(float(np.nanmax(panel.speed_m_s, initial=0.0)) for panel in panels)
    figure = Figure(figsize=(4.2 * len(panels) + 1.0, 4.4), layout="constrained")
    figure.suptitle(title)
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        mesh = axes.pcolormesh(
            panel.frequency_hz, panel.frequency_hz, 1000.0 * panel.speed_m_s, vmin=0.0, vmax=fastest_mm_s
        )
        first, second = panel.motors
        off = [motor + 1 for motor in range(3) if motor not in panel.motors]
        axes.set(xlabel=f"motor {first + 1} (Hz)", ylabel=f"motor {second + 1} (Hz)", aspect="equal")
        axes.set_title("motor " + ", ".join(map(str, off)) + " off")
    figure.colorbar(mesh, ax=figure.axes, label="speed (mm/s)")
    figure.savefig(path, dpi=150)
