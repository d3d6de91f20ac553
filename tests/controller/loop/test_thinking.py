"""Thinking never holds up set-points in real time, and takes no time on a twin."""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gliding import GlidingRobot, tried

from vvvaltr.controller.core.errors import SafetyStop
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.loop.steersman import Onward, Steersman, Watch
from vvvaltr.controller.loop.thinking import Aside, AtOnce, Thinking
from vvvaltr.transfer.steering.planner import Goal, Plan
from vvvaltr.transfer.steering.repertoire import learn_repertoire


@pytest.fixture
def aside() -> Iterator[Aside[Any]]:
    with closing(Aside[Any]()) as thinking:
        yield thinking


def fetched(thinking: Aside[Any]) -> Any:
    """Return the answer once it is there."""
    for _ in range(500):
        if (answer := thinking.answer()) is not None:
            return answer
        time.sleep(0.01)
    raise TimeoutError


def test_at_once_there_is_an_answer_once() -> None:
    thinking: AtOnce[int] = AtOnce()

    thinking.ask(lambda: 7)

    assert (thinking.answer(), thinking.answer()) == (7, None)


def test_aside_the_answer_comes_later(aside: Aside[Any]) -> None:
    may_answer = threading.Event()

    aside.ask(lambda: may_answer.wait(5.0))

    assert aside.is_busy
    assert aside.answer() is None
    may_answer.set()
    assert fetched(aside) is True
    assert not aside.is_busy


def test_a_forgotten_question_has_no_answer(aside: Aside[Any]) -> None:
    aside.ask(lambda: 1)
    aside.forget()
    aside.ask(lambda: 2)

    assert fetched(aside) == 2


def test_what_fails_while_thinking_fails_where_the_answer_is_fetched(aside: Aside[Any]) -> None:
    def fail() -> int:
        raise ZeroDivisionError("planned wrongly")

    aside.ask(fail)

    with pytest.raises(ZeroDivisionError, match="planned wrongly"):
        fetched(aside)


class SlowSteersman(Steersman):
    """Thinks for as long as it is let."""

    may_answer = threading.Event()

    def onward(self, movement: int, poses: Sequence[Pose], goal: Goal) -> Onward:
        self.may_answer.wait(5.0)
        return super().onward(movement, poses, goal)


def watch(thinking: Thinking[Onward], steersman: Steersman, goal: Goal) -> Watch:
    steersman.begin(1)
    way = Plan(((0, 2.0),), 9.0, np.zeros((1, 3)), np.zeros(1))
    return Watch(steersman, thinking, 0, goal, way, np.zeros(3))


def stood(t_s: float) -> Pose:
    return Pose(t_s, (0.0, 0.0, 0.0))


def test_a_slow_decision_holds_up_no_pose_and_counts_once_it_is_there(aside: Aside[Any]) -> None:
    steersman = SlowSteersman(learn_repertoire([tried(GlidingRobot(), 2)]), 1, None, 0.3)
    look = watch(aside, steersman, Goal(0.3, 0.0))

    begin_s = time.monotonic()
    for step in range(60):  # 3 s of a drive in which the robot stands still, with nobody to decide
        look(stood(0.05 * step))
    assert time.monotonic() - begin_s < 2.0
    assert aside.is_busy

    steersman.may_answer.set()
    with pytest.raises(SafetyStop, match="another movement"):
        for step in range(60, 400):
            look(stood(0.05 * step))
            time.sleep(0.005)


@pytest.mark.parametrize(("speed_m_s", "asked"), [(0.02, 0), (-0.03, 1)])
def test_it_is_thought_again_only_about_a_drive_that_goes_otherwise(speed_m_s: float, asked: int) -> None:
    questions: list[object] = []
    thinking: Any = SimpleNamespace(
        ask=questions.append, answer=lambda: None, is_busy=False, forget=lambda: None, close=lambda: None
    )
    repertoire = learn_repertoire([tried(GlidingRobot(), 4)])
    look = watch(thinking, Steersman(repertoire, 1, None, 0.3), Goal(0.3, 0.0))
    look.until_s = 6.0

    for t_s in np.arange(0.0, 2.0, 0.05).tolist():
        yaw_rad = 0.02 * t_s
        look(Pose(t_s, (speed_m_s * t_s, 0.0, 0.0), yaw_rad))

    assert min(len(questions), 1) == asked
