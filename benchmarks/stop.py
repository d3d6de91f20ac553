"""From the stop key of an operator, and from a signal, to motors at rest, on every mock in real time.

    python -m benchmarks.stop --json

The key is pressed at a random moment of a trial, on a pseudo-terminal. The device's own share is in the figures: the
line's speed, and the time until the device obeys.
"""

from __future__ import annotations

import json
import os
import pty
import random
import signal
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import make_parser
from benchmarks.observed import ObservedDevice

_PROGRAM = (sys.executable, "-c", "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main())")
DEVICES = ("qik", "odrive", "node", "struts")
_TRIAL = "\n[trial]\nduration_s = 30.0\nsettle_s = 0.0\nramp_s = 0.1\nrest_s = 0.0\n"
_PATIENCE_S = 30.0


class Run:
    """An attended run at a terminal, which is emptied all the time."""

    def __init__(self, robot_file: Path, out: Path) -> None:
        own = robot_file.with_name(f"own-{robot_file.name}")
        text = robot_file.read_text()
        own.write_text(text.partition("\n[trial]")[0] + _TRIAL)
        self._process, self._terminal = pty.fork()
        if not self._process:
            os.environ["TERM"] = "xterm"
            command = [*_PROGRAM, "learn", "--robot", str(own), "--attended", "--no-recording", "--out", str(out)]
            os.execv(command[0], command)
        threading.Thread(target=self._empty, daemon=True).start()

    def press(self, key: bytes) -> float:
        """Press a key; return when."""
        pressed_s = time.monotonic()
        os.write(self._terminal, key)
        return pressed_s

    def interrupt(self) -> float:
        """Send SIGINT; return when."""
        sent_s = time.monotonic()
        os.kill(self._process, signal.SIGINT)
        return sent_s

    def end(self) -> None:
        """Wait for the end."""
        os.waitpid(self._process, 0)
        os.close(self._terminal)

    def _empty(self) -> None:
        with suppress(OSError):
            while os.read(self._terminal, 65536):
                pass


def await_motion(device: ObservedDevice, run: Run) -> None:
    """Have the run go on, and wait until a motor turns: on a busy machine a trial may fail, and the run pause."""
    deadline_s = time.monotonic() + _PATIENCE_S
    ask_s = 0.0
    while device.note().are_all_off:
        if time.monotonic() > deadline_s:
            raise TimeoutError("no motor has begun to turn")
        if time.monotonic() > ask_s:
            run.press(b"g")
            ask_s = time.monotonic() + 1.0
        time.sleep(0.01)


def stops_ms(name: str, folder: Path, presses: int) -> dict[str, Any]:
    """Return the times from the key to rest, and the one from a SIGINT that ends the run."""
    dice = random.Random(1)
    times_ms = []
    with ObservedDevice(name, folder / name) as device:
        run = Run(device.robot_file, folder / f"run-{name}")
        for _ in range(presses):
            await_motion(device, run)
            time.sleep(dice.uniform(0.05, 0.4))
            pressed_s = run.press(b" ")
            times_ms.append(1000.0 * (device.rested_s(5.0) - pressed_s))
            time.sleep(0.1)
        await_motion(device, run)
        sent_s = run.interrupt()
        interrupt_ms = 1000.0 * (device.rested_s(5.0) - sent_s)
        run.end()
    shares = {f"{name}_p{share}_ms": round(float(np.percentile(times_ms, share)), 1) for share in (50, 99)}
    return {**shares, f"{name}_longest_ms": round(max(times_ms), 1), f"{name}_interrupt_ms": round(interrupt_ms, 1)}


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument("--presses", type=int, default=200, metavar="N", help="presses on each device")
    parser.add_argument("--devices", nargs="+", default=DEVICES, metavar="NAME", help="mocks to measure")
    arguments = parser.parse_args()
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        for device in arguments.devices:
            found |= stops_ms(device, Path(name), arguments.presses)
    for figure, value in found.items():
        print(f"{figure:24} {value}")
    if arguments.json:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
