"""Between two trials: the operator decides. Without one nothing is waited for that only a person could do."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from vvvaltr.controller.core.attending import Hand, Operator, Request, Stage, Wish
from vvvaltr.controller.core.clock import WallClock
from vvvaltr.controller.core.errors import SafetyStop, UserError
from vvvaltr.controller.core.protocols import Clock, MotorDriver, Robot, Tracker
from vvvaltr.controller.core.records import Verdict
from vvvaltr.controller.core.values import Outcome, Structure, Trial
from vvvaltr.controller.loop.putting_back import Placement, Return, Sight

_LOOK_S = 0.04
_REST_S, _REST_UNDER_HANDS_S = 0.3, 1.0  # how long the robot must lie still; longer where hands may be near


@dataclass(frozen=True, slots=True)
class Remarks:
    """What an operator says of a trial.

    Args:
        notes: free text.
        verdict: None where nobody was asked.
        reason: of the verdict, free text.
    """

    notes: str = ""
    verdict: Verdict | None = None
    reason: str = ""


class Interrupted(SafetyStop):
    """The operator stopped the motors. The run goes on when the operator says so."""


class Attendance:
    """Sees to it that each trial can begin, and asks the operator, where there is one.

    Args:
        robot: with guarded motors.
        placement: where a trial may begin.
        operator: the person beside the robot; None for nobody.
        hand: what puts the robot back; None where only a person can.
        review_s: how long the operator may think about a trial before it is kept.
        park: stops the motors and lets go of their lines until the next trial; None where that cannot be done.
        park_after_s: how long a pause lasts until then.
        obstruct: returns what else keeps a trial from beginning, such as a full disk; empty for nothing.
        announce: told what is waited for, once each time.
    """

    def __init__(
        self,
        robot: Robot,
        placement: Placement,
        operator: Operator | None = None,
        hand: Hand | None = None,
        review_s: float = 3.0,
        park: Callable[[], None] | None = None,
        park_after_s: float = 60.0,
        obstruct: Callable[[], str] = lambda: "",
    ) -> None:
        self._obstruct = obstruct
        self.robot: Robot = robot if operator is None else _HeardRobot(robot, self._hear)
        self.announce: Callable[[str], None] = lambda text: None
        self.is_ending = False  # because the operator wants it
        self.has_stopped = False  # the last trial, by the operator
        self._placement, self._operator, self._hand = placement, operator, hand
        self._review_s, self._park, self._park_after_s = review_s, park, park_after_s
        self._sight = Sight(robot, _REST_S if operator is None else _REST_UNDER_HANDS_S)
        self._told = ""
        self._pause = ""  # why the run pauses; empty while it does not
        self._notes: list[str] = []
        self._has_new_battery = False
        self._interrupt: KeyboardInterrupt | None = None

    def prepare(self, number: int, can_skip: bool) -> Wish:
        """Wait until a trial may begin; return GO, or SKIP or END where the operator wants that.

        Raises:
            UserError: the robot has to be put back, and nobody is there who could.
        """
        back = Return(self._placement, self._sight, self._hand)
        pause = _Pause(self._park, self._park_after_s)
        while not self.is_ending:
            hindrance = self._obstruct()
            if hindrance and self._operator is None:
                raise UserError(f"trial {number} cannot begin: {hindrance}")
            obstacle = self._pause or hindrance or back.obstacle() or self._typing()
            if not obstacle:
                return Wish.GO
            if self._operator is None and back.is_hopeless:
                raise UserError(f"trial {number} cannot begin: {obstacle}; {back.cure}")
            if self._pause or hindrance or back.is_for_somebody:
                self._announce_once(
                    f"trial {number} waits: {self._pause or hindrance or 'the robot is to be put back'}"
                )
            pause.look()
            for request in self._ask(Stage.WAITING, f"trial {number}: {obstacle}", _LOOK_S):
                if request.wish is Wish.SKIP and can_skip:
                    return Wish.SKIP
                self._take(request)
                if request.wish is Wish.GO:
                    return Wish.GO
        return Wish.END

    def begin(self, number: int) -> None:
        """Show that a trial drives, and which keys count meanwhile."""
        self.has_stopped, self._told = False, ""
        if self._operator is not None:
            self._operator.show(Stage.DRIVING, f"trial {number} drives")

    def review(self, trial: Trial, said: str) -> tuple[Trial, Remarks]:
        """Return a trial with what the operator says of it. An interrupt meanwhile is kept for ``raise_interrupt``.

        Args:
            trial: what happened.
            said: the trial in a few words.
        """
        if self._has_new_battery:
            trial = replace(trial, conditions=replace(trial.conditions, battery_changed=True))
            self._has_new_battery = False
        verdict, reason = None, ""
        if self._operator is not None and trial.outcome is not Outcome.INTERRUPTED and not self.is_ending:
            try:
                verdict, reason = self._judge(f"trial {trial.number}: {said}")
            except KeyboardInterrupt as interrupt:
                self._interrupt = interrupt
        notes, self._notes = "; ".join(self._notes), []
        return trial, Remarks(notes, verdict, reason)

    def raise_interrupt(self) -> None:
        """Raise the KeyboardInterrupt that came during the last review, now that its trial is on record."""
        if self._interrupt is not None:
            raise self._interrupt

    def pause(self, reason: str) -> bool:
        """Pause before the next trial until the operator goes on; return False where there is nobody to do so."""
        if self._operator is not None:
            self._pause = self._pause or reason
        return self._operator is not None

    def _typing(self) -> str:
        """Return that the operator types, if so: no motor starts meanwhile, since each key is a letter then."""
        return "waits for what you type" if self._operator is not None and self._operator.is_busy else ""

    def _judge(self, line: str) -> tuple[Verdict, str]:
        """Return the operator's verdict, that is to keep the trial if nothing else is said in time."""
        verdicts = {Wish.KEEP: Verdict.KEEP, Wish.REPEAT: Verdict.REPEAT, Wish.DISCARD: Verdict.DISCARD}
        until_s = time.monotonic() + self._review_s
        while (self._operator is not None and self._operator.is_busy) or time.monotonic() < until_s:
            for request in self._ask(Stage.REVIEW, line, _LOOK_S):
                if request.wish in verdicts:
                    return verdicts[request.wish], request.text
                self._take(request)
            if self.is_ending:
                break
        return Verdict.KEEP, ""

    def _take(self, request: Request) -> None:
        match request.wish:
            case Wish.PAUSE:
                self._pause = "" if self._pause else "paused"
            case Wish.GO:
                self._pause = ""
            case Wish.STOP:
                self._pause = "stopped"
            case Wish.END:
                self.is_ending = True
            case Wish.NOTE if request.text:
                self._notes.append(request.text)
            case Wish.NEW_BATTERY:
                self._has_new_battery = True

    def _ask(self, stage: Stage, line: str, wait_s: float) -> Sequence[Request]:
        if self._operator is None:
            self.robot.clock.sleep(wait_s)
            return ()
        self._operator.show(stage, line)
        return self._operator.listen(wait_s)

    def _hear(self, wait_s: float) -> None:
        """Wait during a trial. Raises Interrupted as soon as the operator stops the motors."""
        assert self._operator is not None
        until_s = time.monotonic() + wait_s
        while True:
            for request in self._operator.listen(max(0.0, until_s - time.monotonic())):
                self._take(request)
                if request.wish is Wish.STOP:
                    self.has_stopped = True
                    raise Interrupted(Outcome.INTERRUPTED, "stopped by the operator")
            if time.monotonic() >= until_s:
                return

    def _announce_once(self, text: str) -> None:
        if text != self._told:
            self._told = text
            self.announce(text)


