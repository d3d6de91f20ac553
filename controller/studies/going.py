"""Going somewhere as a run: `run.toml`, the errand, the repertoire it began with, and a log of primitives."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from vvvaltr.controller.core.disk import read_text
from vvvaltr.controller.core.errors import NotUnderstood, UserError
from vvvaltr.controller.core.protocols import Observer, Robot
from vvvaltr.controller.core.records import EventKind, LoggedTrial, Run
from vvvaltr.controller.loop.go import Journey
from vvvaltr.controller.loop.observing import Followers, describe_end
from vvvaltr.controller.loop.safety import Arena
from vvvaltr.controller.loop.steersman import Onward, Steersman
from vvvaltr.controller.loop.thinking import Aside, AtOnce, Thinking
from vvvaltr.controller.robot.choice import RobotChoice
from vvvaltr.controller.robot.opening import Rig, choose_robot, open_rig
from vvvaltr.controller.runs.errand import Errand, load_errand
from vvvaltr.controller.studies.steering_run import SteeringRun, load_repertoire, open_again, steering_config
from vvvaltr.transfer.steering.planner import Border
from vvvaltr.transfer.steering.repertoire import Repertoire

METHOD = "go"
_FARTHEST_M = 1000.0  # no floor of a laboratory is larger
_LEAST_TURN_RAD_S = 0.02


class GoRun:
    """A robot on an errand: robot and log are open."""

    def __init__(self, run: SteeringRun, rig: Rig, errand: Errand, repertoire: Repertoire) -> None:
        self.run = run
        self._rig = rig
        border = _border(rig.settings.arena)
        steersman = Steersman(repertoire, run.config.seed, border, rig.settings.settle_s)
        self._thinking: Thinking[Onward] = AtOnce() if run.config.robot.is_twin else Aside()
        self._journey = Journey(
            rig.robot, steersman, errand.targets, rig.settings, errand.budget_s, self._record, self._thinking
        )
        self._followers = Followers(())
        self._is_new = not run.trials

    @classmethod
    def create(cls, path: Path, asked: dict[str, Any], seed: int, sources: Sequence[Path], errand: Errand) -> GoRun:
        """Begin in a new folder.

        Args:
            path: the folder.
            asked: of the robot, keyed as in RobotChoice.
            seed: seed of every random stream.
            sources: runs from which the movements are known.
            errand: what to do.

        Raises:
            UserError: something asked for is impossible, or ``path`` exists; nothing has been written.
            DeviceError: the robot cannot be opened.
        """
        choice = choose_robot(asked)
        repertoire = usable_repertoire(choice, sources)
        rig = open_rig(choice, seed)
        try:
            check_fit(repertoire, rig, sources)
            check_errand(errand, rig.settings.arena, choice)
            config = steering_config(choice, rig, METHOD, seed, 1, rig.settings.duration_s)
            config = msgspec.structs.replace(config, sources=tuple(map(str, sources)))
            head = Run(rig.robot.structure)
            run = SteeringRun.create(path, config, head, repertoire, errand=msgspec.to_builtins(errand))
            return cls(run, rig, errand, repertoire)
        except BaseException:
            rig.robot.close()
            raise

    @classmethod
    def resume(cls, path: Path, robot_file: str | None = None) -> GoRun:
        """Go on with an errand that was interrupted; ``robot_file`` holds new addresses. Raises as ``create`` does."""
        run = SteeringRun.resume(path, METHOD, robot_file)
        try:
            errand = load_errand(path)
            rig = open_again(run.config, run.trials)
            return cls(run, rig, errand, run.source)
        except BaseException:
            run.close()
            raise

    def go(
        self, observers: Sequence[Observer] = (), watch: Callable[[Robot], Robot] | None = None
    ) -> Iterator[LoggedTrial]:
        """Drive; yields each primitive once it is recorded. See ``Journey.go`` for what is raised.

        Args:
            observers: told of each primitive once it is in the log, and of the end.
            watch: returns the robot with something put around it that follows it during a primitive; None for nothing.
        """
        self._followers = Followers(observers)
        if watch is not None:
            self._journey.watch(watch)
        self._followers.announce(EventKind.BEGIN, f"{len(self.run.trials)} primitives made")
        try:
            yield from self._drive()
        except BaseException as error:
            self._followers.announce(EventKind.END, describe_end(error))
            raise
        ending = self._journey.ending
        self._followers.announce(EventKind.END, "complete" if ending.reached else f"not reached: {ending.reason}")

    def _drive(self) -> Iterator[LoggedTrial]:
        if self._is_new:
            self._rig.robot.place(1)
        else:
            self._rig.robot.carry_on(len(self.run.trials) + 1)
            self._journey.remember(self.run.trials)
        yield from self._journey.go(len(self.run.trials) + 1)

    def _record(self, logged: LoggedTrial) -> None:
        self.run.record(logged)
        self._followers.show(logged)

    def summarise(self) -> dict[str, Any]:
        """Write `summary.json` and return what is in it; what is not known is None.

        A run that was given up before anything was driven, as where the goal is too far, leaves no folder.
        """
        ending = self._journey.ending
        result = {"run": str(self.run.path), "robot": self.run.config.robot.name, **asdict(ending)}
        result["position_m"] = list(ending.position_m)
        if math.isnan(ending.error_m):
            result |= dict.fromkeys(("position_m", "yaw_rad", "error_m"))
        if ending.reason and not ending.primitives:
            self.run.remove()
            return {**result, "run": None}
        self.run.summarise(result)
        return result

    def close(self) -> None:
        """Stop the motors, let go of the robot and close the log."""
        with closing(self.run), closing(self._thinking), closing(self._rig.robot):
            pass


def usable_repertoire(choice: RobotChoice, sources: Sequence[Path]) -> Repertoire:
    """Return the movements that some runs tell of, for this robot.

    Raises:
        UserError: there are none, or the robot could not be steered by them.
    """
    repertoire = load_repertoire(sources)
    names = ", ".join(map(str, sources))
    if choice.name == "planar":
        return _along_a_line(repertoire)
    turns = repertoire.velocities[:, 2]
    if (turns == 0.0).all():
        raise UserError(
            f"{names}: no heading was ever tracked; give the tracker a body with a heading, then learn anew"
        )
    if np.abs(turns).max() < _LEAST_TURN_RAD_S:
        raise UserError(f"{names}: no movement turns by more than 1 degree/s; try more gaits by vvvaltr repertoire")
    return repertoire


def check_fit(repertoire: Repertoire, rig: Rig, sources: Sequence[Path]) -> None:
    """Raise UserError if the robot cannot do the movements."""
    try:
        for gait in repertoire.gaits:
            rig.robot.limits.check(gait)
    except ValueError as error:
        names = ", ".join(map(str, sources))
        raise UserError(
            f"{names} is of a robot with other motors: {error}; learn movements by vvvaltr repertoire"
        ) from None


def check_errand(errand: Errand, arena: Arena | None, choice: RobotChoice) -> None:
    """Raise NotUnderstood if there is a goal that the robot cannot or must not reach."""
    for x_m, y_m, yaw_rad in errand.goals:
        if max(abs(x_m), abs(y_m)) > _FARTHEST_M:
            raise NotUnderstood(f"goal {x_m:g} {y_m:g} is further than {_FARTHEST_M:g} m: give x and y in m")
        if choice.name == "planar" and (y_m != 0.0 or yaw_rad is not None):
            raise NotUnderstood("the planar twin moves along x only: give X alone, without Y and --yaw")
        border = _border(arena)
        if border is not None and not border.holds(np.array(x_m), np.array(y_m), 0.0):
            raise NotUnderstood(
                f"goal {x_m:g} {y_m:g} is outside the arena, {border.x_m[0]:g} to {border.x_m[1]:g} m in x and "
                f"{border.y_m[0]:g} to {border.y_m[1]:g} m in y: choose one inside, or mend [arena] in the robot's file"
            )


def read_goals(path: Path) -> tuple[tuple[float, float, float | None], ...]:
    """Return the way points of a CSV file, a line each: x, y and perhaps yaw, in m and rad, under a header or none.

    Raises:
        UserError: there is no such file, or no way point in it.
        NotUnderstood: a line is something else.
    """
    try:
        rows = [row for row in csv.reader(read_text(path).splitlines()) if any(map(str.strip, row))]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        what = error.strerror if isinstance(error, OSError) else error
        raise UserError(f"{path}: {what}; give a CSV file with x, y and perhaps yaw in each line") from None
    if rows and not any(cell.strip()[:1] in tuple("+-.0123456789") for cell in rows[0]):
        rows = rows[1:]
    if not rows:
        raise UserError(f"{path} has no way points: write x, y and perhaps yaw in each line")
    return tuple(_goal(path, number, row) for number, row in enumerate(rows, start=1))


def _goal(path: Path, number: int, row: list[str]) -> tuple[float, float, float | None]:
    cells = [cell.strip() for cell in row]
    if not (2 <= len(cells) <= 3 and all(_is_number(cell) for cell in cells[:2]) and all(map(_fits, cells[2:]))):
        raise NotUnderstood(f"{path}: way point {number} is {','.join(row)!r}, not x, y and perhaps yaw as numbers")
    return float(cells[0]), float(cells[1]), float(cells[2]) if len(cells) == 3 and cells[2] else None


def _fits(cell: str) -> bool:
    return not cell or _is_number(cell)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _along_a_line(repertoire: Repertoire) -> Repertoire:
    """Return the movements of a robot in a vertical plane: what it does beside the line is its tracker's noise."""
    along = np.array([1.0, 0.0, 0.0])
    movements = tuple(
        replace(
            movement,
            velocity=movement.velocity * along,
            covariance=movement.covariance * np.outer(along, along) + np.diag(1e-12 * (1.0 - along)),
            scatter=movement.scatter * along,
        )
        for movement in repertoire.movements
    )
    return replace(repertoire, movements=movements, drift_m_s=(repertoire.drift_m_s[0], 0.0))


def _border(arena: Arena | None) -> Border | None:
    return None if arena is None else Border(arena.x_m, arena.y_m)
