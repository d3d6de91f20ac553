"""A robot in virtual time that goes wrong at a chosen moment."""

from collections.abc import Callable
from dataclasses import dataclass, field

from vvvaltr.controller.core.errors import DeviceError
from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState, Pose


@dataclass
class ScriptedRobot:
    """Moves along x at 10 mm/s for every Hz of the first motor. It is motors, tracker and clock in one.

    Args:
        at_s: moment, in seconds after the drive began, at which ``event`` is called at every look at ``where``.
        event: what goes wrong; it raises, or returns a value in place of the right one.
        where: "pose", "state", "drive", "sleep" or "place".
        stop_error: what the motors answer to a stop.
    """

    at_s: float = 1e9
    event: Callable[[], object] = lambda: None
    where: str = "pose"
    stop_error: DeviceError | None = None
    speed_m_s_per_hz: float = 0.010
    motor_count: int = 3
    quantities: frozenset[Quantity] = frozenset({Quantity.FREQUENCY})
    structure: None = None
    t_s: float = 100.0
    begin_s: float = 1e9
    x_m: float = 0.0
    gait: Gait = field(default_factory=lambda: Gait((0.0, 0.0, 0.0)))
    expires_s: float = 0.0
    stops: int = 0
    is_closed: bool = False
    placed: list[int] = field(default_factory=list)

    @property
    def motors(self) -> "ScriptedRobot":
        return self

    tracker = clock = motors

    @property
    def is_running(self) -> bool:
        return any(self.gait.frequency_hz) and self.t_s < self.expires_s

    def _perhaps(self, where: str) -> object:
        due = where == self.where and (where == "place" or self.t_s - self.begin_s >= self.at_s - 1e-9)
        return self.event() if due else None

    def place(self, trial: int) -> None:
        self.begin_s = 1e9
        self.x_m, self.t_s = 0.0, 1000.0 * trial
        self.placed.append(trial)
        self._perhaps("place")

    def carry_on(self, trial: int) -> None:
        self.begin_s = 1e9
        self.placed.append(trial)
        self._perhaps("place")

    def now_s(self) -> float:
        return self.t_s

    def sleep(self, duration_s: float) -> None:
        self._perhaps("sleep")
        if self.is_running:
            self.x_m += duration_s * self.speed_m_s_per_hz * self.gait.frequency_hz[0]
        self.t_s += duration_s

    def drive(self, gait: Gait, hold_s: float) -> None:
        self.begin_s = min(self.begin_s, self.t_s)
        self.gait, self.expires_s = gait, self.t_s + hold_s
        self._perhaps("drive")

    def state(self) -> MotorState:
        applied = self._perhaps("state") or (self.gait.frequency_hz if self.is_running else (0.0, 0.0, 0.0))
        return MotorState(self.t_s, applied)

    def pose(self) -> Pose:
        position = self._perhaps("pose") or (self.x_m, 0.0, 0.0)
        return position if isinstance(position, Pose) else Pose(self.t_s, position)

    def stop(self) -> None:
        self.stops += 1
        if self.stop_error is not None:
            raise self.stop_error
        self.gait = Gait((0.0,) * 3)

    def close(self) -> None:
        self.is_closed = True
        self.stop()


def raising(error: BaseException) -> Callable[[], object]:
    """Return an event that raises ``error``."""

    def event() -> object:
        raise error

    return event
