"""`vvvaltr learn`: find a good gait."""

from __future__ import annotations

import sys
import time
from argparse import ArgumentParser, ArgumentTypeError, BooleanOptionalAction, Namespace
from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.following import add_following_arguments, open_events, open_live_view
from vvvaltr.controller.cli.keyboard import is_at_keyboard, raw_keyboard
from vvvaltr.controller.cli.operator import KEY_DETAILS, TerminalOperator
from vvvaltr.controller.cli.options import (
    TWIN_RANGE,
    add_robot_arguments,
    add_trial_arguments,
    asked_robot,
    method_details,
    number,
    one_of,
    score_details,
    whole,
)
from vvvaltr.controller.cli.progress import TrialProgress, is_vague
from vvvaltr.controller.cli.rerun_extra import has_rerun
from vvvaltr.controller.cli.telling import say
from vvvaltr.controller.core.errors import NotUnderstood, UserError, one_line_errors
from vvvaltr.controller.core.records import EventKind
from vvvaltr.controller.core.values import Phase

if TYPE_CHECKING:
    from vvvaltr.controller.core.protocols import Observer
    from vvvaltr.controller.core.records import Event, LoggedTrial
    from vvvaltr.controller.runs.run import RunDirectory


def _add_arguments(parser: ArgumentParser) -> None:
    add_robot_arguments(parser)
    add_trial_arguments(parser)
    group = parser.add_argument_group("learning")
    group.add_argument("--trials", type=whole(1), metavar="N", help="number of valid trials (default 40)")
    group.add_argument("--method", metavar="NAME", help="optimiser (default drive; with --source guarded)")
    group.add_argument("--source", action="append", metavar="RUN", help="earlier run to learn from; repeatable")
    group.add_argument("--optimise", type=one_of("frequency", "phase", "amplitude"), metavar="WHAT,...",
                       help="quantities to search: frequency, phase, amplitude (default frequency)")  # fmt: skip
    group.add_argument("--range", dest="range_hz", nargs=2, type=number(), metavar=("LOW", "HIGH"),
                       help="range of frequencies to search, in Hz; negative is reverse "
                       f"({TWIN_RANGE}, or what the robot's file says)")  # fmt: skip
    group.add_argument("--confirm", type=_gaits_by_repeats, metavar="KxR",
                       help="repeat the K most promising gaits R times each, in the last K*R trials")  # fmt: skip
    group.add_argument("--reference", metavar="GAIT:N",
                       help="drive GAIT every N trials, to see whether the robot has changed")  # fmt: skip
    group.add_argument("--stop-when", dest="stop_below_mm_s", type=number(above=0), metavar="MM_S",
                       help="end the search when the expected gain of a trial falls below this, in mm/s")  # fmt: skip
    group = parser.add_argument_group("operator")
    group.add_argument("--attended", action=BooleanOptionalAction, help="ask the person beside the robot "
                       "between trials (default with a robot's file on a terminal)")  # fmt: skip
    group.add_argument("--reposition", choices=("each", "arena", "never"), metavar="WHEN",
                       help="when the robot is put back to its start: each (before each trial), arena (at the border "
                       "of its arena) or never (default each where [start] is in the file, else arena)")  # fmt: skip
    group.add_argument("--no-hand", action="store_true", help="do not ask the hand of a mock to put its robot back")
    group.add_argument("--park-after", type=number(above=0), default=60.0, metavar="S",
                       help="in a pause of more than S seconds, let go of the motors' lines (default 60)")  # fmt: skip
    group = parser.add_argument_group("run")
    where = group.add_mutually_exclusive_group()
    where.add_argument("--out", type=Path, metavar="DIR", help="new directory for the run (default runs/DATE-ROBOT)")
    where.add_argument("--resume", type=Path, metavar="DIR", help="continue the run in this directory")
    group.add_argument("--or-resume", action="store_true",
                       help="continue the run in --out, if there is one already: for a service")  # fmt: skip
    group.add_argument("--no-recording", action="store_true", help="do not write the Rerun recording, run.rrd")
    add_following_arguments(group)


