"""Speed of one motor, measured and regulated. Whole numbers only, so that every interpreter computes the same.

Frequencies are in mHz (1000 = one turn a second, signed), outputs in thousandths of the supply, times in ms and us.
"""

TICKS = 0x3FFFFFFF  # clocks count modulo this + 1, as MicroPython's do
_FULL = 1000
_INTEGRAL_GAIN = 20  # 1/s: how fast a lasting error is made up for
_FINE = 100  # the integral's steps per thousandth of the supply
_NEWS_MS = 30  # an error counts for so long at most: a slow motor's is known at its edges only, and it would hunt
_STALL_OUTPUT = 150
_STALL_MHZ = 167  # 10 turns a minute
_STALL_MS = 1000


def clamp(value: int, limit: int) -> int:
    """Return ``value`` cut to -limit ... limit."""
    return max(-limit, min(limit, value))


class SpeedMeter:
    """Frequency from an encoder's count and the time of its last edge.

    Args:
        counts_per_turn: counted edges in one turn of the motor.
    """

    def __init__(self, counts_per_turn: int) -> None:
        self.mhz = 0
        self.edge_mhz = 0  # the same, but 0 if no edge came since the reading before
        self.is_news = True  # an edge came, or the motor stands still
        self._mhz_us = 1000000000 // counts_per_turn
        self._turning = False
        self._count = 0
        self._edge_us = 0

    def update(self, count: int, edge_us: int, now_us: int) -> None:
        """Take a reading: the signed count, the time of its last edge, and the present."""
        counted = count - self._count
        if counted:
            elapsed_us = max(1, (edge_us - self._edge_us) & TICKS)
            # After a standstill the first edge only starts the clock: the one before it is of long ago.
            self.mhz = counted * self._mhz_us // elapsed_us if self._turning else 0
            self._turning = True
            self._count = count
            self._edge_us = edge_us
            self.edge_mhz = self.mhz
            self.is_news = True
            return
        self.edge_mhz = 0
        bound = self._mhz_us // max(1, (now_us - self._edge_us) & TICKS)  # it would have shown if it turned faster
        self._turning = self._turning and bound >= _STALL_MHZ
        self.mhz = clamp(self.mhz, bound) if self._turning else 0
        self.is_news = not self._turning


class SpeedLoop:
    """Ramp, and PI control with feed-forward, of one motor.

    Args:
        no_load_mhz: frequency at the full supply with nothing to turn; scales feed-forward and gains.
        ramp_mhz_s: the fastest change of the set-point.
    """

    def __init__(self, no_load_mhz: int, ramp_mhz_s: int) -> None:
        self.target_mhz = 0
        self.ramped_mhz = 0
        self.output = 0
        self._stalled_ms = 0
        self._no_load_mhz = no_load_mhz
        self._ramp_mhz_s = ramp_mhz_s
        self._integral = 0
        self._news_ms = 0

    def regulate(self, measured_mhz: int, is_news: bool, elapsed_ms: int) -> int:
        """Return the output for the next moment, ``elapsed_ms`` after the last call.

        Args:
            measured_mhz: the frequency.
            is_news: whether it was measured since the last call.
            elapsed_ms: time since the last call.
        """
        step = self._ramp_mhz_s * elapsed_ms // 1000
        self.ramped_mhz += clamp(self.target_mhz - self.ramped_mhz, step)
        if self.ramped_mhz == 0 and self.target_mhz == 0:
            self.release()
            return 0
        error = self.ramped_mhz - measured_mhz
        proportional = (self.ramped_mhz + error) * _FULL // self._no_load_mhz  # feed-forward and a gain of one
        wanted = proportional + self._integral // _FINE
        self.output = clamp(wanted, _FULL)
        # Anti-windup: a motor that still follows the ramp has no lasting error, and at the supply's end the integral
        # may only lead back.
        self._news_ms = min(_NEWS_MS, self._news_ms + elapsed_ms)
        may_grow = wanted == self.output or wanted * error < 0
        if is_news and may_grow and self.ramped_mhz == self.target_mhz:
            self._integral += error * _INTEGRAL_GAIN * self._news_ms * _FINE // self._no_load_mhz
        if is_news:
            self._news_ms = 0
        return self.output

    def is_stalled(self, edge_mhz: int, elapsed_ms: int) -> bool:
        """Return whether no edge has shown, for a second, that the motor follows a considerable output."""
        follows = edge_mhz >= _STALL_MHZ if self.output > 0 else edge_mhz <= -_STALL_MHZ
        is_well = follows or abs(self.output) <= _STALL_OUTPUT
        self._stalled_ms = 0 if is_well else self._stalled_ms + elapsed_ms
        return self._stalled_ms >= _STALL_MS

    def release(self) -> None:
        """Forget the set-point at once."""
        self.target_mhz = self.ramped_mhz = self.output = self._stalled_ms = self._integral = 0
