"""A unit of work: one run of learning in one condition, and the true speeds of the gaits that it recommended."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache
from statistics import fmean, stdev

import msgspec

from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Source
from vvvaltr.controller.loop.learn import learn
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.safety import GuardedRobot, Limits
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.trial_runner import TrialCrashed, TrialSettings, run_trial
from vvvaltr.transfer.experiments.thesis import BODIES, Condition
from vvvaltr.transfer.methods.registry import make_optimizer
from vvvaltr.twin.presets import TWINS
from vvvaltr.twin.scatter import parse_scatter

TRUTH_PERIOD_S = 0.1
"""Period of commands while a true speed is measured: a fifth less work than with the usual 0.05 s."""

LONGEST_S = 3600.0
"""Longest duration of a trial; anything longer is probably a mistake."""


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What all units of a campaign have in common. A campaign with another value is another campaign.

    Args:
        robot: name of the twin, ``planar`` or ``spatial``.
        signed: whether motors may also turn backwards. Frequencies then go from minus the twin's highest to its
            highest, instead of from its lowest to its highest.
        seed: seed of every random stream.
        duration_s: duration of a trial.
        starts: number of fresh starts whose mean is a recommended gait's true speed.
        most_trials: greatest number of trials in a run; 0 for the experiments' own.
        scatter: what differs from trial to trial, as on the command line; ``frequency`` in campaigns of version 0.1.
        heading_limit_rad: greatest change of heading in a trial, infinite for any; 1 in campaigns of version 0.1.

    Raises:
        ValueError: a value is out of range.
    """

    robot: str = "planar"
    signed: bool = False
    seed: int = 0
    duration_s: float = 5.0
    starts: int = 20
    most_trials: int = 0
    scatter: str = "careful"
    heading_limit_rad: float = math.inf

    def __post_init__(self) -> None:
        if self.robot not in BODIES:
            raise ValueError(f"robot is {self.robot!r}; allowed: {', '.join(BODIES)}")
        if not 0.1 <= self.duration_s <= LONGEST_S:
            raise ValueError(f"duration_s is {self.duration_s:g}; allowed: 0.1 to {LONGEST_S:g}")
        for key, low in {"seed": 0, "starts": 1, "most_trials": 0}.items():
            if getattr(self, key) < low:
                raise ValueError(f"{key} is {getattr(self, key)}; allowed: {low} or more")
        if not self.heading_limit_rad > 0.0:
            raise ValueError(f"heading_limit_rad is {self.heading_limit_rad:g}; allowed: above 0")
        parse_scatter(self.scatter, TWINS[self.robot].frequency_scatter)


@dataclass(frozen=True, slots=True)
class Unit:
    """One run of learning.

    Args:
        condition: body, world and damage.
        method: name of the method.
        trials: number of trials.
        repeat: repeat of the experiment, counted from 1. Its units have other seeds than those of other repeats.
        role: role of the run in its repeat. The seed derives from it, so that runs of the same role are paired.
        checkpoints: trials after which the true speed of the recommended gait is measured.
        source: run to learn from; None for none.
        inverted: whether the source's scores are turned upside down.
        shuffled: whether the source's scores are dealt out by the strength of its gaits.
    """

    condition: Condition
    method: str
    trials: int
    repeat: int
    role: str
    checkpoints: tuple[int, ...] = ()
    source: Unit | None = None
    inverted: bool = False
    shuffled: bool = False

    @property
    def name(self) -> str:
        """Name, unique within a campaign; also the path of the unit's file."""
        twist = "-inverted" * self.inverted + "-shuffled" * self.shuffled
        origin = f"-from-{self.source.condition.name}{twist}" if self.source else ""
        return f"{self.condition.name}-{self.trials}/{self.method}{origin}/{self.repeat:03}-{self.role}"


class Step(msgspec.Struct, frozen=True, tag="trial", tag_field="kind"):
    """A valid trial, and the gait recommended after it with the 95 % interval of its mean speed."""

    gait_hz: tuple[float, ...]
    score_m_s: float
    recommended_hz: tuple[float, ...]
    mean_m_s: float
    low_m_s: float
    high_m_s: float


class Truth(msgspec.Struct, frozen=True, tag="true", tag_field="kind"):
    """Speeds of the gait that was recommended after trial ``after``, each from a fresh start."""

    after: int
    speeds_m_s: tuple[float, ...]

    @property
    def mean_m_s(self) -> float:
        """The true mean speed, as accurately as the number of starts allows."""
        return fmean(self.speeds_m_s)

    @property
    def standard_error_m_s(self) -> float:
        """Standard error of the mean; infinite for a single start."""
        starts = len(self.speeds_m_s)
        return stdev(self.speeds_m_s) / math.sqrt(starts) if starts > 1 else math.inf


