"""Driving by hand: a movement only while its key is held, by what a terminal sends of it."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import pytest
from gliding import GAITS, SETTINGS, GlidingRobot, tried

from vvvaltr.controller.core.errors import LinkLost
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.loop.jog import FIRST_S, REPEAT_S, HeldKey, Key, choose_movements, jog
from vvvaltr.transfer.steering.repertoire import learn_repertoire


@dataclass
class ScriptedKeys:
    """Keys that come at given times of the robot's clock; a robot that waits for a key skips to the next one."""

    robot: GlidingRobot
    presses: list[tuple[float, Key]]
    asked: list[float] = field(default_factory=list)

    def __call__(self, wait_s: float) -> list[Key]:
        self.asked.append(self.robot.t_s)
        if not self.presses:
            return [Key.QUIT]
        if wait_s > 0.0:
            self.robot.t_s = max(self.robot.t_s, self.presses[0][0])
        came = [key for at_s, key in self.presses if at_s <= self.robot.t_s]
        self.presses = self.presses[len(came) :]
        return came


def held(key: Key, from_s: float, to_s: float, delay_s: float = 0.5) -> Iterable[tuple[float, Key]]:
    """Return what a terminal sends of a held key: once, and again every 33 ms after a delay."""
    yield from_s, key
    at_s = from_s + delay_s
    while at_s < to_s:
        yield at_s, key
        at_s += 0.033


def driven(robot: GlidingRobot, *presses: tuple[float, Key]) -> list[LoggedTrial]:
    recorded: list[LoggedTrial] = []
    gaits = choose_movements(learn_repertoire([tried(GlidingRobot(), 2)]))
    trials = list(jog(robot, gaits, ScriptedKeys(robot, list(presses)), SETTINGS, recorded.append))
    assert trials == recorded
    assert not robot.is_running
    return trials


def test_the_keys_have_the_movements_that_go_their_way() -> None:
    gaits = choose_movements(learn_repertoire([tried(GlidingRobot(), 2)]))

    assert gaits == {Key.FORWARD: GAITS[0], Key.BACK: GAITS[3], Key.LEFT: GAITS[1], Key.RIGHT: GAITS[2]}


def test_a_way_that_no_movement_goes_has_no_key() -> None:
    straight = GlidingRobot({GAITS[0]: (0.02, 0.0, 0.01)})

    assert set(choose_movements(learn_repertoire([tried(straight, 2)]))) == {Key.FORWARD}


def test_a_held_key_drives_until_shortly_after_its_last_repeat() -> None:
    (logged,) = driven(GlidingRobot(), *held(Key.FORWARD, 1.0, 4.0), (9.0, Key.QUIT))

    assert logged.trial.gait == GAITS[0]
    assert logged.trial.outcome is Outcome.CUT_SHORT
    assert 2.9 <= logged.trial.duration_s <= 3.0 + REPEAT_S + 2 * SETTINGS.period_s
    assert logged.movement is not None


def test_a_tap_drives_for_as_long_as_a_terminal_may_wait_with_its_first_repeat() -> None:
    (logged,) = driven(GlidingRobot(), (1.0, Key.LEFT), (9.0, Key.QUIT))

    assert logged.trial.duration_s == pytest.approx(FIRST_S, abs=2 * SETTINGS.period_s)


def test_space_stops_at_once() -> None:
    (logged,) = driven(GlidingRobot(), *held(Key.FORWARD, 1.0, 2.0), (2.0, Key.STOP), (9.0, Key.QUIT))

    assert logged.trial.duration_s <= 1.0 + 2 * SETTINGS.period_s


def test_another_key_changes_the_movement() -> None:
    one, other = driven(GlidingRobot(), (1.0, Key.FORWARD), (1.3, Key.RIGHT), (9.0, Key.QUIT))

    assert (one.trial.gait, other.trial.gait) == (GAITS[0], GAITS[2])
    assert one.trial.duration_s <= 0.3 + 2 * SETTINGS.period_s


def test_quitting_stops_the_motors() -> None:
    (logged,) = driven(GlidingRobot(), (1.0, Key.FORWARD), (1.2, Key.QUIT), (1.3, Key.FORWARD))

    assert logged.trial.duration_s <= 0.2 + 2 * SETTINGS.period_s


def test_what_failed_does_not_begin_again_by_a_key_that_is_still_down() -> None:
    def unplug(robot: GlidingRobot) -> None:
        if robot.t_s > 1.1:
            raise LinkLost("the line is gone")

    (logged,) = driven(GlidingRobot(watch=unplug), (1.0, Key.FORWARD), (9.0, Key.QUIT))

    assert logged.trial.outcome is Outcome.LINK_LOST


def test_a_first_repeat_never_shortens_a_press() -> None:
    key = HeldKey()
    key.press(Key.FORWARD, 0.0)
    key.press(Key.FORWARD, 0.1)

    assert key.held(FIRST_S - 0.01) is Key.FORWARD
    assert key.held(FIRST_S + 0.01) is None
