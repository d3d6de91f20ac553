"""Who chooses movements, learns from them, and decides within one whether it is to go on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.errors import SafetyStop
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Outcome, Pose, Trial
from vvvaltr.controller.loop.safety import Guard
from vvvaltr.controller.loop.thinking import Thinking
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.transfer.steering.belief import Belief, facing
from vvvaltr.transfer.steering.hypotheses import Knowledge
from vvvaltr.transfer.steering.passage import passage, where
from vvvaltr.transfer.steering.planner import DURATIONS_S, Abilities, Border, Goal, Plan, plan
from vvvaltr.transfer.steering.repertoire import Repertoire
from vvvaltr.transfer.steering.tube import Tube

Array = NDArray[np.float64]

_FIRST_LOOK_S = DURATIONS_S[0]  # into a primitive, before which its own velocity is not known
_BETWEEN_S = 0.4
_DARING = 0.5  # share of what is not known that a plan may hope for
_NEAR = 0.85  # of the tolerance, within which a primitive ends: the robot rolls on a little


@dataclass(frozen=True, slots=True)
class Onward:
    """What to do within a primitive.

    Args:
        way: the best plan; its first step is -1 where the movement is to go on.
        t_s: time in the drive from which it holds.
        tube: where the movement leads if it goes on.
    """

    way: Plan
    t_s: float
    tube: Tube


class Steersman:
    """Chooses movements by what is known, and learns from every one that was driven.

    Args:
        repertoire: the movements.
        seed: of what is drawn.
        border: that no plan crosses.
        pause_s: time between two movements.
    """

    def __init__(self, repertoire: Repertoire, seed: int, border: Border | None, pause_s: float) -> None:
        self.knowledge = Knowledge(repertoire)
        self.gaits = repertoire.gaits
        self._delay_s = repertoire.delay_s
        self._seed, self._border, self._pause_s = seed, border, pause_s
        self._place = {gait: index for index, gait in enumerate(self.gaits)}

    @property
    def turns(self) -> bool:
        """Whether any movement turns at all; on a line none does."""
        return bool(self.knowledge.likely.movements[:, 2].any())

    @property
    def fastest_m_s(self) -> float:
        """Speed of the fastest movement, as far as is known."""
        return float(np.hypot(*self.knowledge.likely.movements[:, :2].T).max(initial=0.0))

    def begin(self, number: int) -> None:
        """Draw, for primitive ``number``, what its plans take the movements for."""
        random = stream(self._seed, number, "steering")
        self._belief = self.knowledge.draw(random)
        velocities, floor = self._drawn(self._belief, random)
        deviations = np.hypot(self._belief.scatter, self._belief.deviations)
        self._able = Abilities(velocities, deviations, floor, self._delay_s, self._pause_s)

    def plan(self, at: Array, goal: Goal) -> Plan:
        """Return the way from a pose (3,) to the goal."""
        return plan(at, goal, self._able, self._border)

    def tube(self, movement: int, at: Array) -> Tube:
        """Return where a drive that begins at a pose (3,) leads if the movement is what the plans take it for.

        It is as wide as trials of known movements scatter. A movement of which less is known than one trial could tell
        is hoped for by the plans, and watched the more closely, so that one that disappoints is soon found out.
        """
        belief, able = self._belief, self._able
        scatter, deviations = belief.scatter[movement], belief.deviations[movement]
        usual = np.hypot(scatter, np.minimum(deviations, scatter))
        width = usual / np.maximum(deviations / np.maximum(scatter, 1e-9), 1.0)
        mean = facing(float(at[2])) @ np.append(able.velocities[movement], able.floor[movement])
        return Tube(at, 0.0, self._delay_s, mean, belief.around(movement, width))

    def onward(self, movement: int, poses: Sequence[Pose], goal: Goal) -> Onward:
        """Return the way on from the last of ``poses``."""
        mean, covariance = self._belief.underway(movement, passage(poses))
        at, t_s = where(poses[-1]), poses[-1].t_s
        way = plan(at, goal, self._able, self._border, mean)
        now = facing(float(at[2]))
        return Onward(way, t_s, Tube(at, t_s, 0.0, now @ mean, now @ covariance @ now.T))

    def learn(self, trial: Trial) -> None:
        """Learn from a driven movement."""
        seen = passage(trial.poses)
        if trial.outcome.is_valid and seen is not None and trial.gait in self._place:
            self.knowledge.observe(self._place[trial.gait], seen)

    @staticmethod
    def _drawn(belief: Belief, random: np.random.Generator) -> tuple[Array, Array]:
        """Return movements as they may be, and what the floor adds.

        What is as good as unknown may be hoped to be good.
        What is known as well as one trial could tell is taken for its mean.
        """
        drawn, _ = belief.drawn(random)
        known = (belief.scatter / belief.deviations) ** 2
        hope = _DARING * np.sqrt(np.maximum(1.0 - known, 0.0))
        return belief.movements + hope * (drawn - belief.movements), belief.floor


@dataclass(frozen=True, slots=True)
class PrimitiveSettings(TrialSettings):
    """How a primitive is run: as a trial that a further guard looks at."""

    watch: Guard | None = None

    def guards(self) -> list[Guard]:
        """Return fresh guards."""
        return TrialSettings.guards(self) + ([self.watch] if self.watch else [])


def primitive_settings(settings: TrialSettings, longest_s: float, watch: Guard) -> PrimitiveSettings:
    """Return how a primitive is run: its end is not waited for, its heading is free, and ``watch`` ends it."""
    common = {name: getattr(settings, name) for name in TrialSettings.__dataclass_fields__}
    own = {"duration_s": longest_s, "heading_limit_rad": None, "rest_poses": 0}
    return PrimitiveSettings(**{**common, **own}, watch=watch)


@dataclass(slots=True)
class Watch:
    """Ends a primitive at the goal, or where another movement is better by now.

    That is thought about where the plan ends the primitive, and before where the robot leaves the tube that the drive
    was expected to stay in.

    Args:
        steersman: knows the movements.
        thinking: where it thinks.
        movement: which is driven.
        goal: where to go.
        way: the plan that begins with it.
        at: (3,) where it begins.
    """

    steersman: Steersman
    thinking: Thinking[Onward]
    movement: int
    goal: Goal
    way: InitVar[Plan]
    at: InitVar[Array]
    seen: list[Pose] = field(default_factory=list)
    tube: Tube = field(init=False)
    until_s: float = field(init=False)

    def __post_init__(self, way: Plan, at: Array) -> None:
        self.thinking.forget()
        self.tube = self.steersman.tube(self.movement, at)
        self.until_s = way.steps[0][1]

    def __call__(self, pose: Pose) -> None:
        """Look at one pose. Raises SafetyStop."""
        self.seen.append(pose)
        if self.goal.is_reached(where(pose), _NEAR):
            raise SafetyStop(Outcome.CUT_SHORT, "at the goal")
        if not self.thinking.is_busy and self._is_due(pose):
            seen = tuple(self.seen)
            self.thinking.ask(lambda: self.steersman.onward(self.movement, seen, self.goal))
        if (onward := self.thinking.answer()) is None:
            return
        if not onward.way.steps or onward.way.steps[0][0] >= 0:
            raise SafetyStop(Outcome.CUT_SHORT, "another movement is better from here")
        self.tube, self.until_s = onward.tube, onward.t_s + onward.way.steps[0][1]

    def _is_due(self, pose: Pose) -> bool:
        if pose.t_s < _FIRST_LOOK_S - 1e-6 or pose.t_s < self.tube.from_s + _BETWEEN_S - 1e-6:
            return False
        return pose.t_s >= self.until_s - 1e-6 or not self.tube.holds(where(pose), pose.t_s)
