"""Set-points on their way: how fast they may change, and whether a motor follows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from vvvaltr.controller.core.gaits import Gait

_STARTED_SHARE, _STALLED_SHARE, _LEAST_HZ = 0.8, 0.4, 1.0  # of a set-point, and the least one that is judged


class SlewLimit:
    """Approaches a gait no faster than each motor may change. The ramp of a trial scales the whole gait instead."""

    def __init__(self, ramp_hz_s: Sequence[float]) -> None:
        self._ramp_hz_s = tuple(ramp_hz_s)
        self._before: tuple[float, Gait] | None = None

    def restart(self) -> None:
        """Begin from rest."""
        self._before = None

    def duration_s(self, gait: Gait) -> float:
        """Return how long it takes from rest to ``gait``."""
        ramps = zip(gait.frequency_hz, self._ramp_hz_s, strict=True) if self._ramp_hz_s else ()
        return max((abs(hz) / ramp_hz_s for hz, ramp_hz_s in ramps if ramp_hz_s), default=0.0)

    def towards(self, gait: Gait, now_s: float) -> Gait:
        """Return how much of ``gait`` is due at ``now_s``."""
        if not any(self._ramp_hz_s):
            return gait
        then_s, last = self._before or (now_s, gait.scaled(0.0))
        due_hz = tuple(
            max(before - ramp * (now_s - then_s), min(before + ramp * (now_s - then_s), wanted)) if ramp else wanted
            for before, wanted, ramp in zip(last.frequency_hz, gait.frequency_hz, self._ramp_hz_s, strict=True)
        )
        step = replace(gait, frequency_hz=due_hz)
        self._before = (now_s, step)
        return step


class Follower:
    """Compares what a motor does with its set-point. Times as ``time.monotonic()`` counts."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.wanted_hz = 0.0
        self._told_s = self._followed_s = 0.0
        self._has_started = False

    def want(self, frequency_hz: float, now_s: float) -> None:
        """Note a set-point; after one that is much greater, or nearly 0, the motor has time to start again."""
        if abs(frequency_hz) < _LEAST_HZ or abs(frequency_hz - self.wanted_hz) > _STALLED_SHARE * abs(frequency_hz):
            self._has_started, self._told_s = False, now_s
        self.wanted_hz = frequency_hz

    def has_stalled(self, frequency_hz: float, t_s: float, start_s: float, lag_s: float) -> bool:
        """Return whether the motor, at ``frequency_hz`` at ``t_s``, has not started in time or lags for too long."""
        if abs(self.wanted_hz) < _LEAST_HZ:
            return False
        share = frequency_hz / self.wanted_hz
        if share > _STALLED_SHARE:
            self._followed_s = t_s
        self._has_started = self._has_started or share > _STARTED_SHARE
        return t_s > (self._followed_s + lag_s if self._has_started else self._told_s + start_s)
