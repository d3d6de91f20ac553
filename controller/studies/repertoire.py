"""Learning movements: gaits chosen by what a repertoire lacks, or all that was ever logged, put together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from vvvaltr.controller.core.errors import NotUnderstood, UserError, one_line_errors
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Outcome, Suggestion
from vvvaltr.controller.loop.movement import NO_HEADING, lacks_heading
from vvvaltr.controller.loop.one_trial import make_trial
from vvvaltr.controller.robot.opening import Rig, choose_robot, open_rig
from vvvaltr.controller.runs.config import load_config
from vvvaltr.controller.runs.log import read_run
from vvvaltr.controller.runs.repertoire_file import SOURCE_NAME
from vvvaltr.controller.studies.steering_run import SteeringRun, load_repertoire, sorted_runs, steering_config
from vvvaltr.transfer.steering.lacking import next_gait
from vvvaltr.transfer.steering.passage import STEADY_S
from vvvaltr.transfer.steering.repertoire import Repertoire, learn_repertoire

METHOD = "repertoire"
_SHORTEST_S = 2.0  # of a trial: a little more than what tells a movement at all
_FAILURES_IN_A_ROW = 3  # after which somebody has to look at the robot


class RepertoireRun:
    """Movements being learned: robot and log are open."""

    def __init__(self, run: SteeringRun, rig: Rig) -> None:
        self.run = run
        self._rig = rig

    @classmethod
    def create(
        cls, path: Path, asked: dict[str, Any], seed: int, trials: int, duration_s: float | None
    ) -> RepertoireRun:
        """Begin in a new folder.

        Args:
            path: the folder.
            asked: of the robot, keyed as in RobotChoice, and range_hz.
            seed: seed of every random stream.
            trials: number of valid trials to make.
            duration_s: time the motors are driven in each; None for the robot's usual one.

        Raises:
            UserError: something asked for is impossible, or ``path`` exists; nothing has been written.
            DeviceError: the robot cannot be opened.
        """
        range_hz = asked.pop("range_hz", None)
        choice = choose_robot(asked)
        rig = open_rig(choice, seed)
        try:
            duration_s = duration_s or rig.settings.duration_s
            _check_duration(duration_s)
            config = steering_config(choice, rig, METHOD, seed, trials, duration_s)
            if range_hz is not None:
                _check_range(rig, range_hz)
                config = msgspec.structs.replace(config, range_hz=range_hz)
            return cls(SteeringRun.create(path, config, Run(rig.robot.structure)), rig)
        except BaseException:
            rig.robot.close()
            raise

    @classmethod
    def resume(cls, path: Path, trials: int | None, robot_file: str | None = None) -> RepertoireRun:
        """Go on with a run, perhaps to more trials; ``robot_file`` holds new addresses. Raises as ``create`` does."""
        if load_config(path).method == METHOD and (path / SOURCE_NAME).exists():
            raise UserError(f"{path} was put together from other runs and cannot be resumed: leave out --resume")
        run = SteeringRun.resume(path, METHOD, robot_file)
        try:
            if trials is not None:
                run.config = msgspec.structs.replace(run.config, trials=trials)
            return cls(run, open_rig(run.config.robot, run.config.seed))
        except BaseException:
            run.close()
            raise

    def learn(self) -> Iterator[LoggedTrial]:
        """Make the trials that are still to be made; yields each once it is recorded.

        Raises:
            KeyboardInterrupt: the operator interrupted a trial; it has been recorded.
            UserError: several trials in a row have failed: the robot needs a hand.
            TrialCrashed: the program failed during a trial; it has been recorded.
        """
        config, robot = self.run.config, self._rig.robot
        settings = replace(self._rig.settings, duration_s=config.duration_s, heading_limit_rad=None)
        failures = 0
        while sum(logged.score is not None for logged in self.run.trials) < config.trials:
            number = len(self.run.trials) + 1
            random = stream(config.seed, number, METHOD)
            chosen = next_gait(self.repertoire, config.range_hz, robot.motors.motor_count, random)
            logged = make_trial(robot, Suggestion(chosen.gait, chosen.why), settings, number, self.run.record)
            yield logged
            if config.robot.name != "planar" and lacks_heading(logged.trial):
                raise UserError(NO_HEADING)
            failures = 0 if logged.trial.outcome.is_valid else failures + 1
            _stop_if_hopeless(logged, failures)

    @property
    def repertoire(self) -> Repertoire:
        """What is known so far."""
        return learn_repertoire([[logged.trial for logged in self.run.trials]])

    def close(self) -> None:
        """Stop the motors, let go of the robot and close the log."""
        with closing(self.run), closing(self._rig.robot):
            pass


def put_together(paths: Sequence[Path], out: Path) -> Repertoire:
    """Make a repertoire of all trials that some runs have logged, in a new folder, and return it.

    The trials are copied, run by run; what a run of ``go`` began with is kept beside them.

    Raises:
        UserError: one of them is not a run, or none has a valid trial with poses, or ``out`` exists.
    """
    repertoire = load_repertoire(paths)
    configs = [load_config(path) for path in paths if (path / "run.toml").exists()]
    if not configs:
        raise UserError(f"{paths[0]} has no run.toml, so its robot is not known: give runs of this program by --from")
    plain, began = sorted_runs(paths)
    source = load_repertoire(began) if began else None
    config = msgspec.structs.replace(configs[0], method=METHOD, sources=tuple(map(str, paths)))
    structure = next((run.structure for run in map(read_run, paths) if run.structure), None)
    # The robot is that of whoever made the first run: its addresses are not opened, and not trusted later.
    with closing(SteeringRun.create(out, config, Run(structure), source, seals=False)) as run:
        for path in plain:
            for logged in read_run(path).trials:
                run.record(replace(logged, recommendation=None, fit=None))  # of a search that knew its own run alone
        run.summarise({"run": str(out), **describe(repertoire)})
    return repertoire


def describe(repertoire: Repertoire) -> dict[str, Any]:
    """Return what a repertoire can do, as plain data: each movement with its 95 % interval, and the extremes."""
    velocities = repertoire.velocities
    return {
        "gaits": len(repertoire.movements),
        "trials": sum(movement.trials for movement in repertoire.movements),
        "drift_m_s": list(repertoire.drift_m_s),
        "fastest_m_s": float(np.hypot(velocities[:, 0], velocities[:, 1]).max(initial=0.0)),
        "turn_left_rad_s": float(velocities[:, 2].max(initial=0.0)),
        "turn_right_rad_s": float((-velocities[:, 2]).max(initial=0.0)),
        "movements": [
            {
                "gait_hz": list(movement.gait.frequency_hz),
                "forward_m_s": float(movement.velocity[0]),
                "left_m_s": float(movement.velocity[1]),
                "turn_rad_s": float(movement.velocity[2]),
                "sd": movement.deviation.tolist(),
                "scatter": movement.scatter.tolist(),
                "trials": movement.trials,
            }
            for movement in repertoire.movements
        ],
    }


def _check_duration(duration_s: float) -> None:
    if duration_s < _SHORTEST_S:
        raise NotUnderstood(
            f"--duration {duration_s:g} is too short: motors take {STEADY_S:g} s to speed up before a movement can be "
            f"seen; give at least {_SHORTEST_S:g}"
        )


def _check_range(rig: Rig, range_hz: tuple[float, float]) -> None:
    with one_line_errors():
        try:
            for frequency_hz in range_hz:
                rig.robot.limits.check(Gait((frequency_hz,) * rig.robot.motors.motor_count))
            if not range_hz[0] < range_hz[1]:
                raise ValueError(f"{range_hz[0]:g} {range_hz[1]:g} is empty: give the lower frequency first")
        except ValueError as error:
            raise ValueError(f"--range: {error}") from None


def _stop_if_hopeless(logged: LoggedTrial, failures: int) -> None:
    trial = logged.trial
    if trial.outcome is Outcome.INTERRUPTED:
        raise KeyboardInterrupt(trial.reason)
    if failures >= _FAILURES_IN_A_ROW:
        raise UserError(f"{failures} trials in a row failed; the last one: {trial.ending}")
