"""How often, and how soon, a robot on the spatial twin gets where it is told.

    python -m benchmarks.go --json --out runs/go-figures.jsonl

Goals lie on a circle of 0.30 m around the start and are reached within 20 mm; each may take 200 s of driving. The time
of a goal is that of the robot's clock, pauses included. The repertoire is learned on level ground by the intact robot,
in 40 trials of 5 s. *cold*: every goal begins with it. *carried*: what was learned on the way to one goal is kept for
the next.

The twin scatters as a careful laboratory does, in "hurried" as a hurried one: there the robot of the last goals has
made hundreds of trials, and strength that it lost does not come back. In "hurried anew" each goal has a robot of its
own, which has made the forty trials of the repertoire.

Baselines with the same seeds: the repertoire as it was learned (fixed), its fastest gait alone, its straightest and its
best turning movement alone (two), and a planner that knows each movement by four trials where it goes, in four
directions (truth).

Each goal is written to the file of ``--out`` when it is done, and what the file has is not measured again: a benchmark
that was ended goes on, and with more ``--goals`` it adds to what there is. ``--list`` names the figures, and
``--only NAME`` measures those with this in their names.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.figures import make_parser
from benchmarks.go_worlds import (
    SEED,
    Case,
    Staying,
    bearings,
    cases,
    make_robot,
    repertoire_of,
    straightest,
    trials_of_truth,
)

if TYPE_CHECKING:
    from vvvaltr.controller.core.gaits import Gait
    from vvvaltr.controller.core.protocols import Robot
    from vvvaltr.controller.loop.steersman import Steersman

BUDGET_S = 200.0


def measure(case: Case, done: int) -> Iterator[dict[str, Any]]:
    """Send the robot to the goals of a case; yields what came of each that is not done yet.

    What is carried over comes from all goals before, so that these are driven again.
    """
    from vvvaltr.controller.loop.steersman import Steersman
    from vvvaltr.controller.loop.trial_runner import TrialSettings

    repertoire, robot = repertoire_of(case), make_robot(case)
    settings = TrialSettings(heading_limit_rad=None)
    steersman = Steersman(repertoire, SEED, None, settings.settle_s)
    for trial in trials_of_truth(case, repertoire.gaits) if case.method == "truth" else ():
        steersman.learn(trial)
    if case.method in ("fixed", "two", "truth"):
        setattr(steersman, "learn", lambda trial: None)  # noqa: B010
    for index, goals in enumerate(bearings(case)):
        if index < done and case.method != "carried":
            continue
        if case.method == "cold":
            steersman = Steersman(repertoire, SEED, None, settings.settle_s)
        # A robot ages from trial to trial: these come soon after those of the repertoire.
        first = 41 + 20 * index
        if case.world == "hurried anew":
            robot, first = make_robot(case, SEED + 200 + index), 41
        result = _send(case, robot, steersman, goals, first)
        if index >= done:
            yield {"case": case.name, "goal": index, **result}


def _send(case: Case, robot: Robot, steersman: Steersman, goals: tuple[tuple[float, float], ...], first: int) -> Any:
    from vvvaltr.controller.loop.go import Journey
    from vvvaltr.controller.loop.trial_runner import TrialSettings
    from vvvaltr.transfer.steering.planner import Goal

    settings = TrialSettings(heading_limit_rad=None)
    robot.place(first)
    begin_s = robot.clock.now_s()
    if case.method == "fastest":
        return _fastest(robot, straightest(repertoire_of(case)), goals[0], first)
    journey = Journey(robot, steersman, [Goal(*goal) for goal in goals], settings, BUDGET_S, lambda logged: None)
    for _ in journey.go(first):
        pass
    ending = journey.ending
    return {
        "reached": ending.reached,
        "reason": ending.reason,
        "time_s": round(robot.clock.now_s() - begin_s, 2),
        "primitives": ending.primitives,
        "error_m": round(ending.error_m, 4),
    }


def _fastest(robot: Robot, gait: Gait, goal: tuple[float, float], first: int) -> dict[str, Any]:
    """Drive one gait for the time that a goal may take, and see whether it comes by."""
    from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial

    settings = TrialSettings(duration_s=BUDGET_S, heading_limit_rad=None)
    trial = run_trial(Staying(robot), gait, settings, first)
    away = [(math.hypot(p.position_m[0] - goal[0], p.position_m[1] - goal[1]), p.t_s) for p in trial.poses]
    by_s = next((t_s for distance_m, t_s in away if distance_m <= 0.02), None)
    return {
        "reached": by_s is not None,
        "reason": "",
        "time_s": by_s or BUDGET_S,
        "primitives": 1,
        "error_m": away[-1][0],
    }


def decision_ms() -> dict[str, float]:
    """Return how long a plan takes with 40 movements, in processor time, which a busy machine does not disturb much."""
    import numpy as np

    from vvvaltr.transfer.steering.planner import Abilities, Border, Goal, plan

    random, times_ms = np.random.default_rng(SEED), []
    for _ in range(200):
        velocities = random.normal(0.0, [0.008, 0.008, 0.3], (40, 3))
        floor = np.hstack([random.normal(0.0, 0.1, (40, 2)), random.normal(0.0, 0.003, (40, 2))])
        able = Abilities(velocities, np.abs(0.4 * velocities), floor, 0.2, 0.3)
        goal = Goal(*random.uniform(-0.3, 0.3, 2))
        begin_s = time.thread_time()
        plan(np.zeros(3), goal, able, Border((-0.5, 0.5), (-0.5, 0.5)), np.append(velocities[0], floor[0]))
        times_ms.append(1000.0 * (time.thread_time() - begin_s))
    return {"decision_ms": round(float(np.median(times_ms)), 1),
            "decision_p99_ms": round(float(np.quantile(times_ms, 0.99)), 1)}  # fmt: skip


def figures(results: list[dict[str, Any]], names: list[str]) -> dict[str, Any]:
    """Return how many goals were reached and their median time; one that was not counts as the longest."""
    import numpy as np

    found: dict[str, Any] = {}
    for name in names:
        of_case = sorted((r for r in results if r["case"] == name), key=lambda r: r["goal"])
        if of_case:
            times = [r["time_s"] if r["reached"] else math.inf for r in of_case]
            median = float(np.median(times))
            found[name] = {
                "goals": len(of_case),
                "reached": sum(r["reached"] for r in of_case),
                "median_s": round(median, 1) if math.isfinite(median) else None,
                "median_primitives": float(np.median([r["primitives"] for r in of_case])),
                "first_s": times[0] if math.isfinite(times[0]) else None,
            }
    return found


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument("--goals", type=int, default=40, help="goals of each figure, half of them for the baselines")
    parser.add_argument("--only", default="", help="only figures whose name has this in it")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("runs/go-figures.jsonl"),
        help="file of the results, which goes on where it ended",
    )
    parser.add_argument("--list", action="store_true", help="measure nothing: name the figures")
    parser.add_argument("--show", action="store_true", help="measure nothing: show what the file has")
    arguments = parser.parse_args()
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    results = [json.loads(line) for line in arguments.out.read_text().splitlines()] if arguments.out.exists() else []
    chosen = [case for case in cases(arguments.goals) if arguments.only in case.name]
    if arguments.list:
        print("\n".join(f"{case.name} ({case.goals} {'squares' if case.squares else 'goals'})" for case in chosen))
        return
    for case in () if arguments.show else chosen:
        done = sum(result["case"] == case.name for result in results)
        if done < case.goals:
            with arguments.out.open("a") as file:
                for result in measure(case, done):
                    results.append(result)
                    file.write(json.dumps(result) + "\n")
                    file.flush()
        print(case.name, figures(results, [case.name]), flush=True)
    found = {**decision_ms(), **figures(results, [case.name for case in chosen])}
    for name, figure in found.items():
        print(f"{name:48} {figure}")
    if arguments.json:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