class _Pause:
    """A pause that lets go of the motors' lines when it gets long."""

    def __init__(self, park: Callable[[], None] | None, after_s: float) -> None:
        self._park, self._until_s = park, time.monotonic() + after_s

    def look(self) -> None:
        """Let go of the lines once it is time."""
        if self._park is not None and time.monotonic() > self._until_s:
            self._park()
            self._park = None


class _HeardRobot:
    """A robot whose clock hears the operator while it waits."""

    def __init__(self, robot: Robot, hear: Callable[[float], None]) -> None:
        self._robot = robot
        self.motors: MotorDriver = robot.motors
        self.tracker: Tracker = robot.tracker
        self.structure: Structure | None = robot.structure
        # Of a real robot the waiting itself listens, so that a key is heard at once.
        self.clock: Clock = WallClock(hear) if isinstance(robot.clock, WallClock) else _HeardClock(robot.clock, hear)

    def place(self, trial: int) -> None:
        self._robot.place(trial)

    def carry_on(self, trial: int) -> None:
        self._robot.carry_on(trial)

    def close(self) -> None:
        self._robot.close()


class _HeardClock:
    """A clock of its own time, such as a twin's: the operator is heard after each step."""

    def __init__(self, clock: Clock, hear: Callable[[float], None]) -> None:
        self._clock, self._hear = clock, hear

    def now_s(self) -> float:
        return self._clock.now_s()

    def sleep(self, duration_s: float) -> None:
        self._clock.sleep(duration_s)
        self._hear(0.0)
