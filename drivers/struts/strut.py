"""What the driver knows of one strut: what it was told, what it reported, and whether the two agree."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque

from vvvaltr.controller.core.errors import DeviceFault, DeviceTimeout, LinkLost
from vvvaltr.drivers.links.remote_clock import RemoteClock
from vvvaltr.drivers.motor_line import WATCHDOG, Patience
from vvvaltr.drivers.struts.protocol import (
    DEVICE_CLOCK_MS,
    SEQUENCES,
    Added,
    Report,
    encode_held,
    encode_target,
)

HOLD_S = 0.4  # hold of one target: our firmware stops the motor after eight lost ones
_REST_S = 0.2  # between two stops to a motor that is known to rest
_LATE_S = 0.5  # a report may show what the strut was told so long ago, or its period earlier
_MAX_BEHIND = 20  # commands sent that a strut has not received yet
# The laboratory's boards: mean of the last ten speeds, one each 0.05 s; up to 3 s to reach a speed.
_WINDOW_S, _SPIN_UP_S, _SETTLE_S = 0.5, 3.5, 4.0
_TOLERANCE = 0.25
_LEAST_RPM = 60.0


class Strut(ABC):
    """One strut. Times are as ``time.monotonic()`` counts.

    Args:
        name: its name in messages.
        report: the first one.
        heard_s: when that came.
    """

    has_watchdog = True

    def __init__(self, name: str, report: Report, heard_s: float) -> None:
        self.name = f"strut {name}"
        self.heard_s = heard_s
        self.report = report
        self._told: deque[tuple[float, int]] = deque([(-math.inf, 0)])
        self._sent_s = -math.inf

    @property
    def is_ready(self) -> bool:
        """Whether enough is known of it, and it has obeyed the stop that the driver began with."""
        return self.report.target_rpm == 0.0

    @property
    @abstractmethod
    def frequency_hz(self) -> float:
        """The measured frequency."""

    @property
    @abstractmethod
    def measured_s(self) -> float:
        """When that was measured."""

    @property
    def battery_v(self) -> float | None:
        """The battery's voltage; None where it is not known."""
        return None

    @abstractmethod
    def patience(self, spin_up_s: float) -> Patience:
        """Return how much time it needs; ``spin_up_s`` is what the robot's file allows for a start."""

    def tell(self, rpm: int, sequence: int, now_s: float) -> bytes | None:
        """Return the text that sets a target now; None if there is no need to say anything."""
        told_rpm = self._told[-1][1]
        if rpm == told_rpm == self.report.target_rpm == 0 and now_s - self._sent_s < _REST_S:
            return None
        text = self._text(rpm, sequence, rpm == told_rpm)
        if text is not None:
            self._sent_s = now_s
        if rpm != told_rpm:
            self._told.append((now_s, rpm))
        return text

    def take(self, report: Report, heard_s: float) -> None:
        """Take a report.

        Raises:
            DeviceFault: the motor has stalled, or the strut does not do what it was told.
            DeviceTimeout: the strut has not received what it was told.
            LinkLost: it has rebooted.
        """
        self._note(report, heard_s)
        recent = self._recent_rpm(heard_s)
        if round(report.target_rpm) in recent:
            return
        if report.target_rpm == 0.0:
            raise DeviceFault("stall", f"{self.name}: its motor stalled, and the strut switched it off; free the motor")
        raise DeviceFault(
            "target",
            f"{self.name} regulates to {report.target_rpm:g} turns a minute instead of {recent[-1]}; end other "
            "programs that use it",
        )

    @abstractmethod
    def _text(self, rpm: int, sequence: int, is_repeat: bool) -> bytes | None:
        """Return the text for a target; None where a repeat would do harm."""

    @abstractmethod
    def _note(self, report: Report, heard_s: float) -> None:
        """Keep a report, and judge what is special to the firmware."""

    @property
    def _period_s(self) -> float:
        return 0.0

    def _recent_rpm(self, heard_s: float) -> list[int]:
        """Return the targets that a report of this moment may show."""
        since_s = heard_s - _LATE_S - self._period_s
        while len(self._told) > 1 and self._told[1][0] < since_s:
            self._told.popleft()
        return [rpm for _, rpm in self._told]


