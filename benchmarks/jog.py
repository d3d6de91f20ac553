"""Steering on devices in real time: from a key to the motors, and from a key let go to their rest; and goals of `go`.

    python -m benchmarks.jog --json

The devices are mocks that move the spatial twin. At the 16 Hz of their motors it does 1 mm/s, so the goals are near.
"""

from __future__ import annotations

import argparse
import json
import os
import pty
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.observed import ObservedDevice

_PROGRAM = (sys.executable, "-c", "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main())")
_UP = b"\x1b[A"
TAPS = 10
GOALS_M = ((0.02, 0.0), (0.0, 0.02), (-0.02, 0.0), (0.0, -0.02), (0.015, 0.015))
BUDGET_S = 200.0


def learn_moves(folder: Path) -> Path:
    """Learn movements on the twin that the mocks move, with what their motors can do."""
    moves = folder / "moves"
    command = [
        *_PROGRAM,
        "repertoire",
        "--robot",
        "spatial",
        "--range",
        "8",
        "16",
        "--gaits",
        "40",
        "--out",
        str(moves),
    ]
    subprocess.run([*command, "--quiet"], check=True, stdout=subprocess.DEVNULL)
    return moves


@contextmanager
def jogging(robot_file: Path, moves: Path, out: Path) -> Iterator[int]:
    """Run ``jog`` at a terminal; yields the end at which keys are pressed."""
    master, terminal = pty.openpty()
    command = [*_PROGRAM, "jog", "--robot", str(robot_file), "--repertoire", str(moves), "--out", str(out)]
    with subprocess.Popen(command, stdin=terminal, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as program:
        os.close(terminal)
        assert program.stderr is not None
        program.stderr.readline()
        try:
            yield master
        finally:
            os.write(master, b"q")
            program.communicate()
    os.close(master)


def key_ms(device: ObservedDevice, keys: int) -> tuple[list[float], list[float]]:
    """Return for some taps the time from the key to the first motor that is on, and from space to the last one off."""
    to_on, to_off = [], []
    for _ in range(TAPS):
        time.sleep(0.5)
        device.note()
        pressed_s = time.monotonic()
        os.write(keys, _UP)
        time.sleep(0.4)
        to_on += [1000.0 * (change.t_s - pressed_s) for change in device.note().changes if not change.are_all_off][:1]
        spaced_s = time.monotonic()
        os.write(keys, b" ")
        time.sleep(0.6)
        to_off += [1000.0 * (change.t_s - spaced_s) for change in device.note().changes if change.are_all_off][:1]
    return to_on, to_off


def goals(robot_file: Path, moves: Path, folder: Path, name: str) -> dict[str, Any]:
    """Send the robot to five goals, each from where the last one left it."""
    reached, durations_s = 0, []
    for number, (x_m, y_m) in enumerate(GOALS_M):
        source = moves if number == 0 else folder / f"{name}{number - 1}"
        command = [*_PROGRAM, "go", str(x_m), str(y_m), "--within", "0.006", "--time", str(BUDGET_S), "--json"]
        command += ["--robot", str(robot_file), "--repertoire", str(source), "--out", str(folder / f"{name}{number}")]
        ended = subprocess.run(command, capture_output=True, text=True)
        result = json.loads(ended.stdout)
        print(name, result, file=sys.stderr, flush=True)
        reached += result["reached"]
        durations_s.append(result["duration_s"])
    return {f"{name}_goals_reached": reached, f"{name}_goals_s": [round(each, 1) for each in durations_s]}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    arguments = parser.parse_args()
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        moves = learn_moves(folder)
        for device in ("node", "odrive"):
            with ObservedDevice(device, folder / device, "spatial") as observed:
                with jogging(observed.robot_file, moves, folder / f"jog-{device}") as keys:
                    to_on, to_off = key_ms(observed, keys)
                found[f"{device}_key_to_motor_ms"] = sorted(round(each, 1) for each in to_on)
                found[f"{device}_space_to_rest_ms"] = sorted(round(each, 1) for each in to_off)
                found |= goals(observed.robot_file, moves, folder, device)
    for name, figure in found.items():
        print(f"{name:28} {figure}")
    if arguments.json:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
