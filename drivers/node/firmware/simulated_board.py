"""A board with motors that exist only as numbers, for the mock device, for tests, and for trying a host without one.

Runs under MicroPython and CPython. Not needed on a real board.
"""

from .core import UNKNOWN

COUNTS_PER_TURN = 12
_LAG_US = 50000  # of the frequency behind the supply
_LOAD = 0.1  # share of the no-load frequency that the load takes away
_STALL_MA = 600.0
_ROOM_DC = 250
_HOT_DC = 950


class SimulatedMotor:
    """A DC motor behind an H-bridge: its frequency follows the output with a lag of the first order."""

    def __init__(self, no_load_hz: float, counts_per_turn: int = COUNTS_PER_TURN) -> None:
        self._counts_per_turn = counts_per_turn
        self.output = 0
        self.is_jammed = False
        self.is_hot = False
        self.frequency_hz = 0.0
        self.count = 0
        self.edge_us = 0
        self._no_load_hz = no_load_hz
        self._edges = 0.0

    @property
    def applied_hz(self) -> float:
        """The frequency that the motor will have if the output stays as it is."""
        return 0.0 if self.is_jammed else self._no_load_hz * (1.0 - _LOAD) * self.output / 1000.0

    def step(self, now_us: int, duration_us: int) -> None:
        """Let time pass until ``now_us``, at most a few milliseconds."""
        target_hz = self.applied_hz
        lag = 0.0 if self.is_jammed else max(0.0, 1.0 - duration_us / _LAG_US)
        self.frequency_hz = target_hz + (self.frequency_hz - target_hz) * lag
        edges = self._edges + self.frequency_hz * self._counts_per_turn * duration_us / 1e6
        count = int(edges // 1)
        if count != self.count:
            nearest = count if edges > self._edges else count + 1  # the edge that was crossed last
            self.edge_us = now_us - int(duration_us * (edges - nearest) / (edges - self._edges))
            self.count = count
        self._edges = edges

    def current_ma(self) -> int:
        """Return the current: what is not turned into speed."""
        wanted_hz = self._no_load_hz * self.output / 1000.0
        return int(_STALL_MA * min(1.0, abs(wanted_hz - self.frequency_hz) / self._no_load_hz))


class SimulatedBoard:
    """A board with ``motors`` such motors, at rest on the bench."""

    def __init__(self, motors: int, no_load_hz: float) -> None:
        self.motors = [SimulatedMotor(no_load_hz) for _ in range(motors)]
        self._now_us = 0

    def step(self, now_us: int) -> None:
        """Let the motors turn until ``now_us``."""
        left_us = min(100000, max(0, now_us - self._now_us))
        self._now_us = now_us
        while left_us > 0:
            part_us = min(2000, left_us)
            left_us -= part_us
            for motor in self.motors:
                motor.step(now_us - left_us, part_us)

    def encoder(self, motor: int) -> tuple[int, int]:
        """Return count and time of the last edge."""
        return self.motors[motor].count, self.motors[motor].edge_us

    def set_output(self, motor: int, output: int) -> None:
        """Set a motor's output."""
        self.motors[motor].output = output

    def current_ma(self, motor: int) -> int:
        """Return a motor's current."""
        return self.motors[motor].current_ma()

    def temperature_dc(self, motor: int) -> int:
        """Return a motor's temperature."""
        return _HOT_DC if self.motors[motor].is_hot else _ROOM_DC

    def board_temperature_dc(self) -> int:
        """Return the board's temperature."""
        return _ROOM_DC

    def acceleration_mg(self) -> tuple[int, int, int]:
        """Return no acceleration: there is no such sensor."""
        return UNKNOWN, UNKNOWN, UNKNOWN
