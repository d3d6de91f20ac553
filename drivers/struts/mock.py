"""Mock struts: three boards in the air of a socket, with what goes wrong with a radio."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType

from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.registry import MockLine
from vvvaltr.drivers.struts.air_port import AirPort
from vvvaltr.drivers.struts.boards import MAX_HZ, LaboratoryBoard, OwnBoard, RfduinoBoard, StrutBoard, rfduino_hz
from vvvaltr.drivers.struts.table import StrutsLineTable, StrutTable

_STRUTS = 3
_ADVERTISE_S = 0.5  # after a link is lost, as the laboratory's boards do
_SUPERVISION_S = 0.3  # time after which both ends of a radio link notice that it is lost
_CURVE = tuple((float(value), round(rfduino_hz(value), 3)) for value in (0x17, 0x80, 0xE0))


class StrutsDevice:
    """Three struts: satisfies ``vvvaltr.drivers.mocking.device.Device``.

    A program that ends without a word leaves its links up, as BlueZ does: only the expiry of commands stops the motors.

    Args:
        make_board: makes a board, at every boot.
        name: what the boards advertise, before their number.
        now_s: the present.
    """

    def __init__(self, make_board: Callable[[float], StrutBoard], name: str, now_s: float) -> None:
        self._make_board = make_board
        self.struts = tuple(
            MockStrut(make_board(now_s), f"{name}{number}", f"24:0A:C4:00:00:{number:02X}")
            for number in range(1, _STRUTS + 1)
        )
        self._outbox: deque[tuple[float, bytes]] = deque()  # when they are due
        self._inbox: deque[tuple[float, bytes]] = deque()
        self._slow_s = 0.0
        self._is_silent = False

    @property
    def applied_hz(self) -> tuple[float, ...]:
        """The frequencies that the outputs give in steady state."""
        return tuple(strut.board.motor.applied_hz for strut in self.struts)

    @property
    def watchdog(self) -> bool:
        """Whether a command has expired, and none has come since."""
        return any(strut.board.is_expired for strut in self.struts)

    @property
    def faults(self) -> tuple[str, ...]:
        """Stalls."""
        return tuple(f"{strut.name} {fault}" for strut in self.struts for fault in strut.board.faults)

    def on_bytes(self, data: bytes, now_s: float) -> bytes:
        """Take one packet; the answers come by ``tick``."""
        slow_s = self._slow_s if data[:1] in (b"W", b"w") else 0.0
        self._inbox.append((now_s + slow_s, data))
        return b""

    def tick(self, now_s: float) -> bytes:
        """Let time pass; return the next packet."""
        while self._inbox and self._inbox[0][0] <= now_s:
            self._take(self._inbox.popleft()[1], now_s)
        for strut in self.struts:
            report = strut.board.tick(now_s)
            if strut.is_lost(now_s):
                self._unlink(strut, now_s)
            elif report and strut.host is not None and strut.is_in_range and not self._is_silent:
                self._say(b"N", strut.host, report, now_s)
        return self._outbox.popleft()[1] if self._outbox and self._outbox[0][0] <= now_s else b""

    def begin_fault(self, fault: Fault, now_s: float) -> None:
        """Jam a motor, empty a battery, silence all, slow the links, or put a strut out of range."""
        strut = self.struts[(fault.motor - 1) % len(self.struts)]
        match fault.kind:
            case Kind.STALL:
                strut.board.motor.is_jammed = True
            case Kind.ERROR:
                strut.board.set_error(True)
            case Kind.SILENCE:
                self._is_silent = True
            case Kind.SLOW:
                self._slow_s = fault.delay_s
            case Kind.DROP_OUT:
                strut.leave(now_s)

    def end_fault(self, fault: Fault, now_s: float) -> None:
        """End the cause of a fault; a link that was lost has to be made anew."""
        strut = self.struts[(fault.motor - 1) % len(self.struts)]
        match fault.kind:
            case Kind.STALL:
                strut.board.motor.is_jammed = False
            case Kind.ERROR:
                strut.board.set_error(False)
            case Kind.SILENCE:
                self._is_silent = False
            case Kind.SLOW:
                self._slow_s = 0.0
            case Kind.DROP_OUT:
                strut.come_back()

    def reboot(self, now_s: float) -> None:
        """Reboot all boards: their links are lost."""
        self._is_silent, self._slow_s = False, 0.0
        self._inbox.clear()
        for strut in self.struts:
            strut.board = self._make_board(now_s)
            self._unlink(strut, now_s)
            strut.come_back()

    def _take(self, packet: bytes, now_s: float) -> None:
        kind, host, text = packet[:1], packet[1] if len(packet) > 1 else 0, packet[2:]
        match kind:
            case b"?":
                seen = [f"{strut.address} {strut.name}" for strut in self.struts if strut.is_in_air(now_s)]
                self._say(b"A", 0, "\n".join(seen).encode(), now_s)
            case b"C":
                self._link(text.decode(errors="replace"), host, now_s)
            case b"H":
                self._outbox.clear()
                for strut in self.struts:
                    strut.host = None
            case b"P":
                for strut in self.struts:
                    self._unlink(strut, now_s)
            case b"D" | b"W" | b"w":
                for strut in self.struts:
                    if strut.host == host and strut.is_in_range:
                        self._take_of_host(kind, strut, text, now_s)

    def _take_of_host(self, kind: bytes, strut: MockStrut, text: bytes, now_s: float) -> None:
        if kind == b"D":
            self._unlink(strut, now_s)
            return
        strut.board.write(text, now_s)
        if kind == b"W" and strut.host is not None:
            self._say(b"W", strut.host, text, now_s)

    def _link(self, address: str, host: int, now_s: float) -> None:
        for strut in self.struts:
            if strut.address == address and strut.is_in_air(now_s):
                if not strut.is_linked:
                    strut.board.connect()
                strut.is_linked, strut.host = True, host
                self._say(b"C", host, b"", now_s)

    def _unlink(self, strut: MockStrut, now_s: float) -> None:
        if not strut.is_linked:
            return
        strut.board.disconnect()
        if strut.host is not None:
            self._say(b"D", strut.host, b"", now_s)
        strut.is_linked, strut.host = False, None
        strut.advertises_s = now_s + _ADVERTISE_S

    def _say(self, kind: bytes, host: int, text: bytes, now_s: float) -> None:
        due_s = max(now_s + self._slow_s, self._outbox[-1][0] if self._outbox else 0.0)
        self._outbox.append((due_s, kind + bytes([host]) + text))


class MockStrut:
    """A board and its radio."""

    def __init__(self, board: StrutBoard, name: str, address: str) -> None:
        self.board = board
        self.name = name
        self.address = address
        self.is_linked = False
        self.host: int | None = None  # number that a program which still lives has given it
        self.is_in_range = True
        self.advertises_s = -math.inf
        self._left_s = math.inf

    def is_in_air(self, now_s: float) -> bool:
        """Whether a program can find it: one that is linked, but by no program that lives, is known to the system."""
        return self.is_in_range and self.host is None and now_s >= self.advertises_s

    def is_lost(self, now_s: float) -> bool:
        """Whether its link is lost by now."""
        return self.is_linked and now_s >= self._left_s + _SUPERVISION_S

    def leave(self, now_s: float) -> None:
        """Go out of range."""
        self.is_in_range, self._left_s = False, now_s

    def come_back(self) -> None:
        """Be within range again: in time, the link is as it was."""
        self.is_in_range, self._left_s = True, math.inf


def make_mock(link: Path, firmware: str = "vvvaltr") -> MockLine:
    """Put three struts into the air of the socket ``link``. Raises ValueError for a name that is taken."""
    make_board, name = _FIRMWARES[firmware]
    device = StrutsDevice(make_board, name, time.monotonic())
    is_rfduino = firmware == "rfduino"
    motors = tuple(
        StrutTable(strut=strut.name, max_hz=_CURVE[-1][1] if is_rfduino else MAX_HZ, curve=_CURVE if is_rfduino else ())
        for strut in device.struts
    )
    table = StrutsLineTable(adapter=str(link), firmware="rfduino" if is_rfduino else "auto", motor=motors)
    return MockLine(AirPort(link), device, table)


_FIRMWARES: Mapping[str, tuple[Callable[[float], StrutBoard], str]] = MappingProxyType(
    {
        "vvvaltr": (OwnBoard, "VVVALTR"),
        "laboratory": (LaboratoryBoard, "SPVVVECTR"),
        "laboratory-pwm": (partial(LaboratoryBoard, takes_pulse_widths=True), "SPVVVECTR"),
        "rfduino": (RfduinoBoard, "RFduino"),
    }
)
