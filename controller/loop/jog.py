"""Driving by hand: a movement is driven while its key is held. Each hold of a key is a trial.

A terminal tells of no key that is let go. It repeats a held key, 25 to 40 times a second, and begins to do so 0.25 to
0.5 s after it was pressed. So a key counts as held for 0.6 s after its first character, and for 0.25 s after each
further one, which bridges the jitter of a connection: a tap moves the robot for 0.6 s, and a robot that was driven for
longer stops 0.25 s after the key was let go. Space stops at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import count

import numpy as np

from vvvaltr.controller.core.errors import SafetyStop
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Clock, Robot
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Outcome, Pose, Suggestion
from vvvaltr.controller.loop.one_trial import make_trial
from vvvaltr.controller.loop.steersman import PrimitiveSettings, primitive_settings
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.transfer.steering.arcs import travel
from vvvaltr.transfer.steering.repertoire import Repertoire

ORIGIN = "jog"
FIRST_S, REPEAT_S = 0.6, 0.25
_LONGEST_S = 600.0
_CHORD_S = 3.0
_TURN_OVER_WALK = 8.0  # rad/s lost for each m/s by which a turning robot walks away


class Key(StrEnum):
    """What a key asks for."""

    FORWARD = "forward"
    BACK = "back"
    LEFT = "turn left"
    RIGHT = "turn right"
    STOP = "stop"
    QUIT = "quit"


Keyboard = Callable[[float], list[Key]]
"""Returns the keys that have come, after waiting for one for at most so many seconds."""


@dataclass(slots=True)
class HeldKey:
    """Which key is held, by what a terminal sends."""

    key: Key | None = None
    until_s: float = 0.0

    def press(self, key: Key, now_s: float) -> None:
        """Take in a character that has come."""
        if key in (Key.STOP, Key.QUIT):
            self.key = None
        else:
            is_repeat = key is self.key and now_s < self.until_s
            # The first repeat must not shorten what the first press has promised.
            self.until_s = max(self.until_s, now_s + REPEAT_S) if is_repeat else now_s + FIRST_S
            self.key = key

    def held(self, now_s: float) -> Key | None:
        """Return the key that is held at a time, None for none."""
        return self.key if now_s < self.until_s else None


def choose_movements(repertoire: Repertoire) -> Mapping[Key, Gait]:
    """Return a gait for each arrow key: the one that goes farthest that way without leaving it; some may be missing."""
    v = repertoire.velocities
    chord_m, _ = travel(v, np.full(len(v), _CHORD_S))
    turning = v[:, 2], _TURN_OVER_WALK * np.hypot(v[:, 0], v[:, 1])
    worth = {
        Key.FORWARD: chord_m[:, 0] - 0.7 * np.abs(chord_m[:, 1]),
        Key.BACK: -chord_m[:, 0] - 0.7 * np.abs(chord_m[:, 1]),
        Key.LEFT: turning[0] - turning[1],
        Key.RIGHT: -turning[0] - turning[1],
    }
    return {key: repertoire.gaits[int(np.argmax(each))] for key, each in worth.items() if each.max(initial=0.0) > 0.0}


@dataclass(slots=True)
class _HoldWatch:
    """Ends a trial when its key is let go, another one pressed, or the program to be left."""

    keyboard: Keyboard
    held: HeldKey
    key: Key
    clock: Clock
    has_quit: bool = False

    def __call__(self, pose: Pose) -> None:
        """Look at the keys. Raises SafetyStop."""
        for key in self.keyboard(0.0):
            self.has_quit |= key is Key.QUIT
            self.held.press(key, self.clock.now_s())
        if self.held.held(self.clock.now_s()) is not self.key:
            raise SafetyStop(Outcome.CUT_SHORT, f"{self.key} let go")


def jog(
    robot: Robot,
    gaits: Mapping[Key, Gait],
    keyboard: Keyboard,
    settings: TrialSettings,
    record: Callable[[LoggedTrial], None],
    first: int = 1,
) -> Iterator[LoggedTrial]:
    """Drive by the keys until somebody quits; yields each held key as a trial once it is recorded.

    Raises:
        KeyboardInterrupt: the operator interrupted a trial; it has been recorded.
        TrialCrashed: the program failed during a trial; it has been recorded.
    """
    held = HeldKey()
    for number in count(first):
        key = _wait_for_key(keyboard, held, gaits, robot.clock)
        if key is None:
            return
        watch = _HoldWatch(keyboard, held, key, robot.clock)
        suggestion = Suggestion(gaits[key], f"{ORIGIN}: {key}")
        logged = make_trial(robot, suggestion, _held_settings(settings, watch), number, record)
        yield logged
        if logged.trial.outcome is Outcome.INTERRUPTED:
            raise KeyboardInterrupt(logged.trial.reason)
        if not logged.trial.outcome.is_valid:
            held.key = None  # what failed is not begun again by a key that is still down
        if watch.has_quit:
            return


def _wait_for_key(keyboard: Keyboard, held: HeldKey, gaits: Mapping[Key, Gait], clock: Clock) -> Key | None:
    """Return the next key that drives, None to leave."""
    while True:
        if (key := held.held(clock.now_s())) in gaits and key is not None:
            return key
        for pressed in keyboard(0.5):
            if pressed is Key.QUIT:
                return None
            held.press(pressed, clock.now_s())


def _held_settings(settings: TrialSettings, watch: _HoldWatch) -> PrimitiveSettings:
    return primitive_settings(replace(settings, settle_s=0.0), _LONGEST_S, watch)


class PacedClock:
    """A twin's clock whose ``sleep`` takes as long as it says."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def now_s(self) -> float:
        """Return twin time."""
        return self._clock.now_s()

    def sleep(self, duration_s: float) -> None:
        """Step the physics, then wait for what is left of the time."""
        begin_s = time.monotonic()
        self._clock.sleep(duration_s)
        time.sleep(max(0.0, duration_s - (time.monotonic() - begin_s)))
