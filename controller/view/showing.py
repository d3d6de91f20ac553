"""Shows runs in Rerun, with what they have learned: a run's directory, or a bare log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from vvvaltr.controller.core.ask_tell import tell_history
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.runs.log import LOG_NAME, read_run
from vvvaltr.controller.runs.run import RunDirectory
from vvvaltr.controller.view.learned import reopen_learner
from vvvaltr.controller.view.recording import LiveView, Shown, save_recording, show, without_collection
from vvvaltr.controller.view.speed_maps import Belief, list_pairs

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


def show_learning(run: RunDirectory) -> LiveView:
    """Return a view that shows ``run`` while it learns, to be closed after use."""
    return LiveView(run.logged, run.path.name, run.space, run.optimizer.predict, run.config.trials)


def show_going(path: Path) -> LiveView:
    """Return a view that shows the run of steering in ``path`` while it goes on, to be closed after use."""
    return LiveView(read_run(path), path.name)


def name_run(path: Path) -> str:
    """Return a run's name for people: that of its directory."""
    absolute = path.resolve()
    return absolute.parent.name if absolute.name == LOG_NAME else absolute.name


def _open(path: Path, trial: int | None) -> Shown:
    with without_collection():
        run = read_run(path)
    learner = reopen_learner(path, run)
    if learner is None:
        return Shown(run, name_run(path), trial=trial)
    shown = Shown(run, name_run(path), learner.space, trial=trial)
    count = max(4, _MAPS // max(1, len(list_pairs(learner.space))))
    checkpoints = {trial} if trial else _checkpoints(run.trials, count)
    return Shown(run, shown.title, learner.space, _beliefs(shown, learner.optimizer, checkpoints), trial)


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