def _gaits_by_repeats(text: str) -> tuple[int, int]:
    gaits, _, repeats = text.partition("x")
    if not (gaits.isdecimal() and repeats.isdecimal() and int(gaits) and int(repeats)):
        raise ArgumentTypeError(f"{text!r} is not gaits x repeats, as in 3x4")
    return int(gaits), int(repeats)


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.runs.run import RunDirectory

    if arguments.attended and not is_at_keyboard():
        raise UserError("--attended needs a terminal, and there is none here: over ssh, ask for one by ssh -t")
    if arguments.or_resume and not (arguments.out or arguments.resume):
        raise NotUnderstood("--or-resume continues the run in --out, if there is one: give --out DIR as well")
    _check_reposition(arguments)
    asked = _asked(arguments)
    with ExitStack() as stack:
        observers = open_events(arguments, stack)
        if arguments.or_resume and arguments.out is not None and arguments.out.exists():
            arguments.resume = arguments.out
        if arguments.resume is not None:
            run = RunDirectory.resume(arguments.resume, asked)
        else:
            run = RunDirectory.create(arguments.out or _default_directory(asked), asked)
        try:
            with closing(run):
                _learn(run, observers, arguments)
        except KeyboardInterrupt as interrupt:
            raise KeyboardInterrupt(f"{interrupt}; the run is saved, continue it by --resume {run.path}") from None
        finally:
            result = run.summarise()
    if has_rerun() and not arguments.no_recording:
        _save_recording(run.path, arguments)
    return Answer(_prose(result), result)


def _check_reposition(arguments: Namespace) -> None:
    """Raise UserError, before anything is written, where the robot cannot be put back as asked."""
    from vvvaltr.controller.loop.putting_back import Placement, Reposition
    from vvvaltr.controller.robot.robot_file import load_robot_file

    if arguments.reposition is None or (arguments.resume and arguments.robot is None):
        return
    if arguments.robot is None or not arguments.robot.endswith(".toml"):
        raise NotUnderstood("--reposition is for a robot's file: a twin is put back, or left, as its --scatter says")
    with one_line_errors():
        Placement(Reposition(arguments.reposition), load_robot_file(Path(arguments.robot)).start_place)


def _reference(text: str) -> tuple[tuple[float, ...], int]:
    """Return the gait and the number of trials that ``12,-14,9:5`` says. Raises NotUnderstood or UserError."""
    from vvvaltr.controller.cli.gaits import read_gait

    gait, _, every = text.rpartition(":")
    if not gait or not every.isdecimal() or not int(every):
        raise NotUnderstood(f"--reference {text!r} is not GAIT:N, as in 12,-14,9:5 or runs/flat:5")
    return read_gait(gait).frequency_hz, int(every)


_KEYS = ("method", "seed", "trials", "duration_s", "score", "optimise", "range_hz", "confirm", "heading_limit_rad")


def _asked(arguments: Namespace) -> dict[str, Any]:
    """Return what was asked for, keyed as in RunConfig; what was not given is absent."""
    asked: dict[str, Any] = {"robot": asked_robot(arguments)}
    for key in _KEYS:
        if (value := getattr(arguments, key)) is not None:
            asked[key] = value
    if arguments.reference is not None:
        asked["reference_hz"], asked["reference_every"] = _reference(arguments.reference)
    if arguments.stop_below_mm_s is not None:
        asked["stop_below_m_s"] = arguments.stop_below_mm_s / 1000.0
    if arguments.source:
        asked["sources"] = tuple(arguments.source)
    return asked


def _default_directory(asked: dict[str, Any]) -> Path:
    robot = Path(asked["robot"].get("name", "planar")).stem
    return Path("runs") / f"{time.strftime('%Y%m%d-%H%M%S')}-{robot}"


