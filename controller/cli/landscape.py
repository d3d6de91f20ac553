"""`vvvaltr landscape`: speed over two motors, the third off."""

from __future__ import annotations

import os
import tempfile
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from typing import Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import (
    ANY_TWIN,
    TWIN_RANGE,
    add_robot_arguments,
    add_trial_arguments,
    asked_robot,
    asked_settings,
    number,
    score_details,
    whole,
)
from vvvaltr.controller.cli.telling import bar, counted
from vvvaltr.controller.core.errors import NotUnderstood, UserError


def _add_arguments(parser: ArgumentParser) -> None:
    add_robot_arguments(parser, ANY_TWIN)
    add_trial_arguments(parser)
    parser.add_argument("--grid", type=whole(2), default=15, metavar="N", help="frequencies per motor (default 15)")
    parser.add_argument("--repeats", type=whole(1), default=3, metavar="N", help="trials per gait (default 3)")
    parser.add_argument("--range", dest="range_hz", nargs=2, type=number(), metavar=("LOW", "HIGH"),
                        help=f"range of frequencies, in Hz ({TWIN_RANGE})")  # fmt: skip
    parser.add_argument("--jobs", type=whole(1), metavar="N", help="number of trials at a time (default: one per core)")
    parser.add_argument("--out", type=Path, default=Path("landscape.png"), metavar="FILE",
                        help="new picture, .png, .pdf or .svg (default landscape.png)")  # fmt: skip


def _execute(arguments: Namespace) -> Answer:
    _refuse_bad_out(arguments.out)
    survey = _survey(arguments)
    from vvvaltr.controller.studies.landscape import draw, measure

    gaits = len(survey.pairs) * survey.grid**2
    panels = measure(
        survey,
        jobs=arguments.jobs or os.cpu_count() or 1,
        progress=partial(bar, arguments, total=gaits * survey.repeats, unit="trial", desc="landscape"),
    )
    condition = survey.choice
    title = f"{condition.name} {condition.body} on {condition.world}, {survey.score_name} speed"
    _save(partial(draw, panels, title), arguments.out)
    result: dict[str, Any] = {
        "out": str(arguments.out),
        "panels": [
            {
                "motors": [motor + 1 for motor in panel.motors],
                "frequency_hz": panel.frequency_hz,
                "speed_m_s": [[None if speed != speed else speed for speed in row] for row in panel.speed_m_s.tolist()],
            }
            for panel in panels
        ],
    }
    return Answer(f"{gaits} gaits, {counted(survey.repeats, 'trial')} each: {arguments.out}", result)


def _save(write: Callable[[Path], None], out: Path) -> None:
    """Write the picture, in a spare place if ``out`` fails, because it took long to measure; UserError says where."""
    try:
        write(out)
    except OSError as error:
        with suppress(OSError):
            out.unlink()  # half a picture would be in the way of the next
        try:
            spare = Path(tempfile.mkdtemp(prefix="vvvaltr-")) / out.name
            write(spare)
        except OSError:
            raise _unwritable(out, error) from error
        raise UserError(f"--out {out} cannot be written: {_reason(error)}; the picture is kept as {spare}") from error


def _refuse_bad_out(out: Path) -> None:
    from importlib.util import find_spec

    if find_spec("matplotlib") is None:
        raise UserError('the picture needs matplotlib: pip install "vvvaltr[report]"')
    if out.suffix not in (".png", ".pdf", ".svg"):
        raise NotUnderstood(f"--out {out}: the name of a picture ends in .png, .pdf or .svg")
    if out.exists():
        raise UserError(f"--out {out} exists: choose another name, or move it away")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=out.parent):
            pass
    except OSError as error:
        raise _unwritable(out, error) from error


def _unwritable(out: Path, error: OSError) -> UserError:
    return UserError(
        f"--out {out} cannot be written: {_reason(error)}; free some space or choose another place, then repeat"
    )


def _reason(error: OSError) -> str:
    return error.strerror or str(error)


def _survey(arguments: Namespace) -> Any:
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.core.gaits import Gait
    from vvvaltr.controller.robot.opening import choose_robot, open_rig
    from vvvaltr.controller.studies.landscape import Survey

    choice = choose_robot(asked_robot(arguments))
    if not choice.is_twin:
        raise NotUnderstood(f"robot {choice.name}: a landscape takes thousands of trials: choose a twin")
    seed = arguments.seed or 0
    rig = open_rig(choice, seed)
    with closing(rig.robot), one_line_errors():
        motor_count = rig.robot.motors.motor_count
        range_hz = tuple(arguments.range_hz or rig.range_hz)
        for frequency_hz in range_hz:
            rig.robot.limits.check(Gait((frequency_hz,) * motor_count))
        if not range_hz[0] < range_hz[1]:
            raise ValueError(f"--range {range_hz[0]:g} {range_hz[1]:g} is empty: give the lower frequency first")
    return Survey(
        choice=choice,
        seed=seed,
        settings=asked_settings(rig.settings, arguments),
        score_name=arguments.score or "net",
        range_hz=range_hz,
        motor_count=motor_count,
        grid=arguments.grid,
        repeats=arguments.repeats,
    )


COMMAND = Subcommand(
    help="draw a map of speed over the frequencies of two motors, the third off",
    example="vvvaltr landscape --robot planar --grid 15 --out landscape.png",
    add_arguments=_add_arguments,
    execute=_execute,
    details=score_details,
)
