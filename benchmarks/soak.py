"""Days without anybody, in short: thousands of trials on a mock in real time, with faults at random.

    python -m benchmarks.soak --json

A fault begins every few trials. What ends the run, as three failures in a row do, is followed by ``--resume`` in the
same process, as systemd would do in a new one. Counted are motors that are on between trials, trials that observers
were told of and that are not in the log, and how memory and open files grow after trial 200.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import tempfile
import time
from contextlib import closing
from pathlib import Path
from typing import Any

from benchmarks.faults import draw_fault
from benchmarks.observed import ObservedDevice
from vvvaltr.controller.core.errors import DeviceError, TrackingLost, UserError
from vvvaltr.controller.core.records import Event, LoggedTrial
from vvvaltr.controller.runs.log import read_trials
from vvvaltr.controller.runs.run import RunDirectory

_DURATION_S = 0.3
_REST_S = 1.0  # within which all motors must be off after a trial
_EVERY = 10  # trials between two faults, on average
_WARM = 200  # trials after which memory is to be flat
_TRIAL = "\n[trial]\nduration_s = 0.3\nsettle_s = 0.1\nramp_s = 0.05\nrest_s = 0.1\nperiod_s = 0.02\n"


class Witness:
    """The observer that notes which trials it was told of."""

    def __init__(self) -> None:
        self.numbers: list[int] = []

    def on_trial(self, logged: LoggedTrial) -> None:
        """Note a trial."""
        self.numbers.append(logged.trial.number)

    def on_event(self, event: Event) -> None:
        """Do nothing."""


def soak(trials: int, device: str = "node", seed: int = 1, warm: int = _WARM) -> dict[str, Any]:
    """Make so many trials, and return what was counted."""
    dice, witness = random.Random(seed), Witness()
    grown: list[tuple[int, int]] = []
    found: dict[str, Any] = {"trials": 0, "faults": 0, "resumed": 0, "motors_left_on": 0}
    with tempfile.TemporaryDirectory() as name, ObservedDevice(device, Path(name, "port")) as mock:
        text = mock.robot_file.read_text()
        robot = mock.robot_file.with_name("own.toml")
        robot.write_text(text.partition("\n[trial]")[0] + _TRIAL)
        path = Path(name, "run")
        asked = {"robot": {"name": str(robot)}, "method": "random", "trials": 10 * trials, "duration_s": _DURATION_S}
        while found["trials"] < trials:
            found["resumed"] += path.exists()
            try:
                with closing(
                    RunDirectory.resume(path, {}) if path.exists() else RunDirectory.create(path, asked)
                ) as run:
                    for logged in run.learn([witness]):
                        found["trials"] = logged.trial.number
                        _look(mock, found)
                        grown.append((_resident_bytes(), len(os.listdir("/proc/self/fd"))))
                        if dice.random() < 1 / _EVERY:
                            mock.inject(draw_fault(dice, device))
                            found["faults"] += 1
                        if logged.trial.number >= trials:
                            break
            except (UserError, DeviceError, TrackingLost):
                time.sleep(1.0)
        logged_numbers = [logged.trial.number for logged in read_trials(path)]
    found["told_but_not_logged"] = len(set(witness.numbers) - set(logged_numbers))
    found["missing_or_doubled"] = int(logged_numbers != list(range(1, len(logged_numbers) + 1)))
    if len(grown) > warm:
        (before, files_before), (after, files_after) = grown[warm], grown[-1]
        found |= {"memory_grown_percent": round(100.0 * (after / before - 1.0), 1), "memory_mb": round(after / 1e6, 1)}
        found |= {"files_grown": files_after - files_before}
    return found


def _look(mock: ObservedDevice, found: dict[str, Any]) -> None:
    try:
        mock.rested_s(_REST_S)
    except TimeoutError:
        found["motors_left_on"] += 1


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=2000, metavar="N", help="default 2000: about 50 minutes")
    parser.add_argument("--device", default="node", metavar="NAME", help="mock (default node)")
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    arguments = parser.parse_args()
    found = soak(arguments.trials, arguments.device)
    for figure, value in found.items():
        print(f"{figure:24} {value}")
    if arguments.json:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
