"""What a run was asked to do: `run.toml`, everything needed to repeat it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import msgspec
import tomli_w

from controller.interface import UserError

FORMAT = 1


class RobotChoice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The robot and, for a twin, its condition.

    Args:
        name: ``planar`` or ``spatial``, or the path of the robot's file.
        body: the twin's body.
        law: the force law of its motors, ``eccentric`` or ``constant``.
        world: the ground, as on the command line: ``flat``, ``hills:height_m=0.006``.
        gravity_m_s2: gravity.
        friction: friction coefficient of the ground.
        damage: what is broken, as on the command line: ``snap:3,17``.
        file: the contents of the robot's file; None for a twin.
    """

    name: str = "planar"
    body: str | None = None
    law: str | None = None
    world: str | None = None
    gravity_m_s2: float | None = None
    friction: float | None = None
    damage: tuple[str, ...] | None = None
    file: dict[str, Any] | None = None

    @property
    def is_twin(self) -> bool:
        """Whether the robot is a simulated one."""
        return self.file is None


class RunConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=False):
    """A run of learning.

    Args:
        robot: on what.
        method: the optimiser's name.
        sources: runs to learn from, as they were named.
        seed: of every random stream.
        trials: valid trials to make.
        duration_s: of each.
        score: the score's name.
        optimise: the searched quantities.
        range_hz: the searched frequencies, lowest and highest, of every motor.
        confirm: how many promising gaits the last trials repeat, and how often each.
        stop_below_m_s: the search ends when a trial is expected to gain less than this.
        format: version of this file's layout.
    """

    robot: RobotChoice
    method: str
    sources: tuple[str, ...]
    seed: int
    trials: int
    duration_s: float
    score: str
    optimise: tuple[str, ...]
    range_hz: tuple[float, float]
    confirm: tuple[int, int] = (0, 0)
    stop_below_m_s: float = 0.0
    format: int = FORMAT


def save_config(config: RunConfig, path: Path) -> None:
    """Write ``config`` as TOML; what is None is left out."""
    path.write_text(tomli_w.dumps(_without_none(msgspec.to_builtins(config))), encoding="utf-8")


def load_config(run: Path) -> RunConfig:
    """Read the configuration of the run in directory ``run``.

    Raises:
        UserError: there is none, or it cannot be understood.
    """
    path = run / "run.toml"
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"{run} is no run: it has no run.toml") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: {error}; restore the file as the run wrote it") from None
    if content.get("format") != FORMAT:
        raise UserError(f"{path}: format {content.get('format')} is not {FORMAT}; use the vvvaltr that wrote the run")
    try:
        return msgspec.convert(content, RunConfig)
    except msgspec.ValidationError as error:
        raise UserError(f"{path}: {error}; restore the file as the run wrote it") from None


def refuse_difference(config: RunConfig, asked: dict[str, Any]) -> None:
    """Raise UserError, naming the first difference, if ``asked`` is not what ``config`` says.

    ``asked`` holds only what was asked for; ``robot`` is a mapping of its own. A greater number of trials is no
    difference: it prolongs the run, unless that ends with a confirmation.
    """
    stored = msgspec.to_builtins(config)
    wanted = {**asked.pop("robot", {}), **asked}
    for key, value in msgspec.to_builtins(wanted).items():
        has = stored["robot"].get(key) if key in stored["robot"] else stored.get(key)
        if key == "trials" and value >= config.trials and not any(config.confirm):
            continue
        if has != value:
            raise UserError(f"{key}: the run has {has}, but {value} was asked for; drop it, or start a new run (--out)")


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return value
