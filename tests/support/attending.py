"""An operator and a hand that follow a script, in the robot's virtual time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from scripted import ScriptedRobot

from vvvaltr.controller.core.attending import WISHES, Request, Stage, StartPlace, Wish


@dataclass
class ScriptedOperator:
    """Wishes what is scripted for a moment: the stage, and the words that its line holds. Each wish once."""

    robot: ScriptedRobot
    script: list[tuple[Stage, str, Request | Callable[[], None]]] = field(default_factory=list)
    shown: list[tuple[Stage, str]] = field(default_factory=list)
    is_busy: bool = False

    def show(self, stage: Stage, line: str) -> None:
        if not self.shown or self.shown[-1] != (stage, line):
            self.shown.append((stage, line))

    def listen(self, wait_s: float) -> Sequence[Request]:
        self.robot.sleep(wait_s) if self.shown and self.shown[-1][0] is Stage.WAITING else None
        for step in self.script:
            stage, words, wished = step
            if self.shown and self.shown[-1][0] is stage and words in self.shown[-1][1]:
                self.script.remove(step)
                if not isinstance(wished, Request):
                    wished()
                    return ()
                assert wished.wish in WISHES[stage]
                return (wished,)
        return ()


def wish(stage: Stage, words: str, wish: Wish, text: str = "") -> tuple[Stage, str, Request]:
    return stage, words, Request(wish, text)


@dataclass
class ScriptedHand:
    """Puts the scripted robot back, unless it is lame."""

    robot: ScriptedRobot
    is_lame: bool = False
    asked: list[StartPlace] = field(default_factory=list)

    def put_back(self, place: StartPlace) -> None:
        self.asked.append(place)
        if not self.is_lame:
            self.robot.x_m = place.x_m
