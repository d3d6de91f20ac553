"""`vvvaltr trial`: one gait, once or several times."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence, Set
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import (
    add_robot_arguments,
    add_trial_arguments,
    asked_robot,
    asked_settings,
    number,
    score_details,
    whole,
)
from vvvaltr.controller.cli.telling import bar, counted
from vvvaltr.controller.core.errors import NotUnderstood

if TYPE_CHECKING:
    from vvvaltr.controller.core.gaits import Gait, Quantity
    from vvvaltr.controller.core.records import LoggedTrial
    from vvvaltr.controller.robot.opening import Rig


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "frequency_hz", nargs="+", type=number(), metavar="F", help="frequency of each motor in Hz; 0 is off"
    )
    parser.add_argument(
        "--phase", nargs="+", type=number(), default=[], metavar="RAD", help="phase of each motor in rad (default 0)"
    )
    parser.add_argument(
        "--amplitude",
        nargs="+",
        type=number(low=0.0, high=1.0),
        default=[],
        metavar="A",
        help="amplitude of each motor, 0 to 1 (default 1)",
    )
    parser.add_argument("--repeats", type=whole(1), default=1, metavar="N", help="number of trials (default 1)")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="new directory for the trials, as a run to view or to learn from"
    )
    add_robot_arguments(parser)
    add_trial_arguments(parser)


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.core.gaits import Gait
    from vvvaltr.controller.robot.opening import choose_robot, open_rig

    for option in ("phase", "amplitude"):
        _check_count(option, getattr(arguments, option), len(arguments.frequency_hz))
    choice = choose_robot(asked_robot(arguments))
    rig = open_rig(choice, arguments.seed or 0)
    with closing(rig.robot):
        with one_line_errors():
            gait = Gait(tuple(arguments.frequency_hz), tuple(arguments.phase), tuple(arguments.amplitude))
            rig.robot.limits.check(gait)
            _check_quantities(gait, rig.robot.motors.quantities, choice.name)
        trials = _trials(rig, gait, choice.name, arguments)
    result = _result(trials, gait, arguments.score or "net", arguments.out)
    return Answer(_prose(trials, result), result, status=_status(trials))


def _check_count(option: str, values: Sequence[float], motors: int) -> None:
    if values and len(values) != motors:
        raise NotUnderstood(
            f"--{option} has {counted(len(values), 'value')} for {counted(motors, 'motor')}: give one each"
        )


def _trials(rig: Rig, gait: Gait, robot: str, arguments: Namespace) -> list[LoggedTrial]:
    """Make the trials, and keep them if that was asked for."""
    from vvvaltr.controller.runs.measured import measuring
    from vvvaltr.controller.studies.repeats import repeat_trial

    settings = asked_settings(rig.settings, arguments)
    with measuring(arguments.out, rig.robot, robot, arguments.seed or 0) as record:
        trials = repeat_trial(rig.robot, gait, settings, arguments.repeats, arguments.score or "net", record)
        return list(
            bar(
                arguments,
                trials,
                total=arguments.repeats,
                desc="repeating",
                unit="trial",
                is_needed=arguments.repeats > 1,
            )
        )


def _check_quantities(gait: Gait, able: Set[Quantity], name: str) -> None:
    """Raise ValueError for a phase or an amplitude that the motors cannot set."""
    from vvvaltr.controller.core.gaits import Quantity

    given = {Quantity.PHASE: any(gait.phase_rad), Quantity.AMPLITUDE: any(share != 1.0 for share in gait.amplitude)}
    for quantity, is_given in given.items():
        if is_given and quantity not in able:
            raise ValueError(f"--{quantity}: the motors of {name} cannot set it; leave it out")


def _result(trials: Sequence[LoggedTrial], gait: Gait, score_name: str, out: Path | None) -> dict[str, Any]:
    """Return what was measured, as plain data; outcome and reason are those of the first trial that failed."""
    from vvvaltr.controller.loop.scoring import as_speed
    from vvvaltr.controller.studies.repeats import mean_with_interval

    telling = next((it.trial for it in trials if it.score is None), trials[-1].trial)
    scores = [it.score for it in trials if it.score is not None]
    result: dict[str, Any] = {
        "outcome": telling.outcome.value,
        "reason": telling.reason,
        "score_m_s": sum(scores) / len(scores) if scores else None,
        "gait_hz": list(gait.frequency_hz),
        "duration_s": telling.duration_s,
        "is_within_error": all(_is_within_error(it) for it in trials),
    }
    if len(trials) > 1:
        mean = as_speed(found, score_name) if (found := mean_with_interval(scores)) else None
        result["repeats"] = [
            {
                "outcome": it.trial.outcome.value,
                "reason": it.trial.reason,
                "score_m_s": it.score,
                "is_within_error": _is_within_error(it),
            }
            for it in trials
        ]
        result["mean_m_s"] = result["score_m_s"]
        result["low_m_s"], result["high_m_s"] = (mean.low, mean.high) if mean else (None, None)
    return result if out is None else {**result, "run": str(out)}


def _is_within_error(logged: LoggedTrial) -> bool:
    return logged.score is not None and logged.movement is not None and logged.movement.is_within_error


def _status(trials: Sequence[LoggedTrial]) -> int:
    from vvvaltr.controller.core.values import Outcome

    if any(it.trial.outcome is Outcome.INTERRUPTED for it in trials):
        return 130
    return 1 if any(it.score is None for it in trials) else 0


def _prose(trials: Sequence[LoggedTrial], result: dict[str, Any]) -> str:
    lines = [f"trial {it.trial.number}: {_line(it)}" for it in trials]
    if len(trials) == 1:
        lines = [_line(trials[0]) + ("" if trials[0].score is None else "; one trial says little, see --repeats")]
    elif result["low_m_s"] is not None:
        mean, low, high = (f"{1000.0 * result[key]:.1f}" for key in ("mean_m_s", "low_m_s", "high_m_s"))
        lines.append(f"mean {mean} mm/s, 95 % interval {low} to {high} mm/s")
    if run := result.get("run"):
        lines += [f"look at them     vvvaltr view {run}", f"learn from them  vvvaltr learn --source {run}"]
    return "\n".join(lines)


def _line(logged: LoggedTrial) -> str:
    trial = logged.trial
    ending = trial.outcome.value + (f" ({trial.reason})" if trial.reason else "")
    if logged.score is None:
        return f"{ending}: nothing was measured"
    line = f"{ending}: {1000.0 * logged.score:.1f} mm/s over {trial.duration_s:.2f} s"
    movement = logged.movement
    if movement is None or movement.error_m is None or not movement.is_within_error:
        return line
    return f"{line}, which is within the tracker's noise (standard error {1000.0 * movement.error_m:.2g} mm)"


COMMAND = Subcommand(
    help="try one gait, once or several times",
    example="vvvaltr trial 12 -14 9 --robot planar --repeats 5 --out runs/tried",
    add_arguments=_add_arguments,
    execute=_execute,
    details=score_details,
)
