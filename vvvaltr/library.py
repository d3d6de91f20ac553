"""vvvaltr as a library: open a robot, learn on it, read a run, in one call each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from vvvaltr.controller.core.errors import UserError, one_line_errors
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.protocols import AskTell, Observer, Robot
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.values import Source
from vvvaltr.controller.loop import learn as loop
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.safety import GuardedRobot, Limits
from vvvaltr.controller.loop.scoring import SCORES
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.controller.robot.opening import Rig, choose_robot, open_rig
from vvvaltr.controller.runs import log
from vvvaltr.controller.runs.measured import begin_measured_run
from vvvaltr.controller.runs.run import load_source
from vvvaltr.twin.robot import TwinRobot


class OpenRobot(GuardedRobot):
    """A robot with guarded motors, and what its trials need. Use it in a ``with`` block, which closes it.

    Attributes:
        settings: how a trial is run: for a real robot with the arena and the limits of its file.
        space: the gaits worth searching: the frequencies of all motors.
    """

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig.robot, rig.robot.limits)
        self.settings = rig.settings
        self.space = GaitSpace.over(self.motors.motor_count, *rig.range_hz)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_robot(
    name: str | Path = "planar",
    *,
    seed: int = 0,
    body: str | None = None,
    world: str | None = None,
    gravity_m_s2: float | None = None,
    friction: float | None = None,
    damage: Sequence[str] = (),
    law: str | None = None,
    scatter: str | None = None,
) -> OpenRobot:
    """Return an open robot, ready for ``run_trial`` and ``learn``.

    Args:
        name: ``planar`` or ``spatial`` for a twin, or the path of a real robot's file, ``robot.toml``.
        seed: seed of everything that scatters on a twin.
        body: of a twin: ``prism3`` or ``icosahedron6``; None for the twin's usual one.
        world: ground of a twin, written as on the command line: ``hills:height_m=0.006``; None for flat ground.
        gravity_m_s2: of a twin; None for 9.81.
        friction: Coulomb coefficient of a twin's ground; None for 0.5.
        damage: to a twin, written as on the command line: ``["snap:4,8"]``.
        law: force law of a twin's motors: ``eccentric`` or ``constant``; None for eccentric.
        scatter: of a twin, written as on the command line: ``hurried:incline_rad=0.05``; None for ``careful``.

    Raises:
        UserError: there is no such robot or condition, or the robot's file is wrong; the message says how to mend it.
        DeviceError: a device does not answer as it should.
        TrackingLost: no pose comes from the tracker.
    """
    condition = {
        "body": body,
        "world": world,
        "gravity_m_s2": gravity_m_s2,
        "friction": friction,
        "damage": tuple(damage) or None,
        "law": law,
        "scatter": scatter,
    }
    asked = {key: value for key, value in condition.items() if value is not None}
    return OpenRobot(open_rig(choose_robot({"name": str(name), **asked}), seed))


def learn(
    robot: Robot,
    optimizer: AskTell,
    *,
    trials: int = 40,
    duration_s: float | None = None,
    settings: TrialSettings | None = None,
    score: str = "net",
    confirm: tuple[int, int] = (0, 0),
    out: str | Path | None = None,
    observers: Sequence[Observer] = (),
) -> Iterator[LoggedTrial]:
    """Learn a gait: yields each trial as it ends. Ask, run, score, tell; a failed trial is never told.

    The motors stop at the end of each trial, and whatever ends the loop: an exception, an interrupt, ``break``.

    Args:
        robot: with guarded motors: from ``open_robot``, or a ``GuardedRobot`` around a robot of your own.
        optimizer: from ``make_optimizer``, or your own, for which ``ask`` and ``tell`` suffice; it has been told
            nothing.
        trials: how many valid trials to make.
        duration_s: time the motors are driven in each trial; None for what the settings say.
        settings: how a trial is run; None for the robot's own.
        score: ``net``, ``path`` or ``forward``: what counts as speed, in m/s.
        confirm: (gaits, repeats) of the last trials, which repeat the most promising gaits. An optimiser of your own
            that only asks and tells has a recommendation after repeats alone.
        out: a new folder that keeps the trials, for ``read_run``, ``vvvaltr view`` and ``vvvaltr learn --source``; None
            to keep nothing on disk.
        observers: told of each trial and event; a failure of theirs does not end the run.

    Raises:
        UserError: an argument is impossible, ``out`` exists or cannot be made, or several trials in a row have failed.
        KeyboardInterrupt: a trial was interrupted; it has been recorded.
        TrialCrashed: the program failed during a trial; it has been recorded.
    """
    if score not in SCORES:
        raise UserError(f"there is no score {score!r}: choose one of {', '.join(SCORES)}")
    if out is not None and Path(out).exists():
        raise UserError(f"{out} exists: choose another folder, or move it away")
    guarded, budget = _guarded(robot), _budget(trials, score, confirm)
    chosen = settings or (robot.settings if isinstance(robot, OpenRobot) else TrialSettings())
    if duration_s is not None:
        chosen = replace(chosen, duration_s=duration_s)
    if not 0.0 < chosen.duration_s < math.inf:
        raise UserError(f"duration_s is {chosen.duration_s:g}: give a time above 0 s, at which the motors stop")

    def trials_made() -> Iterator[LoggedTrial]:
        with _recording(robot, None if out is None else Path(out)) as record:
            yield from loop.learn(guarded, optimizer, chosen, budget, record, observers=observers)

    return trials_made()


def _budget(trials: int, score: str, confirm: tuple[int, int]) -> Budget:
    if not trials >= 1:
        raise UserError(f"trials is {trials}: make at least 1")
    if min(confirm) < 0:
        raise UserError(f"confirm is {confirm}: give (gaits, repeats), or (0, 0) for no confirmation")
    with one_line_errors():
        return Budget(trials, score, confirm)


def _guarded(robot: Robot) -> GuardedRobot:
    """Return the robot behind its guard. Raises UserError where nothing is known of its limits."""
    if isinstance(robot, GuardedRobot):
        return robot
    if isinstance(robot, TwinRobot):
        return GuardedRobot(robot, Limits(robot.max_hz))
    raise UserError("the robot's motors have no guard: use open_robot, or GuardedRobot(robot, Limits(max_hz))")


@contextmanager
def _recording(robot: Robot, out: Path | None) -> Iterator[Callable[[LoggedTrial], Any]]:
    """Yield what keeps a trial."""
    if out is None:
        yield lambda logged: None
        return
    with begin_measured_run(out, robot.structure, log.describe_maker()) as kept:
        yield kept.append


def read_run(path: str | Path) -> Run:
    """Return a run that was kept on disk, from its folder or its ``trials.mcap``; a torn log gives its whole trials.

    Raises:
        UserError: there is no run, or its log is damaged or was written by a newer version.
    """
    return log.read_run(Path(path))


def read_source(path: str | Path, score: str = "net") -> Source:
    """Return the valid trials of a run on disk as a source to learn from, for ``make_optimizer``.

    Args:
        path: folder of the run, or its log.
        score: what counts as speed, in m/s: ``net``, ``path`` or ``forward``; the trials are scored again by it.

    Raises:
        UserError: there is no run, it has no valid trial, or its trials cannot be scored so.
    """
    return load_source(Path(path), score)