@dataclass(frozen=True, slots=True)
class Result:
    """The result of a unit: its valid trials in order, and the true speeds at its checkpoints."""

    steps: tuple[Step, ...]
    truths: tuple[Truth, ...]

    def until(self, checkpoints: Sequence[int]) -> Result:
        """Return the result as of the last of ``checkpoints``, with the true speeds at these checkpoints only."""
        return Result(self.steps[: checkpoints[-1]], tuple(it for it in self.truths if it.after in checkpoints))

    def source(self, name: str, inverted: bool, shuffled: bool = False) -> Source:
        """Return the run as a source.

        ``inverted`` mirrors its scores between the lowest and the highest. ``shuffled`` deals them out by the sum of
        the motors' speeds: the best score to the gait with the greatest sum, and so on.
        """
        scores = [step.score_m_s for step in self.steps]
        if shuffled:
            strengths = [sum(map(abs, step.gait_hz)) for step in self.steps]
            ranks = sorted(range(len(scores)), key=strengths.__getitem__)
            by_gait = dict(zip(ranks, sorted(scores), strict=True))
            scores = [by_gait[number] for number in range(len(scores))]
        if inverted:
            scores = [min(scores) + max(scores) - score for score in scores]
        return Source(name, tuple(Gait(step.gait_hz) for step in self.steps), tuple(scores))


def work(settings: Settings, unit: Unit, source: Source | None) -> Result:
    """Do a unit of work. The same unit gives the same result wherever it is done.

    Args:
        settings: settings of the campaign.
        unit: the unit.
        source: trials of the unit's source; None where it has none.

    Raises:
        ValueError: the method cannot use the source.
        RuntimeError: the program failed during a trial, or the twin broke down in all starts of a gait.
    """
    try:
        steps = _learn(settings, unit, source)
        return Result(steps, _measure_truths(settings, unit, steps))
    except TrialCrashed as crash:  # it cannot be pickled, which is how errors travel between processes
        raise RuntimeError(f"{unit.name}: {crash}") from crash.__cause__


def open_condition(
    settings: Settings, condition: Condition, seed: int, for_truth: bool = False
) -> tuple[GuardedRobot, GaitSpace]:
    """Return the robot in a condition, to be closed after use, and the gaits to search.

    Args:
        settings: settings of the campaign.
        condition: body, world and damage.
        seed: seed of the scatter.
        for_truth: whether true speeds are to be measured: on a level floor, from fresh starts, with full strength and
            all motors turning.

    Raises:
        ValueError: the scatter is not understood.
    """
    preset = TWINS[settings.robot]
    scatter = parse_scatter(settings.scatter, preset.frequency_scatter)
    scatter = scatter.level() if for_truth else scatter
    robot = preset.make(condition.body, condition.world, condition.damage, seed=seed, scatter=scatter)
    low_hz, high_hz = robot.range_hz
    space = GaitSpace.over(robot.motors.motor_count, -high_hz if settings.signed else low_hz, high_hz)
    return GuardedRobot(robot, Limits(robot.max_hz)), space


def _learn(settings: Settings, unit: Unit, source: Source | None) -> tuple[Step, ...]:
    seed = _seed(settings, unit.repeat, unit.role)
    robot, space = open_condition(settings, unit.condition, seed)
    optimizer = make_optimizer(unit.method, space, seed, [source] if source else [])
    trial_settings = TrialSettings(settings.duration_s, heading_limit_rad=settings.heading_limit_rad)
    trials: list[LoggedTrial] = []
    with closing(robot):
        for _ in learn(robot, optimizer, trial_settings, Budget(unit.trials), trials.append):
            pass
    return tuple(_step(logged) for logged in trials if logged.score is not None)


def _step(logged: LoggedTrial) -> Step:
    assert logged.score is not None and logged.recommendation is not None  # a valid trial has both
    best, belief = logged.recommendation.gait, logged.recommendation.estimate
    gait_hz = logged.trial.gait.frequency_hz
    return Step(gait_hz, logged.score, best.frequency_hz, belief.mean, belief.low, belief.high)


def _measure_truths(settings: Settings, unit: Unit, steps: Sequence[Step]) -> tuple[Truth, ...]:
    """Return the true speeds at the checkpoints."""
    recommended = {after: steps[after - 1].recommended_hz for after in unit.checkpoints}
    truths = tuple(
        Truth(after, _measure_speeds_m_s(settings, unit.condition, unit.repeat, gait_hz))
        for after, gait_hz in recommended.items()
    )
    for truth in truths:
        if not truth.speeds_m_s:
            raise RuntimeError(f"{unit.name}: no start of the gait recommended after trial {truth.after} was valid")
    return truths


@lru_cache(maxsize=1000)  # checkpoints and runs of a repeat often recommend the same gait
def _measure_speeds_m_s(
    settings: Settings, condition: Condition, repeat: int, gait_hz: tuple[float, ...]
) -> tuple[float, ...]:
    """Return the speeds of a gait in m/s. All gaits of a repeat have the same starts."""
    robot, _ = open_condition(settings, condition, _seed(settings, repeat, "true speed"), for_truth=True)
    limit_rad = settings.heading_limit_rad
    trial_settings = TrialSettings(settings.duration_s, period_s=TRUTH_PERIOD_S, heading_limit_rad=limit_rad)
    with closing(robot):
        starts = [run_trial(robot, Gait(gait_hz), trial_settings, start + 1) for start in range(settings.starts)]
    return tuple(score(trial) for trial in starts if trial.outcome.is_valid)


def _seed(settings: Settings, repeat: int, role: str) -> int:
    return int(stream(settings.seed, repeat, role).integers(2**31))
