"""A run of steering on disk: an ordinary run, with the repertoire that it began with beside its log."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from vvvaltr import __version__
from vvvaltr.controller.core.disk import new_folder, write_whole
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.gaits import Quantity
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.values import Trial
from vvvaltr.controller.loop.safety import GuardedRobot, Limits
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.controller.robot.choice import RobotChoice
from vvvaltr.controller.robot.opening import Rig, make_twin, open_rig
from vvvaltr.controller.runs.config import (
    STEERING,
    RunConfig,
    load_config,
    refuse_other_run,
    resumed_config,
    save_config,
)
from vvvaltr.controller.runs.log import LOG_NAME, RunLog, read_run
from vvvaltr.controller.runs.repertoire_file import SOURCE_NAME, read_repertoire, split_runs, table_of
from vvvaltr.transfer.steering.passage import SHORTEST_S, where
from vvvaltr.transfer.steering.repertoire import Repertoire, learn_repertoire


class SteeringRun:
    """A run with its log open."""

    def __init__(self, path: Path, config: RunConfig, log: RunLog, trials: Sequence[LoggedTrial]) -> None:
        self.path = path
        self.config = config
        self.trials = list(trials)
        self._log = log

    @classmethod
    def create(
        cls,
        path: Path,
        config: RunConfig,
        head: Run,
        source: Repertoire | None = None,
        seals: bool = True,
        **files: Any,
    ) -> Self:
        """Begin a new run.

        Args:
            path: its folder.
            config: goes to run.toml.
            head: how the robot is built.
            source: the repertoire that it begins with.
            seals: see ``save_config``.
            files: what else stands beside the log: NAME.json for each name.

        Raises:
            UserError: the folder exists or cannot be made; nothing has been written.
        """
        if not path.name:
            raise UserError("--out names no new directory: give it a name, as in runs/mine, or leave it out")
        _refuse_existing(path)
        if source is not None:
            files["source"] = table_of(source)
        with ExitStack() as undo:
            try:
                with new_folder(path) as fresh:
                    save_config(config, fresh / "run.toml", seals)
                    for name, content in files.items():
                        write_whole(fresh / f"{name}.json", json.dumps(content, indent=1) + "\n")
                    log = undo.enter_context(RunLog.create(fresh / LOG_NAME, head.structure, (), _about(config)))
            except OSError as error:
                _refuse_existing(path)  # made meanwhile, by another process
                raise UserError(
                    f"{path} cannot be made: {error.strerror}; choose another --out, or make room"
                ) from error
            undo.pop_all()
        return cls(path, config, log, ())

    @classmethod
    def resume(cls, path: Path, method: str, robot_file: str | None = None) -> Self:
        """Open a run to go on with it, with the addresses of ``robot_file`` if one is named; a torn log is recovered.

        Raises:
            UserError: there is no run, or one of another kind, or its addresses are of others.
        """
        config = load_config(path)
        if config.method != method:
            refuse_other_run(path, config.method, repr(method))
        stored, config = config, resumed_config(path, config, robot_file)
        log, logged = RunLog.recover(path / LOG_NAME)
        if config != stored:
            save_config(config, path / "run.toml")
        return cls(path, config, log, logged.trials)

    @property
    def source(self) -> Repertoire:
        """The repertoire that it began with. Raises UserError if the file is damaged."""
        return read_repertoire(self.path / SOURCE_NAME)

    def record(self, logged: LoggedTrial) -> None:
        """Keep a trial for good."""
        self._log.append(logged)
        self.trials.append(logged)

    def summarise(self, result: dict[str, Any]) -> None:
        """Write `summary.json`."""
        write_whole(self.path / "summary.json", json.dumps(result, indent=2) + "\n")

    def remove(self) -> None:
        """Remove the run's folder, in which there is nothing to keep."""
        shutil.rmtree(self.path)

    def close(self) -> None:
        """Close the log."""
        self._log.close()


