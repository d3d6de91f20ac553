"""From a place to another by a sequence of movements: a beam search over (x, y, yaw) for the least expected time.

A movement may be driven for any of some durations. Along it the robot moves by the exponential of its velocity,

    p(t) = p + R(yaw) W(w t) v t + s t,    W(a) = [[sin a, cos a - 1], [1 - cos a, sin a]] / a

Where the floor makes the turn depend on the heading, f(yaw), w is the mean turn to first order in the change of yaw,

    w t = f(yaw) (e^(f'(yaw) t) - 1) / f'(yaw)

What is left at the end of a sequence is charged by the distance left over the speed at which the repertoire gets along.
The distance is that of a robot that may have gone wrong in its last movement by as much as this movement scatters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.steering.arcs import Places, chords, travel

DURATIONS_S = (1.8, 2.4, 3.2, 4.2, 5.5, 7.3, 10.0)
"""How long a movement may be planned for. None is cut before the shortest, at which its own velocity begins to show."""

_ONWARD_S = 0.5  # the shortest time for which the movement underway may go on
_FIRST_WIDTH, _WIDTH = 320, 96  # sequences that are kept: all of one movement, for repertoires of the usual size
_DEPTH = 4
_GROWTH = 1.5  # of the change of heading within a movement, in factors of e, as far as the first order is of use
_UNHINDERED = 0.7  # of the speed of a movement, that is left after turns and detours
_ANOTHER_S = 1.5  # that one more movement takes before it gets anywhere
_SIDEWAYS = 0.6  # of a movement's deviation that stopping at the best point cannot make good


@dataclass(frozen=True, slots=True)
class Goal:
    """Where to go.

    Args:
        x_m, y_m: the place.
        within_m: how near is near enough.
        yaw_rad: the heading to arrive with; None for any.
        within_rad: how near to it is near enough.
    """

    x_m: float
    y_m: float
    within_m: float = 0.02
    yaw_rad: float | None = None
    within_rad: float = 0.2

    def distance_m(self, x_m: Array | float, y_m: Array | float) -> Array:
        """Return the distance from places."""
        return np.hypot(np.asarray(x_m) - self.x_m, np.asarray(y_m) - self.y_m)

    def turn_rad(self, yaw_rad: Array | float) -> Array:
        """Return by how much headings differ from the wanted one, 0 where any is right."""
        if self.yaw_rad is None:
            return np.zeros(np.shape(yaw_rad))
        return np.abs((np.asarray(yaw_rad) - self.yaw_rad + math.pi) % math.tau - math.pi)

    def is_reached(self, pose: Array, share: float = 1.0) -> bool:
        """Whether x, y, yaw are near enough; ``share`` of the tolerance is allowed."""
        near = float(self.distance_m(pose[0], pose[1])) <= share * self.within_m
        return near and float(self.turn_rad(pose[2])) <= share * self.within_rad


@dataclass(frozen=True, slots=True)
class Border:
    """The rectangle that no plan crosses: lowest and highest x and y."""

    x_m: tuple[float, float]
    y_m: tuple[float, float]

    def holds(self, x_m: Array, y_m: Array, margin_m: Array | float, start: Array | None = None) -> NDArray[np.bool_]:
        """Return which places are inside by a margin, or no nearer to the border than ``start`` (x, y)."""
        inside = np.ones(np.shape(x_m), dtype=np.bool_)
        for axis, (at_m, (low_m, high_m)) in enumerate(((x_m, self.x_m), (y_m, self.y_m))):
            low, high = low_m + margin_m, high_m - margin_m
            if start is not None:
                low, high = np.minimum(low, start[axis]), np.maximum(high, start[axis])
            inside &= (at_m >= low) & (at_m <= high)
        return inside


@dataclass(frozen=True, slots=True)
class Abilities:
    """What can be done now.

    Args:
        velocities: (n, 3) forward, left, turn per second.
        deviations: (n, 3) by how much a single drive may differ from them.
        floor: (n, 4) what the floor adds to each: the turn with cosine and sine of the heading (rad/s), and the drift.
        delay_s: time at the start of a movement in which nothing moves.
        pause_s: time between two movements.
    """

    velocities: Array
    deviations: Array
    floor: Array
    delay_s: float
    pause_s: float


@dataclass(frozen=True, slots=True)
class Plan:
    """A sequence of movements, counted from 0, and how long each is driven.

    Args:
        steps: movement and duration in s. The movement is -1 where the one underway is to go on.
        expected_s: time to the goal.
        poses: (steps, 3) expected x, y, yaw after each.
        spreads_m: (steps,) by how much the place after each may differ.
    """

    steps: tuple[tuple[int, float], ...]
    expected_s: float
    poses: Array
    spreads_m: Array


@dataclass(frozen=True, slots=True)
class _Actions:
    """Movements with durations: what each does to a robot at the origin that heads along x."""

    movement: NDArray[np.int64]
    duration_s: Array
    cost_s: Array
    own_m: Array  # (actions, 2), along the path
    turn_rad: Array
    floor_rad: Array  # (actions, 2), that it adds to the turn with cosine and sine of the heading
    drift_m: Array  # (actions, 2)
    spread_m: Array

    def joined(self, other: _Actions) -> _Actions:
        pairs = ((getattr(self, name), getattr(other, name)) for name in self.__dataclass_fields__)
        return _Actions(*(np.concatenate(pair) for pair in pairs))

    def turned(self, yaw_rad: Array) -> Array:
        """Return the turn of each from headings of shape (nodes, 1)."""
        if not self.floor_rad.any():
            return np.broadcast_to(self.turn_rad, (len(yaw_rad), len(self.turn_rad)))
        cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
        along, across = self.floor_rad.T
        growth = np.clip(across * cosine - along * sine, -_GROWTH, _GROWTH)
        growth = np.where(np.abs(growth) < 1e-6, 1e-6, growth)
        turned: Array = (self.turn_rad + along * cosine + across * sine) * np.expm1(growth) / growth
        return turned


def plan(
    start: Array, goal: Goal, able: Abilities, border: Border | None = None, underway: Array | None = None
) -> Plan:
    """Return the best sequence found, empty where nothing helps.

    Args:
        start: (3,) x, y, yaw now.
        goal: where to go.
        able: what can be done.
        border: not crossed by any expected path; None for none.
        underway: (7,) velocity of the movement that is being driven, and what the floor adds. It may go on at once.
    """
    menu = _actions(able, np.arange(len(able.velocities)))
    first = menu
    if underway is not None:
        seen = 0.3 * able.deviations.min(axis=0)[None]
        onward = Abilities(underway[None, :3], seen, underway[None, 3:], 0.0, 0.0)
        first = menu.joined(_actions(onward, np.array([-1]), (_ONWARD_S, *DURATIONS_S)))
    search = _Search(goal, start, border, *_speeds(able))
    nodes = _Nodes.at(start, search)
    layers: list[_Nodes] = [nodes]
    for depth in range(_DEPTH):
        width = _FIRST_WIDTH if depth == 0 else _WIDTH
        nodes = search.expanded(nodes, first if depth == 0 else menu, width)
        layers.append(nodes)
        if not len(nodes.cost_s):
            break
    return _best(layers, first, menu)


def _actions(able: Abilities, names: NDArray[np.int64], durations_s: Sequence[float] = DURATIONS_S) -> _Actions:
    count = len(durations_s)
    v, sd = np.repeat(able.velocities, count, axis=0), np.repeat(able.deviations, count, axis=0)
    t = np.tile(durations_s, len(names))
    moving_s = np.maximum(t - able.delay_s, 0.0)
    floor = moving_s[:, None] * np.repeat(able.floor, count, axis=0)
    length_m = np.hypot(v[:, 0], v[:, 1]) * moving_s
    spread_m = np.hypot(np.hypot(sd[:, 0], sd[:, 1]) * moving_s, 0.5 * length_m * np.minimum(sd[:, 2] * moving_s, 2.0))
    own_m, turn_rad = v[:, :2] * moving_s[:, None], v[:, 2] * moving_s
    return _Actions(np.repeat(names, count), t, t + able.pause_s, own_m, turn_rad, floor[:, :2], floor[:, 2:], spread_m)


def _speeds(able: Abilities) -> tuple[Array, float, float]:
    """Return the drift and the speed of the movements that get along best, and the speed at which some turn."""
    chords_m, _ = travel(able.velocities, np.full(len(able.velocities), 5.0))
    along = np.hypot(chords_m[:, 0], chords_m[:, 1]) / (5.0 + able.pause_s)
    best = np.argsort(along)[-3:]
    turning = np.sort(np.abs(able.velocities[:, 2]))[-3:].mean()
    drift_m_s = able.floor[:, 2:][best].mean(axis=0)
    return drift_m_s, max(float(along[best].mean()), 1e-4), max(_UNHINDERED * float(turning), 1e-3)


@dataclass(frozen=True, slots=True)
class _Nodes:
    """Where sequences of one length end."""

    pose: Array  # (nodes, 3)
    time_s: Array
    cost_s: Array  # with what is left to the goal
    spread_m: Array
    parent: NDArray[np.int64]
    action: NDArray[np.int64]

    @classmethod
    def at(cls, start: Array, search: _Search) -> _Nodes:
        pose, zero = start[None].astype(float), np.zeros(1)
        none = np.full(1, -1)
        return cls(pose, zero, search.rest_s(pose[:, 0], pose[:, 1], pose[:, 2], zero), zero, none, none)


@dataclass(frozen=True, slots=True)
class _Search:
    goal: Goal
    start: Array
    border: Border | None
    drift_m_s: Array
    speed_m_s: float
    turning_rad_s: float

    def rest_s(self, x_m: Array, y_m: Array, yaw_rad: Array, spread_m: Array) -> Array:
        """Return the time that is expected to be needed from places on."""
        goal = self.goal
        dx, dy = goal.x_m - x_m, goal.y_m - y_m
        away_m = np.hypot(dx, dy)
        helped = (dx * self.drift_m_s[0] + dy * self.drift_m_s[1]) / np.maximum(away_m, 1e-6)
        speed = _UNHINDERED * np.maximum(self.speed_m_s + helped, 0.2 * self.speed_m_s)
        off_m = np.sqrt(away_m**2 + (_SIDEWAYS * spread_m) ** 2)
        rest: Array = np.maximum(off_m - 0.7 * goal.within_m, 0.0) / speed
        misses = off_m > goal.within_m
        if goal.yaw_rad is not None:
            turn_rad = goal.turn_rad(yaw_rad)
            rest += np.maximum(turn_rad - 0.7 * goal.within_rad, 0.0) / self.turning_rad_s
            misses |= turn_rad > goal.within_rad
        rest += _ANOTHER_S * misses
        return rest

    def expanded(self, nodes: _Nodes, actions: _Actions, width: int) -> _Nodes:
        """Return the best nodes that are one action further."""
        turn_rad = actions.turned(nodes.pose[:, 2:])
        halfway, end = chords(actions.own_m[:, 0], actions.own_m[:, 1], turn_rad)
        x, y = _moved(nodes, end, actions.drift_m)
        yaw = nodes.pose[:, 2:] + turn_rad
        time_s = nodes.time_s[:, None] + actions.cost_s
        cost = time_s + self.rest_s(x, y, yaw, actions.spread_m)
        if self.border is not None:
            cost[self._crossing(actions, _moved(nodes, halfway, 0.5 * actions.drift_m), x, y)] = np.inf
        flat = cost.ravel()
        chosen = np.argpartition(flat, width)[:width] if flat.size > width else np.arange(flat.size)
        chosen = chosen[np.isfinite(flat[chosen])]
        parent, action = np.divmod(chosen, len(actions.turn_rad))
        pose = np.stack([x.ravel()[chosen], y.ravel()[chosen], yaw.ravel()[chosen]], axis=1)
        return _Nodes(pose, time_s.ravel()[chosen], flat[chosen], actions.spread_m[action], parent, action)

    def _crossing(self, actions: _Actions, halfway: Places, x: Array, y: Array) -> NDArray[np.bool_]:
        """Return which actions end beyond the border or go through it, or might."""
        assert self.border is not None
        margin_m = np.minimum(actions.spread_m, 0.03)
        ends_inside = self.border.holds(x, y, margin_m, self.start)
        return ~(ends_inside & self.border.holds(*halfway, 0.5 * margin_m, self.start))


def _moved(nodes: _Nodes, own_m: Places, drift_m: Array) -> Places:
    """Return x and y after each action, shape (nodes, actions)."""
    cosine, sine = np.cos(nodes.pose[:, 2:]), np.sin(nodes.pose[:, 2:])
    x = nodes.pose[:, :1] + (cosine * own_m[0] - sine * own_m[1] + drift_m[:, 0])
    y = nodes.pose[:, 1:2] + (sine * own_m[0] + cosine * own_m[1] + drift_m[:, 1])
    return x, y


def _best(layers: list[_Nodes], first: _Actions, menu: _Actions) -> Plan:
    """Return the sequence that ends with the least cost; a longer one must be better."""
    ends = [(float(nodes.cost_s.min()), depth) for depth, nodes in enumerate(layers) if depth and len(nodes.cost_s)]
    if not ends:
        return Plan((), math.inf, np.zeros((0, 3)), np.zeros(0))
    expected_s, depth = min(ends)
    node = int(np.argmin(layers[depth].cost_s))
    steps, poses, spreads = [], [], []
    for level in range(depth, 0, -1):
        nodes = layers[level]
        actions = first if level == 1 else menu
        action = int(nodes.action[node])
        steps.append((int(actions.movement[action]), float(actions.duration_s[action])))
        poses.append(nodes.pose[node])
        spreads.append(float(nodes.spread_m[node]))
        node = int(nodes.parent[node])
    return Plan(tuple(steps[::-1]), expected_s, np.array(poses[::-1]).reshape(-1, 3), np.array(spreads[::-1]))
