"""What a run was asked to do: `run.toml`, everything needed to repeat it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import msgspec
import tomli_w

from vvvaltr.controller.core.disk import read_text, write_whole
from vvvaltr.controller.core.document import parse_toml, typed
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.gaits import Quantity
from vvvaltr.controller.core.spelling import did_you_mean
from vvvaltr.controller.loop.scoring import SCORES
from vvvaltr.controller.robot.choice import RobotChoice, option
from vvvaltr.controller.runs.trust import choose_resumed_robot, seal

CONFIG_NAME = "run.toml"
FORMAT = 2
"""Format of `run.toml`. Format 1, of version 0.1, counts springs, struts and motors from 0; this one from 1."""

_MOST_BYTES = 1 << 20
_BOUNDS = {
    "seed": (0, math.inf),
    "trials": (1, math.inf),
    "reference_every": (0, math.inf),
    "duration_s": (0.1, 3600),
    "stop_below_m_s": (0, math.inf),
}


class RunConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=False):
    """A run of learning.

    Args:
        robot: the robot, and the condition of a twin.
        method: name of the optimiser.
        sources: runs to learn from, as they were named.
        seed: seed of every random stream.
        trials: number of valid trials to make.
        duration_s: time the motors are driven in each trial.
        score: name of the score.
        optimise: quantities that the search varies.
        range_hz: lowest and highest frequency that the search gives to a motor.
        confirm: number of promising gaits that the last trials repeat, and number of repeats of each.
        stop_below_m_s: the search ends when the next trial is expected to gain less than this.
        reference_hz: gait that is driven again and again; empty for none.
        reference_every: number of trials of the search between two of its trials.
        heading_limit_rad: greatest change of heading, infinite for any; None in a run of version 0.1, for 1 rad on a
            twin and what the robot's file says on a real robot.
        format: version of the file's layout.
        seal: proof that this user opened the robot's addresses on this computer; see ``trust``.
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
    heading_limit_rad: float | None = None
    reference_hz: tuple[float, ...] = ()
    reference_every: int = 0
    format: int = FORMAT
    seal: str = ""


def check_config(config: RunConfig, spell: Callable[[str], str] = str) -> None:
    """Raise ValueError for an impossible value; ``spell`` returns a key as the user wrote it."""
    for key, (low, high) in _BOUNDS.items():
        value = getattr(config, key)
        if not (low <= value <= high and value < math.inf):
            allowed = f"{low:g} to {high:g}" if high < math.inf else f"a finite number, {low:g} or more"
            raise ValueError(f"{spell(key)} is {value:g}; allowed: {allowed}")
    if config.score not in SCORES:
        guess = did_you_mean(config.score, SCORES)
        raise ValueError(f"{spell('score')} is {config.score!r}{guess}; allowed: {', '.join(SCORES)}")
    if wrong := set(config.optimise) - set(Quantity):
        raise ValueError(f"{spell('optimise')}: {min(wrong)!r} is unknown; allowed: {', '.join(Quantity)}")
    if Quantity.FREQUENCY not in config.optimise or len(set(config.optimise)) < len(config.optimise):
        raise ValueError(f"{spell('optimise')}: name frequency among them, and each quantity once")
    if config.heading_limit_rad is not None and not config.heading_limit_rad > 0.0:
        raise ValueError(f"{spell('heading_limit_rad')} is {config.heading_limit_rad:g}; allowed: above 0, or inf")
    if min(config.confirm) < 0:
        raise ValueError(f"{spell('confirm')} is {list(config.confirm)}; allowed: 0 or more")
    low_hz, high_hz = config.range_hz
    if not low_hz < high_hz:  # false also where one of them is NaN
        raise ValueError(f"{spell('range_hz')} {low_hz:g} {high_hz:g} is empty: give the lower frequency first")


def save_config(config: RunConfig, path: Path, seals: bool = True) -> None:
    """Write ``config`` as TOML; what is None is left out. Raises OSError.

    ``seals`` says whether this user has opened the robot's addresses, so that they may be opened again unasked.
    """
    sealed = msgspec.structs.replace(config, seal=seal(config.robot) if seals else "")
    write_whole(path, tomli_w.dumps(_without_none(msgspec.to_builtins(sealed))))