def steering_config(choice: RobotChoice, rig: Rig, method: str, seed: int, trials: int, duration_s: float) -> RunConfig:
    """Return what run.toml says of a run of steering."""
    return RunConfig(
        robot=choice,
        method=method,
        sources=(),
        seed=seed,
        trials=trials,
        duration_s=duration_s,
        score="net",
        optimise=(Quantity.FREQUENCY.value,),
        range_hz=rig.range_hz,
    )


def open_again(config: RunConfig, trials: Sequence[LoggedTrial]) -> Rig:
    """Open the robot of a run to go on from where its last trial ended; a twin is put down there."""
    last = next((logged.trial.poses[-1] for logged in reversed(trials) if logged.trial.poses), None)
    if not config.robot.is_twin or last is None:
        return open_rig(config.robot, config.seed)
    from vvvaltr.twin.engine import Start

    twin = make_twin(config.robot, config.seed)
    twin.put_down(Start(*where(last).tolist()))
    return Rig(GuardedRobot(twin, Limits(twin.max_hz)), TrialSettings(), twin.range_hz)


def load_repertoire(paths: Sequence[Path]) -> Repertoire:
    """Return what the runs in ``paths`` tell of movements: what each began with, and its own trials, each counted once.

    Raises:
        UserError: one of them is not a run, or none has a valid trial with poses.
    """
    plain, began = sorted_runs(paths)
    repertoire = load_sources(began)
    for path in (*plain, *began):
        trials = [logged.trial for logged in read_run(path).trials]
        _check_motors(path, trials, repertoire)
        repertoire = learn_repertoire(split_runs(trials), repertoire)
    if not repertoire.movements:
        names = ", ".join(map(str, paths))
        raise UserError(
            f"{names}: no valid trial has poses of {SHORTEST_S:g} s or more, so that no movement is known; make some "
            "by vvvaltr repertoire"
        )
    return repertoire


def load_sources(paths: Sequence[Path]) -> Repertoire:
    """Return what some runs began with, put together. Raises UserError if a file is damaged."""
    repertoire = Repertoire()
    for path in paths:
        repertoire = repertoire.joined(read_repertoire(path / SOURCE_NAME))
    return repertoire


def sorted_runs(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Return the runs that began with nothing, and those that began with a repertoire.

    A run with which another one of them began, or from which it was put together, at first or at second hand, is left
    out: what it tells is in the other one already.
    """
    holds = {path.resolve(): _runs_within(path) for path in paths}
    for path in list(holds):  # one by one: of two that name each other, as after a folder was made anew, one stays
        if any(path in within for other, within in holds.items() if other != path):
            del holds[path]
    kept = list({path.resolve(): path for path in paths if path.resolve() in holds}.values())
    began = [path for path in kept if (path / SOURCE_NAME).exists()]
    return [path for path in kept if path not in began], began


def _runs_within(path: Path) -> set[Path]:
    """Return the runs whose movements a run of steering holds; of those that are gone, no more than the name."""
    found, ahead = set[Path](), [path.resolve()]
    while ahead:
        try:
            config = load_config(ahead.pop())
        except UserError:
            continue
        if config.method in STEERING:  # a search keeps its sources apart from its own trials
            nearer = {Path(name).resolve() for name in config.sources} - found
            found |= nearer
            ahead += nearer
    return found


def _check_motors(path: Path, trials: Sequence[Trial], known: Repertoire) -> None:
    counts = {trial.gait.motor_count for trial in trials} | {gait.motor_count for gait in known.gaits}
    if len(counts) > 1:
        raise UserError(f"{path}: gaits of {' and '.join(map(str, sorted(counts)))} motors do not make one repertoire")


def _refuse_existing(path: Path) -> None:
    if path.exists():
        raise UserError(f"{path} exists: choose another --out, or go on with it by --resume {path}")


def _about(config: RunConfig) -> dict[str, str]:
    date = datetime.now(UTC).isoformat(timespec="seconds")
    return {"version": __version__, "robot": config.robot.name, "seed": str(config.seed), "date": date}
