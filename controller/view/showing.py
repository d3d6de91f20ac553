"""Shows the run in a directory in Rerun, with what it has learned."""

from __future__ import annotations

from pathlib import Path

from vvvaltr.controller.core.records import Run
from vvvaltr.controller.runs.config import CONFIG_NAME, load_config
from vvvaltr.controller.runs.log import read_run
from vvvaltr.controller.runs.run import RunDirectory, build_optimizer, make_search_space
from vvvaltr.controller.view.recording import LiveView, save_recording, show
from vvvaltr.controller.view.speed_maps import Learned
from vvvaltr.transfer.methods.registry import METHODS


def save_run(path: Path, recording: Path) -> None:
    """Write the run in ``path`` as the Rerun recording ``recording``. Raises UserError where there is no run."""
    run = read_run(path)
    save_recording(run, recording, path.name, _learned(path, run))


def show_run(path: Path, web: bool) -> None:
    """Open the run in ``path`` in Rerun, or with ``web`` in the browser. Raises UserError where there is no run."""
    run = read_run(path)
    show(run, path.name, _learned(path, run), web=web)


def open_live_view(run: RunDirectory) -> LiveView:
    """Return a view that shows ``run`` while it learns, to be closed after use."""
    return LiveView(run.logged, run.path.name, Learned(run.space, run.optimizer.predict))


def _learned(path: Path, run: Run) -> Learned | None:
    """Return what the run has learned, from an optimiser that is told all trials again; None for trials by hand."""
    if not (path / CONFIG_NAME).exists():
        return None
    config = load_config(path)
    scored = [(logged.trial.gait, logged.score) for logged in run.trials if logged.score is not None]
    if not scored or config.method not in METHODS:
        return None
    motor_count = scored[0][0].motor_count
    optimizer = build_optimizer(config, motor_count, run.sources)
    for gait, score in scored:
        optimizer.tell(gait, score)
    return Learned(make_search_space(config, motor_count), optimizer.predict)
