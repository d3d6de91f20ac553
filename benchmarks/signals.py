"""Signals at random instants of a command's life: each ends it in one line, with status 130 and no traceback.

python -m benchmarks.signals --json
"""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from benchmarks.figures import make_parser

# Up to the entry's first statement this stands in for it, so that every instant after the mark counts.
_PROGRAM = """
import os, signal, sys
def early(number, frame):
    os.write(2, b"vvvaltr: interrupted (early)\\n")
    os._exit(130)
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, early)
os.write(int(sys.argv.pop(1)), b".")
from vvvaltr.entry import main
main()
"""
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_TOLD = re.compile(r"vvvaltr: interrupted|^(?:trial \d+: )?interrupted \(", re.MULTILINE)
_LONGEST_S = 60.0

COMMANDS: dict[str, tuple[str, ...]] = {
    "learn": ("learn", "--robot", "planar", "--trials", "4", "--duration", "0.5", "--no-recording", "--out", "{out}"),
    "trial": ("trial", "9", "12", "15", "--robot", "planar", "--repeats", "6", "--duration", "1", "--out", "{out}"),
    "help": ("learn", "--help"),
    "version": ("--version",),
}
"""Commands to break into, by a short name."""


def run(command: Sequence[str], out: Path, delay_s: float | None, number: int) -> tuple[int, str, float]:
    """Run a command, with a signal after ``delay_s``, None for none; return status, what it told, and duration."""
    reader, writer = os.pipe()
    words = [word.format(out=out) for word in command]
    with subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, str(writer), *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        pass_fds=(writer,),
    ) as process:
        os.close(writer)
        os.read(reader, 1)
        os.close(reader)
        begin_s = time.perf_counter()
        if delay_s is not None:
            time.sleep(delay_s)
            process.send_signal(number)
        answer, told = process.communicate(timeout=_LONGEST_S)
        return process.returncode, told + answer, time.perf_counter() - begin_s


def judge(status: int, told: str) -> str:
    """Return what is wrong with the end of an interrupted command; empty for nothing."""
    if status == 0 and not _TOLD.search(told):
        return ""  # it had ended before
    if "Traceback" in told or "Error" in told or "defect" in told:
        return f"status {status}, not one line: {told[-600:]}"
    if status != 130:
        return f"status {status}: {told[-300:]}"
    lines = len(_TOLD.findall(told))
    return "" if lines == 1 else f"{lines} lines: {told[-300:]}"


def campaign(name: str, count: int, seed: int) -> tuple[Counter[int], list[str]]:
    """Break ``count`` times into a command; return how often it ended with which status, and what went wrong."""
    dice = random.Random(f"{name} {seed}")
    statuses: Counter[int] = Counter()
    complaints = []
    with tempfile.TemporaryDirectory() as folder:
        *_, whole_s = run(COMMANDS[name], Path(folder) / "whole", None, 0)
        for trial in range(count):
            delay_s = dice.uniform(0.0, 1.02 * whole_s)
            place = Path(folder) / f"{trial}" / "run"
            status, told, _ = run(COMMANDS[name], place, delay_s, dice.choice(_SIGNALS))
            statuses[status] += 1
            if wrong := judge(status, told):
                complaints.append(f"{name} after {delay_s:.4f} s: {wrong}")
            if place.parent.exists() and (left := [each.name for each in place.parent.iterdir() if each != place]):
                complaints.append(f"{name} after {delay_s:.4f} s left {left}")
    return statuses, complaints


def main() -> None:
    """Run the command line."""
    parser = make_parser(__doc__)
    parser.add_argument("--count", type=int, default=500, help="number of signals for each command")
    parser.add_argument("--seed", type=int, default=0, help="seed of the instants")
    arguments = parser.parse_args()
    result: dict[str, object] = {}
    for name in COMMANDS:
        statuses, complaints = campaign(name, arguments.count, arguments.seed)
        result[name] = {"statuses": dict(statuses), "wrong": len(complaints), "examples": complaints[:5]}
        if not arguments.json:
            print(f"{name}: {dict(statuses)}, {len(complaints)} wrong", *complaints[:5], sep="\n  ")
    if arguments.json:
        print(json.dumps(result))


if __name__ == "__main__":
    main()
