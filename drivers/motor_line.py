"""What the author of a driver writes: a line to the motors, which encodes and decodes one device's protocol.

What holds for every device, above all that its motors stop, is in ``held_motors``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.values import MotorState

WATCHDOG = "watchdog"  # code of the DeviceFault of a device whose watchdog stopped the motors
LOW_SUPPLY = "supply voltage too low"  # in the message of the DeviceFault of a device whose battery is flat


@dataclass(frozen=True, slots=True)
class Patience:
    """How much time a device is given before something is wrong. The defaults suit a device on a wire.

    Args:
        stale_s: how long it may be silent.
        start_s: how long a motor with a sensor may take to start; infinite where the device watches that by itself.
        lag_s: how long a motor that has started may lag its set-point.
        settle_s: how long a motor takes until its measured frequency is that of the set-point.
    """

    stale_s: float = 0.4
    start_s: float = 0.3
    lag_s: float = 0.12
    settle_s: float = 0.6


@runtime_checkable
class Unhurried(Protocol):
    """A line whose device takes its time, over the radio for instance."""

    @property
    def patience(self) -> Patience:
        """How much time it is given."""
        ...


class MotorLine(Protocol):
    """The motors on one open line: what the author of a driver writes.

    Gaits arrive checked: number of motors, limits and quantities by the robot's guard. Frequencies are in Hz; the line
    applies the motors' calibration curves.

    ``send``, ``repeat`` and ``rest`` are called from two threads, one at a time; ``listen`` from the I/O thread alone,
    while the others may go on. Times are as ``time.monotonic()`` counts.
    """

    @property
    def name(self) -> str:
        """Name of the line in messages: its port."""
        ...

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        ...

    @property
    def quantities(self) -> frozenset[Quantity]:
        """What of a gait the device can apply."""
        ...

    @property
    def period_s(self) -> float:
        """Time between two calls of ``repeat``; 0.02 where one call tells all motors."""
        ...

    @property
    def watchdog_s(self) -> float:
        """Longest time after the last set-point until the device stops the motors by itself; infinite if never."""
        ...

    @property
    def heard_s(self) -> float:
        """Time of the device's last valid message; of several devices, the time of the one silent for longest."""
        ...

    def check(self, gait: Gait) -> None:
        """Raise ValueError if the device cannot encode or reach the frequencies of ``gait``. Sends nothing."""
        ...

    def send(self, gait: Gait) -> None:
        """Send the set-point of all motors, without waiting. Raises LinkLost."""
        ...

    def repeat(self, gait: Gait) -> None:
        """Send a set-point that hardly changes; a slow line may send one motor at a time. Raises LinkLost."""
        ...

    def rest(self) -> None:
        """Send the command that stops all motors, without waiting; called again and again. Raises LinkLost."""
        ...

    def listen(self, until_s: float) -> None:
        """Receive the device's messages until ``until_s``, and request those that it does not send by itself.

        Raises:
            LinkLost: the line is gone.
            DeviceFault: the device reports a fault, or sends a message that makes no sense.
            DeviceTimeout: an answer is overdue.
        """
        ...

    def state(self) -> MotorState:
        """Return what the device last reported that it applies."""
        ...

    def close(self) -> None:
        """Release the line; the motors have been told to stop, or the line is lost. Idempotent; never raises."""
        ...


class Armable(Protocol):
    """A line that has been opened, but whose device has not been found and armed yet."""

    def arm(self) -> None:
        """Find the device, arm its watchdog and clear old faults. Raises DeviceError."""
        ...

    def close(self) -> None:
        """Release the line."""
        ...


LineT = TypeVar("LineT", bound=Armable)


def arm_or_close(line: LineT) -> LineT:
    """Return ``line``, armed. Where that fails it is closed, so that it can be opened again. Raises as ``arm`` does."""
    try:
        line.arm()
    except BaseException:
        line.close()
        raise
    return line
