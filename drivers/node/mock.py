"""A mock motor node: the real firmware on a simulated board."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from pathlib import Path

from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.port import PtyPort
from vvvaltr.drivers.node.firmware import core
from vvvaltr.drivers.node.firmware.simulated_board import COUNTS_PER_TURN, SimulatedBoard
from vvvaltr.drivers.node.table import NodeLineTable, NodeMotorTable
from vvvaltr.drivers.registry import MockLine

_HEADROOM = 1.25  # of the frequency without load over the greatest that may be asked for
_MOTORS, _MAX_HZ = 3, 16.5  # as far as the planar twin's motors go
_RAMP_S = 0.15  # from rest to the greatest frequency
_TICKS_PER_S = 1_000_000
_FAULTS = {core.STALL: "stall", core.OVER_TEMPERATURE: "over_temperature"}


class NodeDevice:
    """Satisfies ``vvvaltr.drivers.mocking.device.Device``.

    Args:
        motor_count: number of motors.
        max_hz: the greatest frequency that it accepts.
        new_boot_id: called at every boot.
        now_s: the present.
    """

    def __init__(self, motor_count: int, max_hz: float, new_boot_id: Callable[[], int], now_s: float) -> None:
        self._settings = {
            "motors": motor_count,
            "max_mhz": round(1000 * max_hz),
            "no_load_mhz": round(1000 * max_hz * _HEADROOM),
            "ramp_mhz_s": round(1000 * max_hz / _RAMP_S),
            "counts_per_turn": COUNTS_PER_TURN,
            "sensors": core.CURRENT | core.MOTOR_TEMPERATURE | core.BOARD_TEMPERATURE,
        }
        self._new_boot_id = new_boot_id
        self._board = SimulatedBoard(motor_count, max_hz * _HEADROOM)
        self.reboot(now_s)

    @property
    def applied_hz(self) -> tuple[float, ...]:
        """The frequencies that the outputs give in steady state."""
        return tuple(motor.applied_hz for motor in self._board.motors)

    @property
    def measured_hz(self) -> tuple[float, ...]:
        """The frequencies at which the motors turn."""
        return tuple(motor.frequency_hz for motor in self._board.motors)

    @property
    def watchdog(self) -> bool:
        """Whether hold or watchdog has stopped the motors and no command has come since."""
        return bool(self._node.is_expired)

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults that have not been cleared."""
        faults = [_FAULTS[self._node.fault]] if self._node.fault else []
        faults += [
            f"motor {number} {_FAULTS[fault]}" for number, fault in enumerate(self._node.motor_faults, start=1) if fault
        ]
        return tuple(faults)

    def on_bytes(self, data: bytes, now_s: float) -> bytes:
        """Receive bytes; return the answers."""
        return bytes(self._node.on_bytes(data, _ticks(now_s) // 1000))

    def tick(self, now_s: float) -> bytes:
        """Let time pass; return telemetry when it is due."""
        now_us = _ticks(now_s)
        self._board.step(now_us)
        telemetry = bytes(self._node.tick(now_us // 1000, now_us))
        return b"" if self._is_silent else telemetry

    def begin_fault(self, fault: Fault, now_s: float) -> None:
        """Jam a motor, overheat one, or send no telemetry."""
        self._apply(fault, begins=True)

    def end_fault(self, fault: Fault, now_s: float) -> None:
        """End the cause of a fault."""
        self._apply(fault, begins=False)

    def reboot(self, now_s: float) -> None:
        """Reboot."""
        self._is_silent = False
        self._node = core.Node(self._board, self._settings, self._new_boot_id(), _ticks(now_s) // 1000)

    def _apply(self, fault: Fault, begins: bool) -> None:
        motor = self._board.motors[fault.motor - 1]
        match fault.kind:
            case Kind.STALL:
                motor.is_jammed = begins
            case Kind.ERROR:
                motor.is_hot = begins
            case Kind.SILENCE:
                self._is_silent = begins


def make_mock(link: Path, max_hz: float = _MAX_HZ) -> MockLine:
    """Plug in a node under the port ``link``. Raises ValueError for a name that is taken."""
    device = NodeDevice(_MOTORS, max_hz, lambda: random.getrandbits(30), time.monotonic())
    table = NodeLineTable(port=str(link), motor=(NodeMotorTable(max_hz=max_hz),) * _MOTORS)
    return MockLine(PtyPort(link, is_paced=True), device, table)


def _ticks(now_s: float) -> int:
    return int(now_s * _TICKS_PER_S)
