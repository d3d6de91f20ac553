"""Steering on devices in real time: from a key to the motors, and from a key let go to their rest; and goals of `go`.

    python -m benchmarks.jog --json

The devices are mocks that move the spatial twin, with motors of 50 Hz. Each goal is 0.30 m from the tracker's origin
and is reached within 20 mm, from where the last one left the robot, in at most 200 s of driving.
"""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmarks.figures import make_parser
from benchmarks.observed import ObservedDevice

_PROGRAM = (sys.executable, "-c", "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main())")
_UP = b"\x1b[A"
TAPS = 10
GOALS_M = ((0.30, 0.0), (0.09, 0.29), (-0.24, 0.18), (-0.24, -0.18), (0.09, -0.29))
MAX_HZ = 50.0


def learn_moves(folder: Path) -> Path:
    """Learn movements on the twin that the mocks move."""
    moves = folder / "moves"
    command = [*_PROGRAM, "repertoire", "--robot", "spatial", "--gaits", "40", "--out", str(moves), "--quiet"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
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
    reached, durations_s, gaps_s = 0, [], []
    for number, (x_m, y_m) in enumerate(GOALS_M):
        source = moves if number == 0 else folder / f"{name}{number - 1}"
        command = [*_PROGRAM, "go", str(x_m), str(y_m), "--json"]
        command += ["--robot", str(robot_file), "--repertoire", str(source), "--out", str(folder / f"{name}{number}")]
        ended = subprocess.run(command, capture_output=True, text=True)
        result = json.loads(ended.stdout)
        print(name, result, ended.stderr, file=sys.stderr, flush=True)
        reached += result["reached"]
        durations_s.append(result["duration_s"])
        gaps_s += command_gaps_s(folder / f"{name}{number}")
    return {
        f"{name}_goals_reached": reached,
        f"{name}_goals_s": [round(each, 1) for each in durations_s],
        f"{name}_longest_wait_for_a_set_point_ms": round(1000.0 * max(gaps_s), 1),
    }


def command_gaps_s(run: Path) -> list[float]:
    """Return the times between two set-points, of all primitives."""
    from vvvaltr.controller.runs.log import read_run

    times_s = [[command.t_s for command in logged.trial.commands] for logged in read_run(run).trials]
    return [after - before for of_one in times_s for before, after in pairwise(of_one)]


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    arguments = parser.parse_args()
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        moves = learn_moves(folder)
        for device in ("node", "odrive"):
            with ObservedDevice(device, folder / device, "spatial", MAX_HZ) as observed:
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
