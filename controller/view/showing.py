"""Shows runs in Rerun, with what they have learned: a run's directory, or a bare log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from vvvaltr.controller.core.ask_tell import tell_history
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.runs.config import CONFIG_NAME, load_config
from vvvaltr.controller.runs.log import LOG_NAME, read_run
from vvvaltr.controller.runs.run import RunDirectory, build_optimizer, make_search_space
from vvvaltr.controller.view.recording import LiveView, Shown, save_recording, show
from vvvaltr.controller.view.speed_maps import Belief, list_pairs
from vvvaltr.transfer.methods.registry import METHODS

_MAPS = 72  # drawn of a run, of all pairs of motors together: each asks the model for hundreds of gaits


def save_run(path: Path, recording: Path) -> None:
    """Write the run in ``path`` as the Rerun recording ``recording``. Raises UserError where there is no run."""
    save_runs([path], recording)


def save_runs(paths: Sequence[Path], recording: Path, trial: int | None = None) -> None:
    """Write runs side by side as one recording, or of one run only the trial numbered ``trial``.

    Raises:
        UserError: a path is not a run's directory or log, or the run has no such trial.
    """
    save_recording(recording, *(_open(path, trial) for path in paths))


def show_runs(paths: Sequence[Path], web: bool, trial: int | None = None) -> None:
    """Open runs side by side in Rerun, or with ``web`` in the browser. Raises UserError as ``save_runs`` does."""
    show(*(_open(path, trial) for path in paths), web=web)


def open_live_view(run: RunDirectory) -> LiveView:
    """Return a view that shows ``run`` while it learns, to be closed after use."""
    return LiveView(run.logged, run.path.name, run.space, run.optimizer.predict, run.config.trials)


def name_run(path: Path) -> str:
    """Return a run's name for people: that of its directory."""
    absolute = path.resolve()
    return absolute.parent.name if absolute.name == LOG_NAME else absolute.name


def _open(path: Path, trial: int | None) -> Shown:
    run = read_run(path)
    folder = path if path.is_dir() else path.parent
    is_learned = path.name in (folder.name, LOG_NAME) and (folder / CONFIG_NAME).exists()
    optimizer = _optimizer(folder, run) if is_learned else None
    if optimizer is None:
        return Shown(run, name_run(path), trial=trial)
    space = make_search_space(load_config(folder), run.trials[0].trial.gait.motor_count)
    shown = Shown(run, name_run(path), space, trial=trial)
    checkpoints = {trial} if trial else _checkpoints(run.trials, max(4, _MAPS // max(1, len(list_pairs(space)))))
    return Shown(run, shown.title, space, _beliefs(shown, optimizer, checkpoints), trial)


def _optimizer(folder: Path, run: Run) -> Optimizer | None:
    """Return the run's optimiser, told nothing; None for a run that measured nothing, or of an unknown method."""
    config = load_config(folder)
    if config.method not in METHODS or not any(logged.score is not None for logged in run.trials):
        return None
    return build_optimizer(config, run.trials[0].trial.gait.motor_count, run.sources)


def _checkpoints(trials: Sequence[LoggedTrial], count: int) -> set[int]:
    """Return the numbers of about ``count`` valid trials, the last one among them."""
    valid = [logged.trial.number for logged in trials if logged.score is not None]
    return set(valid[:: -max(1, -(-len(valid) // count))])


def _beliefs(shown: Shown, optimizer: Optimizer, checkpoints: set[int]) -> Iterator[Belief]:
    """Tell the optimiser the run's trials again, and yield what it believes after those in ``checkpoints``."""
    if shown.space is None:
        return
    trials, told = shown.run.trials, 0
    for count, (logged, following) in enumerate(zip(trials, [*trials[1:], None], strict=True), start=1):
        number = logged.trial.number
        if logged.score is None or number not in checkpoints:
            continue
        tell_history(optimizer, trials[:count], already=told)
        told = count
        suggestion = following.suggestion if following else optimizer.ask()
        yield Belief(number, shown.space, optimizer.predict, suggestion.gait)
