"""The commands that drive a gait, or make a run again, to copy."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.robot.choice import option
from vvvaltr.controller.runs.config import RunConfig
from vvvaltr.controller.runs.errand import Errand

_USUAL = {
    "body": ("prism3", "icosahedron6"),
    "world": ("flat",),
    "friction": (0.5,),
    "gravity_m_s2": (9.81,),
    "law": ("eccentric",),
    "score": ("net",),
    "optimise": (["frequency"],),
}
_TWINS = ("planar", "spatial")


def write_trial_command(gait: Gait, robot: str, config: RunConfig | None = None) -> str:
    """Return the command that drives a gait five times.

    Args:
        gait: the gait.
        robot: the robot as the log names it; empty where that is not known.
        config: what the run was asked to do; None where nobody learned in it.
    """
    words = ["vvvaltr trial", *_write_frequencies(gait, max(map(abs, config.range_hz)) if config else math.inf)]
    words += ["--phase", *_write_numbers(gait.phase_rad)] if any(gait.phase_rad) else []
    words += ["--amplitude", *_write_numbers(gait.amplitude)] if any(share != 1.0 for share in gait.amplitude) else []
    words += _write_robot(config) if config else [f"--robot {shlex.quote(robot)}"] if robot else []
    return " ".join([*words, "--repeats 5"])


def write_learn_command(config: RunConfig) -> str:
    """Return the command that makes a run again; what is usual is left out."""
    stored = msgspec.to_builtins(config)
    for key in ("robot", "format", "seal", "reference_hz", "reference_every"):
        del stored[key]
    words = ["vvvaltr learn", *_write_robot(config), *_write_options(stored)]
    if config.reference_hz:
        words.append(f"--reference {','.join(map(_write_float, config.reference_hz))}:{config.reference_every}")
    return " ".join(words)


def write_making_command(config: RunConfig, errand: Errand | None = None) -> str:
    """Return the command that makes a run again, whichever made it; ``errand`` is that of a run of ``go``."""
    robot = [*_write_robot(config), *_write_options({"seed": config.seed})]
    moves = [f"--repertoire {shlex.quote(source)}" for source in config.sources]
    match config.method:
        case "repertoire" if config.sources:
            return " ".join(["vvvaltr repertoire", *(f"--from {shlex.quote(source)}" for source in config.sources)])
        case "repertoire":
            asked = {"gaits": config.trials, "duration_s": config.duration_s, "range_hz": config.range_hz}
            return " ".join(["vvvaltr repertoire", *robot, *_write_options(asked)])
        case "go":
            return " ".join(["vvvaltr go", *_write_errand(errand, config.robot.name), *moves, *robot])
        case "jog":
            return " ".join(["vvvaltr jog", *moves, *robot])
    return write_learn_command(config)


def _write_errand(errand: Errand | None, robot: str) -> list[str]:
    words = ["--path FILE.csv"]
    if errand is None:
        return words
    if len(errand.goals) == 1:
        x_m, y_m, yaw_rad = errand.goals[0]
        words = [_write_float(x_m), *([] if robot == "planar" else [_write_float(y_m)])]  # which moves along x only
        words += [] if yaw_rad is None else [f"--yaw {_write_float(yaw_rad)}"]
    asked, usual = (
        {"--within": it.within_m, "--within-yaw": it.within_rad, "--time": it.budget_s}
        for it in (errand, Errand(errand.goals))
    )
    return words + [f"{name} {_write_float(value)}" for name, value in asked.items() if value != usual[name]]


def _write_robot(config: RunConfig) -> list[str]:
    robot = msgspec.to_builtins(config.robot)
    del robot["file"]
    return list(_write_options(robot))


def _write_options(values: Mapping[str, Any]) -> Iterator[str]:
    for key, stored in values.items():
        value = list(stored) if isinstance(stored, tuple) else stored
        if value is not None and value not in _USUAL.get(key, ()):
            yield from _write_option(key, value)


def _write_option(key: str, value: Any) -> list[str]:
    match key, value:
        case "confirm", (gaits, repeats):
            return [f"--confirm {gaits}x{repeats}"] if gaits else []
        case "stop_below_m_s", _:
            return [f"--stop-when {1000.0 * value:g}"] if value else []
        case (("sources" | "damage"), _):
            return [f"{option(key)} {shlex.quote(each)}" for each in value]
        case "optimise", _:
            return [f"--optimise {','.join(value)}"]
        case "range_hz", (low, high):
            return [f"--range {_write_float(low)} {_write_float(high)}"]
        case _:
            return [f"{option(key)} {shlex.quote(_write_float(value) if isinstance(value, float) else str(value))}"]


def _write_float(number: float) -> str:
    """Return a number in as few digits as say exactly what it is."""
    short = f"{number:g}"
    return short if float(short) == number else repr(number)


def _write_frequencies(gait: Gait, most_hz: float) -> list[str]:
    """Return frequencies to 3 digits, of which none exceeds ``most_hz`` by having been rounded."""
    rounded_hz = [round(hz, 3) for hz in gait.frequency_hz]
    return [f"{hz - math.copysign(0.001, hz) if abs(hz) > most_hz else hz:.3f}" for hz in rounded_hz]


def _write_numbers(numbers: tuple[float, ...]) -> list[str]:
    return [f"{number:.3f}" for number in numbers]
