"""The optimiser of a run that is over, made again from its files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vvvaltr.controller.core.gaits import Gait, GaitSpace, Parameter, Quantity
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.records import Run
from vvvaltr.controller.runs.config import CONFIG_NAME, RunConfig, load_config
from vvvaltr.controller.runs.log import LOG_NAME
from vvvaltr.controller.runs.run import build_optimizer, make_search_space
from vvvaltr.transfer.methods.registry import METHODS


@dataclass(frozen=True, slots=True)
class Learner:
    """Who learned in a run.

    Args:
        config: what the run was asked to do.
        space: gaits that it searched.
        optimizer: its optimiser, told nothing.
    """

    config: RunConfig
    space: GaitSpace
    optimizer: Optimizer


def reopen_config(path: Path) -> RunConfig | None:
    """Return what the run in ``path``, a directory or the log in it, was asked to do; None where nobody learned in it.

    Raises:
        UserError: the configuration cannot be understood.
    """
    folder = path if path.is_dir() else path.parent
    is_of_run = path.is_dir() or path.name == LOG_NAME
    return load_config(folder) if is_of_run and (folder / CONFIG_NAME).exists() else None


def reopen_learner(path: Path, run: Run) -> Learner | None:
    """Return who learned in ``run``, which was read from ``path``.

    None for trials by hand, a run that measured nothing, or a method that is not installed.

    Raises:
        UserError: the configuration cannot be understood.
    """
    config = reopen_config(path)
    if config is None or config.method not in METHODS or not any(it.score is not None for it in run.trials):
        return None
    motor_count = run.trials[0].trial.gait.motor_count
    return Learner(config, make_search_space(config, motor_count), build_optimizer(config, motor_count, run.sources))


def span(gaits: Sequence[Gait]) -> GaitSpace:
    """Return the frequencies that ``gaits`` span, for trials that no search made; a motor that never varies is held."""
    rest = gaits[-1]
    bounds = [(motor, min(hz), max(hz)) for motor, hz in enumerate(zip(*(g.frequency_hz for g in gaits), strict=True))]
    varied = tuple(Parameter(Quantity.FREQUENCY, motor, low, high) for motor, low, high in bounds if high > low)
    return GaitSpace(rest, varied)
