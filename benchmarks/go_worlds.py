"""The figures of ``benchmarks.go``: which body goes where in which world, and with what repertoire it begins."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vvvaltr.controller.core.gaits import Gait
    from vvvaltr.controller.core.protocols import Robot
    from vvvaltr.controller.core.values import Trial
    from vvvaltr.transfer.steering.repertoire import Repertoire

RADIUS_M = 0.30
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
        kept = {straightest(repertoire), turning}
        return replace(repertoire, movements=tuple(m for m in repertoire.movements if m.gait in kept))
    return repertoire


def straightest(repertoire: Repertoire) -> Gait:
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


class Staying:
    """A robot that is ready as it is."""

    def __init__(self, robot: Any) -> None:
        self.motors, self.tracker, self.clock = robot.motors, robot.tracker, robot.clock
        self.structure, self.carry_on, self.close = robot.structure, robot.carry_on, robot.close

    def place(self, trial: int) -> None:
        """Begin where the robot is."""
        self.carry_on(trial)


class _Turned(Staying):
    """A robot that is put down with another heading, a quarter turn further each time."""

    def __init__(self, robot: Any, quarters: int) -> None:
        super().__init__(robot)
        self._put_down, self._yaw_rad = robot.put_down, math.remainder(0.5 * math.pi * quarters, math.tau)

    def place(self, trial: int) -> None:
        """Put the robot down."""
        from vvvaltr.twin.engine import Start

        self._put_down(Start(0.0, 0.0, self._yaw_rad, 0.0))
        self.carry_on(trial)