def _learn(run: RunDirectory, observers: Sequence[Observer], arguments: Namespace) -> None:
    from vvvaltr.controller.loop.putting_back import Reposition
    from vvvaltr.controller.runs.attended import Attended
    from vvvaltr.controller.view.showing import show_learning

    counted = [logged for logged in run.trials if logged.suggestion.phase is not Phase.REFERENCE]
    done = sum(logged.score is not None for logged in counted)
    with ExitStack() as stack:
        view = open_live_view(arguments, stack, lambda: show_learning(run))
        operator = _operator(run, arguments, stack)
        clear = operator.clear if operator else None
        progress = stack.enter_context(closing(TrialProgress(arguments, run.config.trials, done, clear)))
        reposition = Reposition(arguments.reposition) if arguments.reposition else None
        attended = Attended(operator, reposition, not arguments.no_hand, arguments.park_after)
        all_observers = [*observers, *([view] if view else []), _Warnings(progress)]
        for logged in run.learn(all_observers, view.watch if view else None, attended):
            progress.tell(logged)


def _operator(run: RunDirectory, arguments: Namespace, stack: ExitStack) -> TerminalOperator | None:
    """Return the person at the terminal, None where nobody is to be asked."""
    is_asked = is_at_keyboard() and not run.config.robot.is_twin if arguments.attended is None else arguments.attended
    return TerminalOperator(stack.enter_context(raw_keyboard(sys.stdin.fileno()))) if is_asked else None


class _Warnings:
    """The observer that tells warnings, but for failed trials, which the loop tells."""

    def __init__(self, progress: TrialProgress) -> None:
        self._progress = progress

    def on_trial(self, logged: LoggedTrial) -> None:
        """Do nothing: the loop tells of trials."""

    def on_event(self, event: Event) -> None:
        """Tell a warning."""
        if event.kind is EventKind.WARNING and not event.text.startswith("trial "):
            self._progress.warn(event.text)


def _save_recording(run: Path, arguments: Namespace) -> None:
    from vvvaltr.controller.view.showing import save_run

    say(arguments, "writing the Rerun recording")
    try:
        save_run(run, run / "run.rrd")
    except UserError as error:  # the trials and the summary are safe
        say(arguments, f"no Rerun recording: {error}; the run is saved, and vvvaltr view {run} shows it")


def _prose(result: dict[str, Any]) -> str:
    from vvvaltr.controller.loop.summary import tell_causes

    outcomes = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in result["outcomes"].items())
    lines = (
        *_prose_of_best(result),
        f"trials     {result['trials']}" + (f" ({outcomes})" if outcomes else ""),
        f"run        {result['run']}",
        f"view it    vvvaltr view {result['run']}" + ("" if has_rerun() else ' (needs pip install "vvvaltr[rerun]")'),
    )
    return "\n".join((*lines, *(f"{word:10} {sentence}" for word, sentence in tell_causes(result))))


def _prose_of_best(result: dict[str, Any]) -> tuple[str, ...]:
    best = result["recommended"]
    if result["best_observed"] is None:
        return ("best gait  not known: no trial has measured anything yet",)
    if best is None:
        return ("best gait  not known: this method has no model; --confirm KxR repeats the best K gaits to find out",)
    is_unknown = is_vague(best["mean_m_s"], best["low_m_s"], best["high_m_s"])
    return (
        f"best gait  {' '.join(f'{frequency:.2f}' for frequency in best['gait_hz'])} Hz"
        f"{', but not known yet: make more trials' if is_unknown else ''}",
        f"speed      {_mm_s(best['mean_m_s'])} mm/s (posterior mean), "
        f"95 % interval {_mm_s(best['low_m_s'])} to {_mm_s(best['high_m_s'])} mm/s",
    )


def _mm_s(speed_m_s: float) -> str:
    return f"{1000.0 * speed_m_s:.1f}"


COMMAND = Subcommand(
    help="find a fast gait in few trials",
    example="vvvaltr learn --robot planar --trials 40 --seed 1 --out runs/flat",
    add_arguments=_add_arguments,
    execute=_execute,
    details=lambda: {**method_details(), **score_details(), "keys": KEY_DETAILS},
)
