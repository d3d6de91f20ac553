"""A robot in virtual time that does to place and heading exactly what a table says of each gait."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState, Outcome, Pose, Trial
from vvvaltr.controller.loop.safety import Arena
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial

Velocity = tuple[float, float, float]

GAITS = tuple(Gait((float(hz), 0.0, 1.0)) for hz in (5, 6, 7, 8, 9))
MEAN_DRIVE = sum(gait.frequency_hz[0] ** 2 + 1.0 for gait in GAITS) / len(GAITS)
TABLE: dict[Gait, Velocity] = {
    GAITS[0]: (0.020, 0.0, 0.02),
    GAITS[1]: (0.002, 0.002, 0.5),
    GAITS[2]: (0.001, -0.003, -0.4),
    GAITS[3]: (-0.012, 0.004, 0.05),
    GAITS[4]: (0.004, 0.014, -0.1),
}
SETTINGS = TrialSettings(settle_s=0.1, ramp_s=0.0, heading_limit_rad=None)


@dataclass
class GlidingRobot:
    """Motors, tracker and clock in one.

    Args:
        table: forward, left (m/s) and turn (rad/s) of each gait; a gait that is not in it does nothing.
        drift_m_s: of the floor at the mean drive of ``GAITS``; in proportion to the drive.
        watch: called with the robot before every pose; it may change the robot or raise.
    """

    table: dict[Gait, Velocity] = field(default_factory=lambda: dict(TABLE))
    drift_m_s: tuple[float, float] = (0.0, 0.0)
    watch: Callable[["GlidingRobot"], None] = lambda robot: None
    motor_count: int = 3
    quantities: frozenset[Quantity] = frozenset({Quantity.FREQUENCY})
    structure: None = None
    t_s: float = 0.0
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    gait: Gait = field(default_factory=lambda: Gait((0.0, 0.0, 0.0)))
    expires_s: float = 0.0
    placed: list[int] = field(default_factory=list)

    @property
    def motors(self) -> "GlidingRobot":
        return self

    tracker = clock = motors

    @property
    def is_running(self) -> bool:
        return any(self.gait.frequency_hz) and self.t_s < self.expires_s

    def place(self, trial: int) -> None:
        self.x_m = self.y_m = self.yaw_rad = 0.0
        self.carry_on(trial)

    def carry_on(self, trial: int) -> None:
        self.placed.append(trial)

    def now_s(self) -> float:
        return self.t_s

    def sleep(self, duration_s: float) -> None:
        for _ in range(10):
            self._glide(duration_s / 10)

    def _glide(self, duration_s: float) -> None:
        if self.is_running:
            forward, left, turn = self.table.get(self.gait, (0.0, 0.0, 0.0))
            middle_rad = self.yaw_rad + 0.5 * turn * duration_s
            down_x, down_y = (relative_drive(self.gait) * drift for drift in self.drift_m_s)
            self.x_m += duration_s * (forward * math.cos(middle_rad) - left * math.sin(middle_rad) + down_x)
            self.y_m += duration_s * (forward * math.sin(middle_rad) + left * math.cos(middle_rad) + down_y)
            self.yaw_rad += turn * duration_s
        self.t_s += duration_s

    def drive(self, gait: Gait, hold_s: float) -> None:
        self.gait, self.expires_s = gait, self.t_s + hold_s

    def state(self) -> MotorState:
        return MotorState(self.t_s, self.gait.frequency_hz if self.is_running else (0.0, 0.0, 0.0))

    def pose(self) -> Pose:
        self.watch(self)
        wrapped_rad = math.remainder(self.yaw_rad, math.tau)  # as trackers tell it
        return Pose(self.t_s, (self.x_m, self.y_m, 0.0), wrapped_rad)

    def stop(self) -> None:
        self.gait = Gait((0.0,) * 3)

    def close(self) -> None:
        self.stop()


def relative_drive(gait: Gait) -> float:
    """Return the sum of the squared frequencies over its mean."""
    return sum(hz**2 for hz in gait.frequency_hz) / MEAN_DRIVE


def tried(robot: GlidingRobot, repeats: int = 1, arena: Arena | None = None) -> list[Trial]:
    """Return a trial of each gait of the table, in the order in which a person would try them."""
    gaits = [gait for _ in range(repeats) for gait in robot.table]
    trials = [run_trial(robot, gait, SETTINGS, number) for number, gait in enumerate(gaits, start=1)]
    assert all(trial.outcome is Outcome.COMPLETED for trial in trials)
    return trials