def load_config(run: Path) -> RunConfig:
    """Read the configuration of the run in directory ``run``.

    Raises:
        UserError: there is none, or it cannot be understood.
    """
    path = run / CONFIG_NAME
    try:
        content = parse_toml(read_text(path, _MOST_BYTES))
    except FileNotFoundError:
        what = f"has no {CONFIG_NAME}, so it cannot be resumed: a new run can learn from it by --source"
        raise UserError(f"{run} {what if run.exists() else 'is not there: name the directory of a run'}") from None
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}; restore the file as the run wrote it") from None
    except ValueError as error:  # of TOML and UTF-8 alike
        raise UserError(f"{path}: {error}; restore the file as the run wrote it") from None
    if "format" not in content:
        raise UserError(f"{path}: format is missing; restore the file as the run wrote it")
    if content["format"] not in (1, FORMAT):
        raise UserError(f"{path}: format {content['format']} is not 1 or {FORMAT}; use the vvvaltr that wrote the run")
    try:
        config = _upgraded(typed(content, RunConfig, str(path)))
        check_config(config, lambda key: f"{path}: {key}")
    except (UserError, ValueError) as error:
        raise UserError(f"{error}; restore the file as the run wrote it") from None
    return config


def _upgraded(config: RunConfig) -> RunConfig:
    """Return the configuration in the present format."""
    if config.format == FORMAT:
        return config
    damage = config.robot.damage
    counted_from_1 = None if damage is None else tuple(map(_count_from_1, damage))
    robot = msgspec.structs.replace(config.robot, damage=counted_from_1)
    return msgspec.structs.replace(config, robot=robot, format=FORMAT)


def _count_from_1(spec: str) -> str:
    """Return damage, written with numbers from 0, with numbers from 1: ``snap:3,7`` becomes ``snap:4,8``."""
    kind, *rest = spec.split(":")
    if not rest or not all(number.isdecimal() and len(number) < 10 for number in rest[0].split(",")):
        raise ValueError(f"robot.damage {spec!r} is not understood")
    return ":".join([kind, ",".join(str(int(number) + 1) for number in rest[0].split(",")), *rest[1:]])


STEERING = ("repertoire", "go", "jog")
"""What stands in place of a method in the runs of commands that drive without searching."""


def refuse_other_run(run: Path, method: str, kind: str) -> NoReturn:
    """Raise UserError: a run of ``method`` is not one of ``kind``; says how to go on with it."""
    command = method if method in STEERING else "learn"
    cure = "drive again by vvvaltr jog" if method == "jog" else f"go on by vvvaltr {command} --resume {run}"
    raise UserError(f"{run} is a run of {method!r}, not of {kind}: {cure}")


def resumed_config(run: Path, config: RunConfig, named: str | None) -> RunConfig:
    """Return the configuration with which a run goes on; ``named`` is the robot's file that the user names, or None.

    Raises:
        UserError: see ``choose_resumed_robot``.
    """
    robot = choose_resumed_robot(run, config.robot, config.seal, named)
    return config if robot == config.robot else msgspec.structs.replace(config, robot=robot)


def refuse_difference(config: RunConfig, asked: Mapping[str, Any]) -> None:
    """Raise UserError, naming the first difference, if ``asked`` is not what ``config`` says.

    ``asked`` holds only what was asked for; ``robot`` is a mapping of its own. A greater number of trials is no
    difference: it prolongs the run, unless that ends with a confirmation.
    """
    stored = msgspec.to_builtins(config)
    wanted = {**asked.get("robot", {}), **{key: value for key, value in asked.items() if key != "robot"}}
    for key, value in msgspec.to_builtins(wanted).items():
        has = stored["robot"].get(key) if key in stored["robot"] else stored.get(key)
        if key == "trials" and value >= config.trials and not any(config.confirm):
            continue
        if has != value:
            had, wished = _as_typed(key, has), _as_typed(key, value)
            raise UserError(
                f"{option(key)}: the run has {had}, but {wished} was asked for; "
                "leave it out, or start a new run (--out)"
            )


def _as_typed(key: str, value: Any) -> str:
    """Return a value as the command line writes it."""
    if key == "confirm":
        return "x".join(map(str, value))
    if key == "stop_below_m_s":
        return f"{1000.0 * value:g}"
    if isinstance(value, list | tuple):
        return ("," if key == "optimise" else " ").join(map(str, value)) or "none"
    return "none" if value is None else str(value)


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return value
