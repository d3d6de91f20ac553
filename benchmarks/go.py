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
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.figures import make_parser

if TYPE_CHECKING:
    from vvvaltr.controller.core.gaits import Gait
    from vvvaltr.controller.core.protocols import Robot
    from vvvaltr.controller.core.values import Trial
    from vvvaltr.controller.loop.steersman import Steersman
    from vvvaltr.transfer.steering.repertoire import Repertoire

RADIUS_M, BUDGET_S = 0.30, 200.0
SEED = 11
WORLDS = {
    "level": "flat",
    "inclined 0.02": "slope:angle_rad=0.02",
    "inclined 0.05": "slope:angle_rad=0.05",
    "hills": "hills:height_m=0.01,wavelength_m=0.3,seed=1",
    "damaged": "flat",
    "hurried": "flat",
    "hurried anew": "flat",
    "slow motors": "flat",
}
DAMAGE = {"icosahedron6": ("snap:4,18", "lighten:3:0.5"), "prism3": ("snap:4", "lighten:2:0.5")}
BODIES = tuple(DAMAGE)
SLOW_HZ = 16.7


@dataclass(frozen=True, slots=True)
class Case:
    """One figure: a body in a world, how it is steered, and how many goals; a square is four goals in a row."""

    body: str
    world: str
    method: str
    goals: int
    squares: bool = False

    @property
    def name(self) -> str:
        """Name of the figure."""
        return f"{self.body} {self.world} {'squares ' if self.squares else ''}{self.method}"


