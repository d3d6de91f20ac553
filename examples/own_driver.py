"""A driver of one's own, in the process: motors on a board that takes whole percents of full speed."""

import vvvaltr

FULL_HZ = 16.0


class PercentMotors:
    """Satisfies ``MotorDriver``. The motors of a twin stand in for the board, which a real driver would write to."""

    quantities = frozenset({vvvaltr.Quantity.FREQUENCY})

    def __init__(self, board: vvvaltr.MotorDriver) -> None:
        self.motor_count = board.motor_count
        self._board = board
        self.state, self.stop, self.close = board.state, board.stop, board.close

    def drive(self, gait: vvvaltr.Gait, hold_s: float) -> None:
        """Send the frequencies; the board stops the motors by itself after ``hold_s``."""
        percents = [round(100.0 * hz / FULL_HZ) for hz in gait.frequency_hz]
        self._board.drive(vvvaltr.Gait(tuple(percent / 100.0 * FULL_HZ for percent in percents)), hold_s)


class Bench:
    """Satisfies ``Robot``: these motors, with the tracker and the clock of the planar twin."""

    def __init__(self) -> None:
        twin = vvvaltr.planar_robot(seed=1)
        self.motors = PercentMotors(twin.motors)
        self.tracker, self.clock, self.structure = twin.tracker, twin.clock, twin.structure
        self.place, self.carry_on, self.close = twin.place, twin.carry_on, twin.close


robot = vvvaltr.GuardedRobot(Bench(), vvvaltr.Limits((FULL_HZ,) * 3))
trial = vvvaltr.run_trial(robot, vvvaltr.Gait((12.0, -14.0, 9.0)), vvvaltr.TrialSettings(duration_s=5.0))
print(f"{trial.outcome}, asked {trial.gait}, applied {[round(hz, 2) for hz in trial.states[-1].frequency_hz]}")