class OwnStrut(Strut):
    """A strut with our firmware: its commands expire, and it stops when the link is lost."""

    def __init__(self, name: str, report: Report, heard_s: float) -> None:
        super().__init__(name, report, heard_s)
        assert report.added is not None
        self._first = self._added = report.added
        self._clock = RemoteClock()
        self._uptime_s = report.added.device_ms / 1000.0
        self.heard_s = self._clock.here_s(self._uptime_s, heard_s)
        self._sequence = 0

    @property
    def frequency_hz(self) -> float:
        """The measured frequency."""
        return self.report.average_rpm / 60.0

    @property
    def measured_s(self) -> float:
        """When the strut sent it."""
        return self.heard_s

    @property
    def battery_v(self) -> float | None:
        """The battery's voltage; None where it is not wired."""
        return self._added.battery_v

    def patience(self, spin_up_s: float) -> Patience:
        """Return how much time it needs: the report of a stalled motor comes twice."""
        return Patience(stale_s=0.5, start_s=spin_up_s, lag_s=0.06, settle_s=max(0.6, spin_up_s + 0.3))

    def _text(self, rpm: int, sequence: int, is_repeat: bool) -> bytes:
        self._sequence = sequence
        return encode_held(rpm, HOLD_S, sequence)

    def _note(self, report: Report, heard_s: float) -> None:
        added = report.added
        if added is None or added.boot_id != self._added.boot_id:
            raise LinkLost(f"{self.name} has rebooted; check its battery")
        ahead = (added.sequence - self._added.sequence) % SEQUENCES
        if ahead == 0:
            return  # twice the same: harmless, and nothing new
        if ahead >= SEQUENCES // 2:
            raise DeviceFault("sequence", f"{self.name}: report {added.sequence} came after {self._added.sequence}")
        self._uptime_s += (added.device_ms - self._added.device_ms) % DEVICE_CLOCK_MS / 1000.0
        self.heard_s = self._clock.here_s(self._uptime_s, heard_s)
        self.report, self._added = report, added
        self._judge(added)

    def _judge(self, added: Added) -> None:
        if added.stalls != self._first.stalls:
            raise DeviceFault("stall", f"{self.name}: its motor stalled, and the strut switched it off; free the motor")
        if added.expiries != self._first.expiries:
            raise DeviceFault(WATCHDOG, f"{self.name}: its watchdog stopped the motor: no command came in time")
        behind = (self._sequence - added.command) % SEQUENCES
        if behind > _MAX_BEHIND:
            raise DeviceTimeout(f"{self.name} has not received the last {behind} commands; bring it nearer")


class LaboratoryStrut(Strut):
    """A strut with the laboratory's firmware: no watchdog, and a stall that shows as target 0 alone."""

    has_watchdog = False

    def __init__(self, name: str, report: Report, heard_s: float) -> None:
        super().__init__(name, report, heard_s)
        self._heard_period_s = 0.0
        self._sense = 1.0

    @property
    def is_ready(self) -> bool:
        """Whether it has reported twice, so that its period is known, and has obeyed the first stop."""
        return super().is_ready and self._heard_period_s > 0.0

    @property
    def frequency_hz(self) -> float:
        """The mean of the last 0.5 s; its sign is that of the target, for one channel of pulses has none."""
        return math.copysign(self.report.average_rpm / 60.0, self._sense)

    @property
    def measured_s(self) -> float:
        """The middle of the time that the mean is of."""
        return self.heard_s - _WINDOW_S / 2.0

    def patience(self, spin_up_s: float) -> Patience:
        """Return how much time it needs; the board watches for stalls by itself."""
        return Patience(2.5 * self._heard_period_s + 0.2, math.inf, math.inf, max(_SETTLE_S, spin_up_s + _WINDOW_S))

    @property
    def _period_s(self) -> float:
        return self._heard_period_s

    def _text(self, rpm: int, sequence: int, is_repeat: bool) -> bytes | None:
        if rpm:
            self._sense = math.copysign(1.0, rpm)
            if is_repeat:
                return None  # it would start a stalled motor again, and hide the stall
        return encode_target(rpm)

    def _note(self, report: Report, heard_s: float) -> None:
        if report.added is not None:
            raise LinkLost(f"{self.name} has another firmware now; check what else is switched on")
        if self._heard_period_s == 0.0:
            self._heard_period_s = max(0.05, heard_s - self.heard_s)
        self.report, self.heard_s = report, heard_s
        since_s, rpm = self._told[-1]
        wrong_rpm = abs(abs(report.average_rpm) - abs(rpm))
        is_settled = abs(rpm) > _LEAST_RPM and heard_s - since_s > _SPIN_UP_S and round(report.target_rpm) == rpm
        if is_settled and wrong_rpm > _TOLERANCE * abs(rpm):
            raise DeviceFault(
                "speed",
                f"{self.name}: set to {abs(rpm) / 60.0:.1f} Hz, its motor turns at "
                f"{abs(report.average_rpm) / 60.0:.1f} Hz after {_SPIN_UP_S:g} s; if its firmware is the one for pulse "
                "widths (BLE-PWM), which looks the same, flash the one for turns a minute, else check the battery",
            )
