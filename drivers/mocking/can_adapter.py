"""Adapters between a mock CAN device and its line: slcan text on a serial line, and a real or virtual bus."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from vvvaltr.drivers.links.can import CanLink, Frame
from vvvaltr.drivers.mocking.faults import Fault

_LONGEST = 32  # no command of slcan is longer
_BELL, _DONE = b"\a", b"\r"


class CanDevice(Protocol):
    """The logic of devices on a CAN bus: as ``Device``, with frames instead of bytes."""

    @property
    def applied_hz(self) -> tuple[float, ...]:
        """What the motors are set to now."""
        ...

    @property
    def watchdog(self) -> bool:
        """Whether a watchdog has stopped the motors."""
        ...

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults that the devices have now."""
        ...

    def on_frame(self, frame: Frame, now_s: float) -> list[Frame]:
        """Receive a frame; return the replies."""
        ...

    def tick(self, now_s: float) -> list[Frame]:
        """Let time pass; return the frames that the devices send unprompted."""
        ...

    def begin_fault(self, fault: Fault, now_s: float) -> None:
        """Let a fault begin."""
        ...

    def end_fault(self, fault: Fault, now_s: float) -> None:
        """End a fault's cause."""
        ...

    def reboot(self, now_s: float) -> None:
        """Reboot."""
        ...


def to_text(frame: Frame) -> bytes:
    """Return a frame as a line of slcan."""
    kind, data = ("r", "") if frame.is_remote else ("t", frame.data.hex().upper())
    return f"{kind}{frame.identifier:03X}{len(frame.data)}{data}\r".encode()


def from_text(line: bytes) -> Frame | None:
    """Return the frame of a line of slcan, without its end; None for a line that is not a standard frame."""
    try:
        text = line.decode("ascii")
        identifier, length = int(text[1:4], 16), int(text[4:5])
        data = bytes.fromhex(text[5:]) if text[0] == "t" else b""
    except (ValueError, IndexError):
        return None
    is_remote = text[0] == "r"
    is_sound = text[0] in "tr" and 0 <= identifier < 0x800 and length <= 8 and (is_remote or len(data) == length)
    return Frame(identifier, data, is_remote) if is_sound else None


class SlcanAdapter:
    """An adapter between a serial line and a CAN bus, with a device on that bus: a mock ``Device``."""

    def __init__(self, device: CanDevice, is_open: bool = False) -> None:
        self._device = device
        self._is_open = is_open
        self._line = bytearray()

    @property
    def applied_hz(self) -> tuple[float, ...]:
        """What the motors are set to now."""
        return self._device.applied_hz

    @property
    def watchdog(self) -> bool:
        """Whether a watchdog has stopped the motors."""
        return self._device.watchdog

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults that the devices have now."""
        return self._device.faults

    def on_bytes(self, data: bytes, now_s: float) -> bytes:
        """Take in text; returns replies and frames."""
        said = b""
        for byte in data:
            if byte != _DONE[0]:
                self._line.append(byte)
                del self._line[_LONGEST:]
                continue
            said += self._obey(bytes(self._line), now_s)
            self._line.clear()
        return said

    def tick(self, now_s: float) -> bytes:
        """Let time pass; return the frames on the bus."""
        frames = self._device.tick(now_s)
        return b"".join(map(to_text, frames)) if self._is_open else b""

    def begin_fault(self, fault: Fault, now_s: float) -> None:
        """Let a fault of the device begin."""
        self._device.begin_fault(fault, now_s)

    def end_fault(self, fault: Fault, now_s: float) -> None:
        """End the cause of a fault of the device."""
        self._device.end_fault(fault, now_s)

    def reboot(self, now_s: float) -> None:
        """Reboot the device; the adapter is powered by the controller."""
        self._device.reboot(now_s)

    def _obey(self, line: bytes, now_s: float) -> bytes:
        command = line[:1]
        if command in (b"t", b"r"):
            frame = from_text(line)
            if frame is None or not self._is_open:
                return _BELL
            return b"z" + _DONE + b"".join(map(to_text, self._device.on_frame(frame, now_s)))
        if command in (b"O", b"L", b"C"):
            self._is_open = command != b"C"
            return _DONE
        known = {b"S": _DONE, b"s": _DONE, b"": _DONE, b"V": b"V1013\r", b"N": b"N0000\r", b"F": b"F00\r", b"Z": _DONE}
        return known.get(command, _BELL)


class BusPort:
    """A ``Port`` on a CAN bus of python-can, for a device behind slcan text."""

    def __init__(self, interface: str, channel: str, bitrate: int, options: Mapping[str, Any] | None = None) -> None:
        self._open: Callable[[], CanLink] = lambda: CanLink(interface, channel, bitrate, options, is_mock=True)
        self._link: CanLink | None = self._open()
        self.name = self._link.name
        self._text = bytearray()

    def receive(self, now_s: float) -> bytes:
        """Return what came from the bus."""
        text, self._text = bytes(self._text), bytearray()
        return text

    def send(self, data: bytes, now_s: float) -> None:
        """Put the frames of ``data`` on the bus; a line that is not a frame is lost, like a garbled one."""
        for line in data.split(_DONE):
            if self._link is not None and (frame := from_text(line)) is not None:
                self._link.send(frame)

    def wait(self, until_s: float) -> None:
        """Return at ``until_s``, or with the next frame."""
        if self._link is None:
            time.sleep(max(0.0, until_s - time.monotonic()))
            return
        for frame in self._link.frames(until_s):
            self._text += to_text(frame)
            return

    def unplug(self) -> None:
        """Leave the bus."""
        if self._link is not None:
            self._link.close()
        self._link = None

    def plug(self) -> None:
        """Join the bus again."""
        if self._link is None:
            self._link = self._open()

    def close(self) -> None:
        """Leave the bus for good."""
        self.unplug()
