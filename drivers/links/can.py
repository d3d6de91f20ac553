"""A CAN bus, by python-can: socketcan, slcan, virtual, and whatever else python-can supports."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any, Protocol

import can

from vvvaltr.controller.core.errors import NotUnderstood
from vvvaltr.controller.core.spelling import unknown
from vvvaltr.drivers.links.link import lost_link
from vvvaltr.drivers.links.local import PORTS, SERIAL_INTERFACES, claim_bus, claim_port, serial_port_of

_log = logging.getLogger(__name__)

_SYMPTOMS = (can.CanError, TypeError, ValueError)  # a closed socket raises ValueError
_SYMPTOMS_OF_READING = (can.CanError, TypeError)  # when reading, ValueError means a garbled frame
_GARBLED = (ValueError, IndexError)  # what the slcan parser raises for a line that is not a frame
_WRITE_TIMEOUT_S = 0.2  # pyserial also counts the time for which this process itself was held up
_BACKLOG_S = 0.02  # frames already waiting are still read for this long after the deadline
# The bus adapter needs no time to start, and a longer read timeout wakes the I/O thread less often.
_SLCAN = {"sleep_after_open": 0.0, "timeout": 0.005}


@dataclass(frozen=True, slots=True)
class Frame:
    """A classic CAN frame with an 11-bit identifier; a remote frame requests data and carries none."""

    identifier: int
    data: bytes = b""
    is_remote: bool = False


class Closing(Protocol):
    """A claim on a bus."""

    def close(self) -> None:
        """Give it up."""
        ...


class CanLink:
    """A CAN bus.

    Args:
        interface, channel, bitrate: as python-can names them.
        options: further arguments for the interface.
        is_mock: whether it is the device's end, which shares the bus with the controller's; a person named the bus.

    Raises:
        NotUnderstood: the bus is not one of this computer, or an option could lead elsewhere.
        DeviceError: another program drives the bus.
        LinkLost: the bus could not be opened.
    """

    def __init__(
        self,
        interface: str,
        channel: str,
        bitrate: int,
        options: Mapping[str, Any] | None = None,
        is_mock: bool = False,
    ) -> None:
        self._name = f"{interface}:{channel}"
        self._claim: Closing | None = None
        chosen = {**(_SLCAN if interface == "slcan" else {}), **(options or {})}
        with ExitStack() as undo, lost_link(self._name, *_SYMPTOMS, ImportError):
            undo.callback(self._release)
            if not is_mock:
                PORTS.check_bus(interface, channel, options or {})
            if interface not in can.VALID_INTERFACES:
                raise NotUnderstood(unknown("CAN interface", interface, sorted(can.VALID_INTERFACES)))
            if not is_mock:
                self._claim = _claim(interface, channel)
            # The person's own configuration of python-can must not change what the robot's file says.
            self._bus = can.Bus(interface=interface, channel=channel, bitrate=bitrate, ignore_config=True, **chosen)
            undo.pop_all()
        self.garbled = 0

    @property
    def name(self) -> str:
        """Interface and channel."""
        return self._name

    def send(self, frame: Frame) -> None:
        """Send a frame. A bus that does not take it within 0.2 s is lost. Raises LinkLost."""
        message = can.Message(
            arbitration_id=frame.identifier,
            data=frame.data,
            is_remote_frame=frame.is_remote,
            is_extended_id=False,
        )
        with lost_link(self._name, *_SYMPTOMS):
            self._bus.send(message, timeout=_WRITE_TIMEOUT_S)

    def frames(self, until_s: float) -> Iterator[Frame]:
        """Yield frames as they come in until ``until_s``, as ``time.monotonic()`` counts. Raises LinkLost.

        Garbled lines of an slcan adapter are counted, logged and skipped. Error frames are skipped too: the CAN
        controllers retransmit, and a bus on which that does not help becomes silent.
        """
        while (left_s := until_s - time.monotonic()) > -_BACKLOG_S:
            try:
                with lost_link(self._name, *_SYMPTOMS_OF_READING):
                    message = self._received(max(0.0, left_s))
            except _GARBLED as error:
                self.garbled += 1
                _log.debug("%s: garbled frame skipped, the %d. on this bus (%s)", self._name, self.garbled, error)
                continue
            if message is None and left_s <= 0.0:
                return
            if message is not None and not (message.is_error_frame or message.is_extended_id):
                yield Frame(message.arbitration_id, bytes(message.data), message.is_remote_frame)

    def _received(self, timeout_s: float) -> can.Message | None:
        try:
            return self._bus.recv(timeout=timeout_s)
        except can.CanOperationError as error:
            if isinstance(error.__cause__, UnicodeDecodeError):
                # slcan reports this as a lost line, and would stop at the same bytes again and again.
                self._bus.flush()  # type: ignore[attr-defined]
                raise error.__cause__ from None
            raise

    def close(self) -> None:
        """Release the bus. Idempotent; never raises."""
        with suppress(*_SYMPTOMS, OSError):
            self._bus.shutdown()
        # After unplugging, python-can gives up before it has closed the port beneath slcan.
        with suppress(AttributeError, OSError, *_SYMPTOMS):
            self._bus.serialPortOrig.close()  # type: ignore[attr-defined]
        self._release()

    def _release(self) -> None:
        if self._claim is not None:
            self._claim.close()
            self._claim = None


def _claim(interface: str, channel: str) -> Closing | None:
    """Keep other programs from the bus. Raises DeviceError or OSError."""
    if interface in SERIAL_INTERFACES and "://" not in channel:
        return claim_port(serial_port_of(channel))
    return claim_bus(interface, channel)
