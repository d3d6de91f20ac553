"""`vvvaltr experiment`: the thesis' experiments, repeated until chance is ruled out."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import TWINS, heading_limit, method_details, number, whole
from vvvaltr.controller.cli.parser import Details
from vvvaltr.controller.cli.telling import bar, counted
from vvvaltr.controller.core.errors import NotUnderstood
from vvvaltr.controller.core.spelling import unknown

if TYPE_CHECKING:
    from vvvaltr.transfer.experiments.findings import PairFindings
    from vvvaltr.transfer.experiments.unit import Settings


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("experiment", metavar="NAME", help="1 (with 1b), 2 (with 2-friction), 3, thesis (these "
                        "three), controls or all; or one of 1b, 2-friction, unrelated, inverted, shuffled")  # fmt: skip
    parser.add_argument("--out", type=Path, metavar="DIR", help="directory of the campaign; an interrupted one "
                        "continues there (default runs/experiments-ROBOT)")  # fmt: skip
    group = parser.add_argument_group("campaign")
    group.add_argument("--robot", choices=TWINS, default="planar", metavar="NAME",
                       help="twin: planar or spatial (default planar)")  # fmt: skip
    group.add_argument("--repeats", type=whole(1), default=10, metavar="N",
                       help="number of repeats, each with its own seeds (default 10)")  # fmt: skip
    group.add_argument("--methods", type=lambda text: tuple(text.split(",")), metavar="NAME,...",
                       help="methods to compare with Plain-BO (default all)")  # fmt: skip
    group.add_argument("--signed", action="store_true", help="let the motors also turn in reverse")
    group.add_argument("--seed", type=whole(0), default=0, metavar="N",
                       help="seed of every random stream (default 0)")  # fmt: skip
    group.add_argument("--scatter", metavar="CAUSES",
                       help="causes of scatter: careful (default), hurried, none or frequency")  # fmt: skip
    group.add_argument("--heading-limit", dest="heading_limit_rad", type=heading_limit, metavar="RAD",
                       help="end a trial when the robot has turned further, in rad (default inf: never)")  # fmt: skip
    group = parser.add_argument_group("size of each run, smaller for a quick look")
    group.add_argument("--duration", dest="duration_s", type=number(low=0.1), default=5.0, metavar="S",
                       help="time that the motors are driven in a trial, in s (default 5)")  # fmt: skip
    group.add_argument("--starts", type=whole(1), default=20, metavar="N",
                       help="number of fresh starts in the mean of a true speed (default 20)")  # fmt: skip
    group.add_argument("--trials", type=whole(1), default=0, metavar="N",
                       help="greatest number of trials (default 40, in experiment 2 50)")  # fmt: skip
    group = parser.add_argument_group("computers")
    where = group.add_mutually_exclusive_group()
    where.add_argument("--jobs", type=whole(1), default=1, metavar="N",
                       help="number of processes on this computer (default 1)")  # fmt: skip
    where.add_argument("--scheduler", metavar="ADDRESS", help="address of a Dask cluster, tcp://HOST:8786")


def _details() -> Details:
    from vvvaltr.transfer.experiments.thesis import list_pairs

    return {"experiments (NAME)": {pair.key: pair.title for pair in list_pairs("planar")}, **method_details()}


def _execute(arguments: Namespace) -> Answer:
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.core.processes import processes
    from vvvaltr.transfer.experiments.campaign import list_transfer_methods, run_campaign
    from vvvaltr.transfer.experiments.cluster import cluster
    from vvvaltr.transfer.experiments.findings import as_json, gather_findings
    from vvvaltr.transfer.experiments.store import Store
    from vvvaltr.transfer.experiments.thesis import find_pairs
    from vvvaltr.transfer.experiments.unit import open_condition

    with one_line_errors():
        pairs = find_pairs(arguments.robot, arguments.experiment)
    methods = arguments.methods or list_transfer_methods()
    if "plain" in methods:
        raise NotUnderstood("--methods: leave out plain: every experiment has it, to compare the others with")
    if strangers := set(methods) - set(list_transfer_methods()):
        raise NotUnderstood(f"--methods: {unknown('method', min(strangers), list_transfer_methods())}")
    out = arguments.out or Path("runs") / f"experiments-{arguments.robot}{'-signed' * arguments.signed}"
    with one_line_errors():
        settings = _settings(arguments, out)
        robot, _ = open_condition(settings, pairs[0].target, settings.seed)  # here, before anything is written
        robot.close()
    with cluster(arguments.scheduler) if arguments.scheduler else processes(arguments.jobs) as executor:
        store = Store.begin(out, settings)
        try:
            with one_line_errors():
                run_campaign(store, pairs, arguments.repeats, methods, executor, partial(_progress, arguments))
        except KeyboardInterrupt:
            raise KeyboardInterrupt("the finished runs are saved: the same command continues the campaign") from None
    found = gather_findings(store, pairs)
    return Answer(_prose(found, out), {"experiments": as_json(found), "out": str(out)})


def _settings(arguments: Namespace, out: Path) -> Settings:
    """Return what was asked for; what was not, and is newer than the campaign in ``out``, as it is there."""
    from vvvaltr.transfer.experiments.store import Store
    from vvvaltr.transfer.experiments.unit import LONGEST_S, Settings

    if arguments.duration_s > LONGEST_S:
        raise NotUnderstood(f"--duration is {arguments.duration_s:g}; allowed: 0.1 to {LONGEST_S:g}")
    begun = Store.open(out).settings if (out / "campaign.toml").exists() else Settings()
    return Settings(
        robot=arguments.robot,
        signed=arguments.signed,
        seed=arguments.seed,
        duration_s=arguments.duration_s,
        starts=arguments.starts,
        most_trials=arguments.trials,
        scatter=arguments.scatter or begun.scatter,
        heading_limit_rad=arguments.heading_limit_rad or begun.heading_limit_rad,
    )


def _progress(arguments: Namespace, units: Iterable[Any], total: int) -> Iterable[Any]:
    return bar(arguments, units, total=total, unit="run", desc="experiment", is_needed=total > 0)


def _prose(found: Sequence[PairFindings], out: Path) -> str:
    lines = ["true mean speed of the recommended gait after the last trial, compared with Plain-BO; p after Holm"]
    for it in found:
        speed_mm_s = 1000.0 * it.plain.runs.mean_true_m_s[-1]
        repeats = counted(it.repeats, "repeat")
        lines.append(f"{it.pair.key}: {it.pair.title}; {repeats}; Plain-BO {speed_mm_s:.1f} mm/s")
        for name, method in it.methods.items():
            if name != "plain":
                end = method.against_plain[-1]
                sure = "(one repeat has no interval)"
                if (interval := end.interval_percent) is not None:
                    sure = f"({interval.low:+.0f} to {interval.high:+.0f} %)  p {method.p_holm[-1]:.3f}"
                lines.append(f"  {name:12} {end.gain_percent:+6.1f} % {sure}")
    return "\n".join([*lines, f"figures: vvvaltr report {out}"])


COMMAND = Subcommand(
    help="repeat the thesis' experiments on a twin, every method against Plain-BO",
    example="vvvaltr experiment all --robot planar --repeats 10 --jobs 2 --out runs/thesis",
    add_arguments=_add_arguments,
    execute=_execute,
    details=_details,
)
