"""The interface of a mock device's logic. ``PluggedDevice`` adds line, clock, fault script and moving twin."""

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
        """Whether the watchdog has stopped the motors and no command has come since."""
        ...

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults that the device has now, in its own words or codes."""
        ...

    def on_bytes(self, data: bytes, now_s: float) -> bytes:
        """Receive bytes as they cross the line, in pieces of any length; return the reply, or nothing."""
        ...

    def tick(self, now_s: float) -> bytes:
        """Let time pass (every few ms); return what the device sends unprompted: a whole message or nothing."""
        ...

    def begin_fault(self, fault: Fault, now_s: float) -> None:
        """Let ``fault`` begin, of a kind in ``faults.DEVICE_KINDS``. Raises ValueError for one that it cannot have."""
        ...

    def end_fault(self, fault: Fault, now_s: float) -> None:
        """End the cause of ``fault``; a fault that the device latches stays latched."""
        ...

    def reboot(self, now_s: float) -> None:
        """Reboot, as after a loss of power: forget everything that is not in permanent memory."""
        ...
