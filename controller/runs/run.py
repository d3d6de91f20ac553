"""A run on disk: `run.toml`, `trials.mcap`, `summary.json`; made, learned on, resumed, read back."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import msgspec

from vvvaltr.controller.core.disk import new_folder, write_whole
from vvvaltr.controller.core.errors import NotUnderstood, UserError, one_line_errors
from vvvaltr.controller.core.gaits import Gait, GaitSpace, Quantity
from vvvaltr.controller.core.protocols import Observer, Optimizer, Robot
from vvvaltr.controller.core.records import Event, LoggedTrial, Run
from vvvaltr.controller.core.values import Source
from vvvaltr.controller.loop.attendance import Attendance
from vvvaltr.controller.loop.learn import learn, make_source
from vvvaltr.controller.loop.memory import Memory
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.summary import summarise
from vvvaltr.controller.robot.choice import option
from vvvaltr.controller.robot.opening import Rig, choose_robot, open_rig
from vvvaltr.controller.runs.attended import Attended, make_attendance
from vvvaltr.controller.runs.config import (
    STEERING,
    RunConfig,
    check_config,
    load_config,
    refuse_difference,
    refuse_other_run,
    resumed_config,
    save_config,
)
from vvvaltr.controller.runs.log import LOG_NAME, RunLog, describe_maker, read_run, read_trials
from vvvaltr.controller.runs.reopening import reopen_rig, settings_of
from vvvaltr.transfer.methods.registry import make_optimizer


class RunDirectory:
    """One run, open for learning: its robot and its log are open."""

    def __init__(self, path: Path, config: RunConfig, rig: Rig, optimizer: Optimizer, log: RunLog, logged: Run) -> None:
        self.path = path
        self.config = config
        self.optimizer = optimizer
        self.space = make_search_space(config, rig.robot.motors.motor_count)
        self.trials = Memory(logged.trials)
        self._rig = rig
        self._log = log
        self._is_complete = False

    @classmethod
    def create(cls, path: Path, asked: dict[str, Any]) -> RunDirectory:
        """Begin a new run in ``path``; ``asked`` holds the user's choices, keyed as in RunConfig.

        Raises:
            UserError: a choice is impossible, or ``path`` exists; nothing has been written.
            DeviceError: the robot cannot be opened.
        """
        if not path.name:
            raise NotUnderstood("--out names no new directory: give it a name, as in runs/mine, or leave it out")
        _refuse_existing(path)
        score_name = asked.get("score", "net")
        sources = tuple(load_source(Path(name), score_name) for name in asked.get("sources", ()))
        choice = choose_robot(asked.get("robot", {}))
        rig = open_rig(choice, asked.get("seed", 0))
        with ExitStack() as undo:
            undo.callback(rig.robot.close)
            config = _complete({**asked, "robot": choice}, rig)
            optimizer = build_optimizer(config, rig.robot.motors.motor_count, sources)
            logged = Run(rig.robot.structure, sources, about=describe_maker(config.robot.name, config.seed))
            log = _begin(path, config, logged)
            undo.pop_all()
        return cls(path, config, rig, optimizer, log, logged)

    @classmethod
    def resume(cls, path: Path, asked: dict[str, Any]) -> RunDirectory:
        """Open the run in ``path`` for more trials; a torn log is recovered.

        Raises:
            UserError: there is no run, or ``asked`` differs from it; nothing has been written.
            DeviceError: the robot cannot be opened.
        """
        stored = load_config(path)
        if stored.method in STEERING:
            refuse_other_run(path, stored.method, "a search")
        named = asked.get("robot", {}).get("name")
        if not stored.robot.is_twin:  # whose file may have another name now
            asked = {**asked, "robot": {key: it for key, it in asked.get("robot", {}).items() if key != "name"}}
        refuse_difference(stored, asked)
        config = resumed_config(path, stored, named)
        config = msgspec.structs.replace(config, trials=asked.get("trials", stored.trials))
        with _blame(path / "run.toml"):
            _make_budget(config)
        with ExitStack() as undo:
            with RunLog.recovering(path / LOG_NAME, recordings=False) as (log, logged), _blame(path / "run.toml"):
                rig = reopen_rig(config, logged.trials)
                undo.callback(rig.robot.close)
                _check_motors(config, rig, str)
                optimizer = build_optimizer(config, rig.robot.motors.motor_count, logged.sources)
            undo.callback(log.close)
            if config != stored:
                save_config(config, path / "run.toml")
            undo.pop_all()
        return cls(path, config, rig, optimizer, log, logged)

    @property
    def logged(self) -> Run:
        """The contents of the log, with all recordings, read from the disk."""
        return read_run(self.path)

    def learn(
        self,
        observers: Sequence[Observer] = (),
        watch: Callable[[Robot], Robot] | None = None,
        attended: Attended | None = None,
    ) -> Iterator[LoggedTrial]:
        """Make the remaining trials; see ``vvvaltr.controller.loop.learn.learn`` for what is raised.

        Args:
            observers: told of each trial once it is in the log and in `summary.json`.
            watch: returns the robot with something put around it that follows it during a trial; None for nothing.
            attended: who is beside the robot, and when it is put back; None for nobody, and as usual.

        Raises:
            UserError: the robot cannot be put back as asked.
        """
        settings = settings_of(self.config, self._rig)
        history, all_observers = self.trials, [_Summary(self), *observers]
        budget = _make_budget(self.config)
        attendance = make_attendance(self._rig, attended or Attended(), self.config.robot.is_twin, self.path)
        if watch:
            attendance.robot = watch(attendance.robot)
        robot = self._rig.robot
        record, optimizer = self._record, self.optimizer
        trials = learn(robot, optimizer, settings, budget, record, history, all_observers, attendance)
        return self._to_its_end(trials, attendance)

    def _to_its_end(self, trials: Generator[LoggedTrial, None, None], attendance: Attendance) -> Iterator[LoggedTrial]:
        """Yield trials as long as the run's folder is where it was: what cannot be found again is not measured."""
        if self.trials:
            self.summarise()  # one that is prolonged is not complete any more
        with closing(trials):
            for logged in trials:
                yield logged
                self._refuse_gone()
        self._is_complete = not attendance.is_ending
        self.summarise()

    def summarise(self) -> dict[str, Any]:
        """Write `summary.json` and return what is in it; ``complete`` once the run has ended by its own rules."""
        about = {"run": str(self.path), "robot": self.config.robot.name, "method": self.config.method}
        result = {**about, "complete": self._is_complete, **summarise(self.trials)}
        if self.path.is_dir():  # otherwise it was moved or deleted, which ends the run
            write_whole(self.path / "summary.json", json.dumps(result, indent=2) + "\n")
        return result

    def close(self) -> None:
        """Stop the motors, close the robot and close the log."""
        with closing(self._log), closing(self._rig.robot):
            pass

    def _record(self, logged: LoggedTrial) -> None:
        self._log.append(logged)
        self._refuse_gone()

    def _refuse_gone(self) -> None:
        """Raise UserError if the run's log is not where it was."""
        if not self._log.is_at(self.path / LOG_NAME):
            raise UserError(
                f"{self.path} was moved or deleted: the run ends here; continue it by --resume where it is now"
            )


