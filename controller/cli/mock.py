"""`vvvaltr mock`: a simulated device on a port, with a simulated robot."""

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

from vvvaltr.controller.cli.answer import Answer, Subcommand
from vvvaltr.controller.cli.options import TWINS, number
from vvvaltr.controller.core.errors import NotUnderstood

if TYPE_CHECKING:
    from vvvaltr.drivers.mocking.faults import Fault
    from vvvaltr.drivers.mocking.plugged import PluggedDevice

_STATUS_S = 0.05
_STDIN, _STDOUT = 0, 1


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("device", metavar="DEVICE", help="qik, odrive, node, struts, or the driver of a plug-in")
    parser.add_argument("--robot", choices=TWINS, default="planar", metavar="NAME",
                        help="twin that the motors move: planar or spatial (default planar)")  # fmt: skip
    parser.add_argument(
        "--tracker",
        default="stream",
        metavar="KIND",
        help="tracker that sees it: stream, qtm, natnet or camera (default stream)",
    )
    parser.add_argument("--pose-rate", type=number(above=0.0, high=100.0), metavar="HZ", default=50.0,
                        help="how often the tracker sends a pose (default 50; a common camera: 30)")  # fmt: skip
    parser.add_argument("--max-hz", type=number(above=0), metavar="HZ",
                        help="what its motors reach (node, odrive; default 16.5)")  # fmt: skip
    parser.add_argument("--firmware", default="", metavar="NAME",
                        help="what struts run: vvvaltr (default), laboratory, laboratory-pwm, rfduino")  # fmt: skip
    parser.add_argument("--link", type=Path, metavar="PATH", help="name of the port (default: a new temporary one)")
    parser.add_argument(
        "--faults",
        metavar="FILE",
        help="faults to inject: a TOML or JSON file, or - for standard input, one JSON object per line",
    )
    group = parser.add_argument_group("CAN bus, for an odrive (default: slcan on the port)")
    group.add_argument("--interface", metavar="NAME", help="python-can interface, such as socketcan or udp_multicast")
    group.add_argument("--channel", metavar="NAME", help="python-can channel, such as vcan0")


def _execute(arguments: Namespace) -> Answer | None:
    from vvvaltr.controller.core.document import load_document
    from vvvaltr.controller.core.errors import one_line_errors
    from vvvaltr.controller.robot.mock import open_mock
    from vvvaltr.drivers.mocking.faults import FaultScript

    if (arguments.interface is None) != (arguments.channel is None):
        raise NotUnderstood("--interface and --channel go together: give both, or neither")
    takes_faults = arguments.faults == "-"
    script = load_document(Path(arguments.faults), FaultScript) if arguments.faults and not takes_faults else None
    is_over = _EndingSignal()
    with ExitStack() as leaving:
        link = (arguments.link or Path(leaving.enter_context(TemporaryDirectory(prefix="vvvaltr-")), "port")).absolute()
        bus = (arguments.interface, arguments.channel) if arguments.interface else None
        with one_line_errors():
            mock = open_mock(
                arguments.device,
                link,
                arguments.robot,
                script.fault if script else (),
                bus,
                arguments.tracker,
                arguments.max_hz,
                arguments.firmware,
                arguments.pose_rate,
            )
        leaving.callback(mock.close)
        as_json = arguments.json or not os.isatty(_STDOUT)
        with suppress(BrokenPipeError):  # the program that started the mock, and read its lines, has ended
            if as_json:
                _write({"port": mock.port, "robot_file": str(mock.robot_file), "tracker": mock.tracker})
            else:
                robot_file = os.path.relpath(mock.robot_file)
                print(f"mock {arguments.device} at {mock.port}, until you press Ctrl-C")
                print(f"next, in another terminal: vvvaltr check {robot_file}", flush=True)
            _run(mock.plugged, is_over, takes_faults, as_json)
    return None


def _run(plugged: PluggedDevice, is_over: Callable[[], bool], takes_faults: bool, as_json: bool) -> None:
    """Run until the end; ``as_json`` tells 20 times a second what the device does."""
    from vvvaltr.controller.core.errors import one_line_errors

    status = _Status(plugged) if as_json else None
    faults = _FaultLines() if takes_faults else None

    def each_time(now_s: float) -> bool:
        if status is not None:
            status.report(now_s)
        with one_line_errors():
            for fault in faults.read() if faults else ():
                plugged.inject(fault)
        return is_over()

    plugged.run(each_time)


def _write(status: dict[str, Any]) -> None:
    # A slow reader must not hold up the device: it misses some lines instead.
    if select.select((), (_STDOUT,), (), 0.0)[1]:
        os.write(_STDOUT, json.dumps(status).encode() + b"\n")


class _Status:
    """Tells what a device does, as JSON lines on standard output."""

    def __init__(self, plugged: PluggedDevice) -> None:
        self._plugged = plugged
        self._next_s = time.monotonic()

    def report(self, now_s: float) -> None:
        """Write the next line, if it is due."""
        if now_s < self._next_s:
            return
        self._next_s = max(self._next_s + _STATUS_S, now_s)
        _write(
            {
                "t_s": round(now_s, 6),
                "applied_hz": [round(hz, 6) for hz in self._plugged.applied_hz],
                "watchdog": self._plugged.watchdog,
                "faults": list(self._plugged.faults),
                "place_m": self._plugged.place_m,
            }
        )


class _FaultLines:
    """Faults from standard input, one JSON object a line."""

    def __init__(self) -> None:
        self._text = b""

    def read(self) -> list[Fault]:
        """Return the faults that have arrived. Raises ValueError for a line that is not a fault."""
        import msgspec

        from vvvaltr.drivers.mocking.faults import Fault

        if not select.select((_STDIN,), (), (), 0.0)[0]:
            return []
        *lines, self._text = (self._text + os.read(_STDIN, 65536)).split(b"\n")
        return [msgspec.json.decode(line, type=Fault) for line in lines if line.strip()]


class _EndingSignal:
    """Whether a signal asked the mock to end. A flag, not an exception: the device ends between two steps, cleanly."""

    def __init__(self) -> None:
        self._is_set = False
        for ending in (signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(ending, self._set)

    def __call__(self) -> bool:
        return self._is_set

    def _set(self, number: int, frame: FrameType | None) -> None:
        self._is_set = True


COMMAND = Subcommand(
    help="simulate a device on a port, with a twin that its motors move",
    example="vvvaltr mock qik --robot planar --link qik0",
    add_arguments=_add_arguments,
    execute=_execute,
)
