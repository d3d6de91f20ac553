"""A run as a service of systemd: it tells that it has begun, that it is alive, and what it is at."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from typing import Self

from vvvaltr.controller.core.records import Event, EventKind, LoggedTrial

_VARIABLE = "NOTIFY_SOCKET"


class ServiceNotices:
    """An observer that notifies systemd, by the protocol of sd_notify(3): one datagram a notice.

    The watchdog is fed once a trial and once an event, by the loop itself: a loop that hangs is killed and begun again.

    Args:
        address: of systemd's socket; a leading ``@`` stands for an abstract one.
    """

    def __init__(self, address: str) -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)

    @classmethod
    def from_environment(cls) -> Self | None:
        """Return the observer where systemd wants notices; None elsewhere."""
        address = os.environ.get(_VARIABLE)
        return cls(address) if address else None

    def on_trial(self, logged: LoggedTrial) -> None:
        """Tell of a trial."""
        speed = "" if logged.score is None else f", {1000.0 * logged.score:.1f} mm/s"
        self._send(f"WATCHDOG=1\nSTATUS=trial {logged.trial.number}: {logged.trial.outcome.words}{speed}")

    def on_event(self, event: Event) -> None:
        """Tell of an event."""
        states = {EventKind.BEGIN: "READY=1\n", EventKind.END: "STOPPING=1\n"}
        self._send(f"{states.get(event.kind, '')}WATCHDOG=1\nSTATUS={' '.join(event.text.split())}")

    def close(self) -> None:
        """Let go of the socket. Idempotent."""
        self._socket.close()

    def _send(self, notice: str) -> None:
        with suppress(OSError):  # a systemd that is not there must not end a run
            self._socket.sendto(notice.encode(), self._address)
