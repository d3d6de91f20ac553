"""What a mock device's logic has to offer; line, clock, faults and motion are the frame's."""

from __future__ import annotations

from typing import Protocol

from vvvaltr.drivers.mocking.faults import Fault


class Device(Protocol):
    """The logic of one device, or of several on one line. Times count in seconds on one monotonic clock."""

    @property
    def applied_hz(self) -> tuple[float, ...]:
        """What the output stages are set to now, (motors,); 0 for a motor that is off or stalled."""
        ...

    @property
    def watchdog(self) -> bool:
        """Whether the watchdog has stopped the motors, and no command came since."""
        ...

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults that the device has now, in words or codes of its own."""
        ...

    def on_bytes(self, data: bytes, now_s: float) -> bytes:
        """Take in bytes as they cross the line, in pieces of any length; returns the reply, or nothing."""
        ...

    def tick(self, now_s: float) -> bytes:
        """Let time pass (every few ms); returns what the device says by itself, a whole message or nothing."""
        ...

    def begin_fault(self, fault: Fault, now_s: float) -> None:
        """Suffer ``fault``, of a kind in ``faults.DEVICE_KINDS``. Raises ValueError for one that it cannot have."""
        ...

    def end_fault(self, fault: Fault, now_s: float) -> None:
        """Be rid of the cause of ``fault``; a fault that the device latches stays latched."""
        ...

    def reboot(self, now_s: float) -> None:
        """Start afresh, as after a loss of power: forget everything that is not in permanent memory."""
        ...