def cases(goals: int) -> Iterator[Case]:
    """Return the figures in the order of their weight."""
    worlds = ("level", "inclined 0.05", "damaged", "hills", "hurried")
    both = [
        *((world, "cold") for world in worlds),
        *((world, "carried") for world in worlds),
        *(("inclined 0.02", method) for method in ("cold", "carried")),
    ]
    yield from (Case(body, world, method, goals) for world, method in both for body in BODIES)
    few, fewest = max(1, goals // 2), max(1, goals // 4)
    for world, methods in (
        ("level", ("truth", "two", "fixed", "fastest")),
        ("inclined 0.05", ("truth", "fixed", "two")),
        ("damaged", ("fixed", "two", "fastest")),
    ):
        yield from (Case("icosahedron6", world, method, few) for method in methods)
    yield from (Case(body, "level", "carried", few if goals >= 40 else fewest, True) for body in BODIES)
    yield Case("icosahedron6", "slow motors", "cold", fewest)
    yield from (Case(body, "hurried anew", "cold", goals) for body in BODIES)


def make_robot(case: Case, seed: int = SEED + 100) -> Robot:
    """Return the robot of a case."""
    from vvvaltr.twin.presets import spatial_robot
    from vvvaltr.twin.scatter import CAREFUL, HURRIED
    from vvvaltr.twin.world import parse_world

    damage = DAMAGE[case.body] if case.world == "damaged" else ()
    # Put back before each goal, and nowhere else.
    scatter = HURRIED.put_back() if "hurried" in case.world else CAREFUL
    twin = spatial_robot(case.body, parse_world(WORLDS[case.world]), damage, seed=seed, scatter=scatter)
    setattr(twin.engine, "forces", lambda: None)  # noqa: B010  nobody looks at them here
    return twin


@cache
def trials_of(body: str, range_hz: tuple[float, float]) -> tuple[Trial, ...]:
    """Return the forty trials from which the intact robot's movements are known."""
    from vvvaltr.controller.core.streams import stream
    from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
    from vvvaltr.transfer.steering.lacking import next_gait
    from vvvaltr.transfer.steering.repertoire import learn_repertoire
    from vvvaltr.twin.presets import spatial_robot

    robot = spatial_robot(body, seed=SEED)
    trials: list[Trial] = []
    for number in range(1, 41):
        random = stream(SEED, number, "repertoire")
        gait = next_gait(learn_repertoire([trials]), range_hz, robot.motors.motor_count, random).gait
        trials.append(run_trial(robot, gait, TrialSettings(heading_limit_rad=None), number))
    return tuple(trials)


def repertoire_of(case: Case) -> Repertoire:
    """Return the movements that a case begins with."""
    from vvvaltr.transfer.steering.repertoire import learn_repertoire

    range_hz = (5.0, SLOW_HZ if case.world == "slow motors" else 50.0)
    repertoire = learn_repertoire([trials_of(case.body, range_hz)])
    if case.method == "two":
        from vvvaltr.controller.loop.jog import Key, choose_movements

        chosen = choose_movements(repertoire)
        turning = max((chosen[key] for key in (Key.LEFT, Key.RIGHT) if key in chosen),
                      key=lambda gait: abs(repertoire.velocities[repertoire.gaits.index(gait), 2]))  # fmt: skip
        kept = {_straightest(repertoire), turning}
        return replace(repertoire, movements=tuple(m for m in repertoire.movements if m.gait in kept))
    return repertoire


def _straightest(repertoire: Repertoire) -> Gait:
    """Return the gait that gets farthest from its start in 5 s."""
    import numpy as np

    from vvvaltr.transfer.steering.arcs import travel

    chord_m, _ = travel(repertoire.velocities, np.full(len(repertoire.gaits), 5.0))
    return repertoire.gaits[int(np.argmax(np.hypot(chord_m[:, 0], chord_m[:, 1])))]


def trials_of_truth(case: Case, gaits: Iterable[Gait]) -> list[Trial]:
    """Return four trials of each gait where the case takes place, one in each direction."""
    from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial

    robot, settings = make_robot(case), TrialSettings(duration_s=3.0, heading_limit_rad=None)
    each = [gait for gait in gaits for _ in range(4)]
    return [run_trial(_Turned(robot, number), gait, settings, 41 + number) for number, gait in enumerate(each)]


def bearings(case: Case) -> list[tuple[tuple[float, float], ...]]:
    """Return what the robot is sent to each time: one goal, or the corners of a square.

    Each bearing is the golden angle from the one before, so that any number of them is spread evenly.
    """
    import numpy as np

    turned = np.random.default_rng(SEED).uniform(0.0, math.tau)
    angles = [turned + goal * math.pi * (3.0 - math.sqrt(5.0)) for goal in range(case.goals)]
    if case.squares:
        corners = ((1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0))
        return [
            tuple((RADIUS_M * (x * math.cos(a) - y * math.sin(a)), RADIUS_M * (x * math.sin(a) + y * math.cos(a)))
                  for x, y in corners)
            for a in angles
        ]  # fmt: skip
    return [((RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle)),) for angle in angles]


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
        return _fastest(robot, _straightest(repertoire_of(case)), goals[0], first)
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
    trial = run_trial(_Staying(robot), gait, settings, first)
    away = [(math.hypot(p.position_m[0] - goal[0], p.position_m[1] - goal[1]), p.t_s) for p in trial.poses]
    by_s = next((t_s for distance_m, t_s in away if distance_m <= 0.02), None)
    return {
        "reached": by_s is not None,
        "reason": "",
        "time_s": by_s or BUDGET_S,
        "primitives": 1,
        "error_m": away[-1][0],
    }


class _Staying:
    """A robot that is ready as it is."""

    def __init__(self, robot: Any) -> None:
        self.motors, self.tracker, self.clock = robot.motors, robot.tracker, robot.clock
        self.structure, self.carry_on, self.close = robot.structure, robot.carry_on, robot.close

    def place(self, trial: int) -> None:
        """Begin where the robot is."""
        self.carry_on(trial)


class _Turned(_Staying):
    """A robot that is put down with another heading, a quarter turn further each time."""

    def __init__(self, robot: Any, quarters: int) -> None:
        super().__init__(robot)
        self._put_down, self._yaw_rad = robot.put_down, math.remainder(0.5 * math.pi * quarters, math.tau)

    def place(self, trial: int) -> None:
        """Put the robot down."""
        from vvvaltr.twin.engine import Start

        self._put_down(Start(0.0, 0.0, self._yaw_rad, 0.0))
        self.carry_on(trial)


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
