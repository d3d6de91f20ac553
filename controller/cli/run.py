"""`vvvaltr run`: one gait, one trial."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Set
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Command
from vvvaltr.controller.cli.options import add_robot_arguments, add_trial_arguments, asked_robot, number

if TYPE_CHECKING:
    from vvvaltr.controller.core.values import Gait, Quantity


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("frequency_hz", nargs="+", type=number(), metavar="F", help="of each motor, in Hz; 0 is off")
    parser.add_argument("--phase", nargs="+", type=number(), default=[], metavar="RAD", help="of each motor")
    parser.add_argument(
        "--amplitude", nargs="+", type=number(), default=[], metavar="SHARE", help="of each motor, 0..1"
    )
    add_robot_arguments(parser)
    add_trial_arguments(parser)


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.core.values import Gait, Outcome
    from vvvaltr.controller.loop.scoring import score
    from vvvaltr.controller.loop.trial_runner import run_trial
    from vvvaltr.controller.robot.opening import choose_robot, open_rig

    choice = choose_robot(asked_robot(arguments))
    rig = open_rig(choice, arguments.seed or 0)
    with closing(rig.robot):
        with one_line_errors():
            gait = Gait(tuple(arguments.frequency_hz), tuple(arguments.phase), tuple(arguments.amplitude))
            rig.robot.limits.check(gait)
            _check_quantities(gait, rig.robot.motors.quantities, choice.name)
        settings = replace(rig.settings, duration_s=arguments.duration_s or rig.settings.duration_s)
        trial = run_trial(rig.robot, gait, settings)
    speed_m_s = score(trial, arguments.score or "net") if trial.outcome.is_valid else None
    result: dict[str, Any] = {
        "outcome": trial.outcome.value,
        "reason": trial.reason,
        "score_m_s": speed_m_s,
        "gait_hz": list(gait.frequency_hz),
        "duration_s": trial.duration_s,
    }
    interrupted = trial.outcome is Outcome.INTERRUPTED
    return Answer(_prose(result), result, status=130 if interrupted else 0 if trial.outcome.is_valid else 1)


def _check_quantities(gait: Gait, able: Set[Quantity], name: str) -> None:
    """Raise ValueError for a phase or an amplitude that the motors cannot set."""
    from vvvaltr.controller.core.values import Quantity

    given = {Quantity.PHASE: any(gait.phase_rad), Quantity.AMPLITUDE: any(share != 1.0 for share in gait.amplitude)}
    for quantity, is_given in given.items():
        if is_given and quantity not in able:
            raise ValueError(f"--{quantity}: the motors of {name} cannot set it; leave it out")


def _prose(result: dict[str, Any]) -> str:
    ending = result["outcome"] + (f" ({result['reason']})" if result["reason"] else "")
    if result["score_m_s"] is None:
        return f"{ending}: nothing was measured"
    return f"{ending}: {1000 * result['score_m_s']:.1f} mm/s over {result['duration_s']:.2f} s, once; repeats scatter"


COMMAND = Command(
    help="run one gait, one trial",
    example="vvvaltr run 12 -14 9 --robot planar --duration 5",
    add_arguments=_add_arguments,
    execute=_execute,
)