class _Summary:
    """The observer that keeps a run's `summary.json` up to date."""

    def __init__(self, run: RunDirectory) -> None:
        self._run = run

    def on_trial(self, logged: LoggedTrial) -> None:
        """Write the summary, which now counts this trial."""
        self._run.summarise()

    def on_event(self, event: Event) -> None:
        """Do nothing: a summary is of trials."""


def load_source(path: Path, score_name: str) -> Source:
    """Return the valid trials of another run (its directory or its log), scored by the score named ``score_name``.

    Raises:
        UserError: it is not a run, or has no valid trial.
    """
    log = path / LOG_NAME if path.is_dir() else path
    with one_line_errors():
        return make_source(str(path), read_trials(log), score_name)


def make_search_space(config: RunConfig, motor_count: int) -> GaitSpace:
    """Return the gaits that the run may try."""
    return GaitSpace.over(motor_count, *config.range_hz, tuple(map(Quantity, config.optimise)))


def build_optimizer(config: RunConfig, motor_count: int, sources: Sequence[Source]) -> Optimizer:
    """Return the run's optimiser before its first trial. Raises UserError if method, sources and space do not fit."""
    with one_line_errors():
        return make_optimizer(config.method, make_search_space(config, motor_count), config.seed, sources)


def _make_budget(config: RunConfig) -> Budget:
    with one_line_errors():
        reference = Gait(config.reference_hz) if config.reference_hz else None
        every = config.reference_every or 1
        return Budget(config.trials, config.score, config.confirm, config.stop_below_m_s, reference, every)


@contextmanager
def _blame(path: Path) -> Iterator[None]:
    """Name the file at fault in front of every error."""
    try:
        yield
    except (UserError, ValueError) as error:
        raise UserError(f"{path}: {error}") from None


def _refuse_existing(path: Path) -> None:
    if path.exists():
        raise UserError(f"{path} exists: choose another --out, or continue it with --resume {path}")


def _begin(path: Path, config: RunConfig, head: Run) -> RunLog:
    """Make the directory, with configuration and log, in one step: a killed program leaves no half of a run."""
    with ExitStack() as undo:
        try:
            with new_folder(path) as fresh:
                save_config(config, fresh / "run.toml")
                log = undo.enter_context(RunLog.create(fresh / LOG_NAME, head.structure, head.sources, head.about))
        except OSError as error:
            _refuse_existing(path)  # made meanwhile, by another process
            raise UserError(f"{path} cannot be made: {error.strerror}; choose another --out, or make room") from error
        undo.pop_all()
    return log


def _complete(asked: dict[str, Any], rig: Rig) -> RunConfig:
    """Return the complete configuration: the user's choices, and defaults for the rest."""
    usual = {
        "method": "guarded" if asked.get("sources") else "drive",
        "sources": (),
        "seed": 0,
        "trials": 40,
        "duration_s": rig.settings.duration_s,
        "score": "net",
        "optimise": (Quantity.FREQUENCY.value,),
        "range_hz": rig.range_hz,
        "heading_limit_rad": rig.settings.heading_limit_rad or math.inf,
    }
    config = RunConfig(**{**usual, **asked})
    with one_line_errors():
        check_config(config, option)
        _make_budget(config)
        _check_motors(config, rig, option)
    return config


def _check_motors(config: RunConfig, rig: Rig, spell: Callable[[str], str]) -> None:
    """Raise ValueError for frequencies or quantities beyond the robot's motors; ``spell`` as in ``check_config``."""
    motors = rig.robot.motors
    try:
        for frequency_hz in config.range_hz:
            rig.robot.limits.check(Gait((frequency_hz,) * motors.motor_count))
    except ValueError as error:
        raise ValueError(f"{spell('range_hz')}: {error}") from None
    if config.reference_hz:
        try:
            rig.robot.limits.check(Gait(config.reference_hz))
        except ValueError as error:
            raise ValueError(f"{spell('reference_hz')}: {error}") from None
    if unable := set(config.optimise) - motors.quantities:
        raise ValueError(f"{spell('optimise')}: the motors of {config.robot.name} cannot set their {min(unable)}")
