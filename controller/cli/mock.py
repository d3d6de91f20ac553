"""`vvvaltr mock`: a device to plug the controller into, with a robot that moves."""

from __future__ import annotations

import json
import os
import select
import signal
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import TYPE_CHECKING, Any

from vvvaltr.controller.cli.answer import Answer, Command
from vvvaltr.controller.core.errors import UserError

if TYPE_CHECKING:
    from vvvaltr.drivers.mocking.faults import Fault
    from vvvaltr.drivers.mocking.plugged import PluggedDevice

_STATUS_S = 0.05
_STDIN, _STDOUT = 0, 1


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("device", choices=("qik", "odrive", "node"), help="what to be")
    parser.add_argument("--robot", choices=("planar", "spatial"), default="planar", help="the twin that it moves")
    parser.add_argument("--tracker", default="stream", metavar="KIND", help="tracker that sees it (default stream)")
    parser.add_argument("--link", type=Path, metavar="PATH", help="name of the port (default: in a new directory)")
    parser.add_argument(
        "--faults",
        metavar="FILE",
        help="what goes wrong, and when: TOML or JSON; - for one JSON object a line, as it comes",
    )
    group = parser.add_argument_group("odrive on a CAN bus instead of slcan")
    group.add_argument("--interface", help="as python-can names it: socketcan, udp_multicast")
    group.add_argument("--channel", help="as python-can names it: vcan0")


def _execute(arguments: Namespace) -> Answer | None:
    from vvvaltr.controller.core.document import load_document
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.robot.mock import open_mock
    from vvvaltr.drivers.mocking.faults import FaultScript

    if (arguments.interface is None) != (arguments.channel is None) or (
        arguments.channel and arguments.device != "odrive"
    ):
        raise UserError("--interface and --channel go together, and with odrive alone")
    takes_faults = arguments.faults == "-"
    script = load_document(Path(arguments.faults), FaultScript) if arguments.faults and not takes_faults else None
    is_over = _EndingSignal()
    with ExitStack() as leaving:
        link = (arguments.link or Path(leaving.enter_context(TemporaryDirectory(prefix="vvvaltr-")), "port")).absolute()
        bus = (arguments.interface, arguments.channel) if arguments.interface else None
        with one_line_errors():
            mock = open_mock(
                arguments.device, link, arguments.robot, script.fault if script else (), bus, arguments.tracker
            )
        leaving.callback(mock.close)
        with suppress(BrokenPipeError):  # nobody reads on: whoever started the mock has ended
            _say({"port": mock.port, "robot_file": str(mock.robot_file), "tracker": mock.tracker})
            _run(mock.plugged, is_over, takes_faults)
    return None


def _run(plugged: PluggedDevice, is_over: Callable[[], bool], takes_faults: bool) -> None:
    """Run until the end, and say 20 times a second what the device does."""
    from vvvaltr.controller.core.errors import one_line_errors

    status = _Status(plugged)
    faults = _FaultLines() if takes_faults else None

    def each_time(now_s: float) -> bool:
        status.report(now_s)
        with one_line_errors():
            for fault in faults.read() if faults else ():
                plugged.befall(fault)
        return is_over()

    plugged.run(each_time)


def _say(status: dict[str, Any]) -> None:
    # A reader that is behind must not hold up the device: it misses some lines.
    if select.select((), (_STDOUT,), (), 0.0)[1]:
        os.write(_STDOUT, json.dumps(status).encode() + b"\n")


class _Status:
    """Says what a device does."""

    def __init__(self, plugged: PluggedDevice) -> None:
        self._plugged = plugged
        self._next_s = time.monotonic()

    def report(self, now_s: float) -> None:
        """Say it, if that is due."""
        if now_s < self._next_s:
            return
        self._next_s = max(self._next_s + _STATUS_S, now_s)
        _say(
            {
                "t_s": round(now_s, 6),
                "applied_hz": [round(hz, 6) for hz in self._plugged.applied_hz],
                "watchdog": self._plugged.watchdog,
                "faults": list(self._plugged.faults),
            }
        )


class _FaultLines:
    """Faults from standard input, one JSON object a line."""

    def __init__(self) -> None:
        self._text = b""

    def read(self) -> list[Fault]:
        """Return what has come. Raises ValueError for what is no fault."""
        import msgspec

        from vvvaltr.drivers.mocking.faults import Fault

        if not select.select((_STDIN,), (), (), 0.0)[0]:
            return []
        *lines, self._text = (self._text + os.read(_STDIN, 65536)).split(b"\n")
        return [msgspec.json.decode(line, type=Fault) for line in lines if line.strip()]


class _EndingSignal:
    """Notes that the mock is to end. A flag and no exception: the device ends between two steps, and cleans up."""

    def __init__(self) -> None:
        self._has_come = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._come)

    def __call__(self) -> bool:
        return self._has_come

    def _come(self, number: int, frame: FrameType | None) -> None:
        self._has_come = True


COMMAND = Command(
    help="be a device to plug the controller into, with a robot that moves",
    example="vvvaltr mock qik --robot planar --link qik0",
    add_arguments=_add_arguments,
    execute=_execute,
)
