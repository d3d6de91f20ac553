"""Days without anybody, in short: thousands of trials on a mock in real time, with faults at random.

    python -m benchmarks.soak --json
    python -m benchmarks.soak --method bare --trials 1000 --warm 100

A fault begins every few trials. What ends the run, as three failures in a row do, is followed by ``--resume`` in a new
process, as systemd does it. Counted are motors that are on between trials, trials that observers were told of and that
are not in the log, and how memory and open files of the run's process grow once the run is warm: medians over 50
trials. The method ``bare`` draws gaits and keeps no model: what grows then is what the program keeps of each trial.
"""

from __future__ import annotations

import json
import os
import random
import tempfile
import time
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.faults import draw_fault
from benchmarks.figures import make_parser
from benchmarks.observed import ObservedDevice
from vvvaltr.controller.core.ask_tell import complete
from vvvaltr.controller.core.errors import DeviceError, TrackingLost, UserError
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.records import Event, LoggedTrial
from vvvaltr.controller.core.values import Suggestion
from vvvaltr.controller.runs.log import read_trials
from vvvaltr.controller.runs.run import RunDirectory

STATED_BYTES, STATED_RESIDENT_BYTES = 2000, 4000
"""What a trial may leave in memory beside the model, as docs/hardware.md states: in objects, and as resident memory."""

_DURATION_S = 0.3
_REST_S = 1.0  # within which all motors must be off after a trial
_EVERY = 10  # trials between two faults, on average
_WARM = 200  # trials after which memory is to be flat
_WINDOW = 50  # trials over whose median memory is taken
_TRIAL = "\n[trial]\nduration_s = 0.3\nsettle_s = 0.1\nramp_s = 0.05\nrest_s = 0.1\nperiod_s = 0.02\n"


class Bare:
    """An optimiser that draws gaits and keeps nothing."""

    def __init__(self, space: GaitSpace, seed: int) -> None:
        import numpy as np

        self._space, self._rng = space, np.random.default_rng(seed)

    def ask(self) -> Suggestion:
        """Return a gait drawn uniformly."""
        return Suggestion(self._space.from_unit(self._rng.random(self._space.dimension)), "drawn")

    def tell(self, gait: Gait, score: float) -> None:
        """Keep nothing."""


class Witness:
    """The observer that tells another process of each trial that it is told of."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe

    def on_trial(self, logged: LoggedTrial) -> None:
        """Tell of a trial."""
        self._pipe.send(logged.trial.number)

    def on_event(self, event: Event) -> None:
        """Do nothing."""


@dataclass(frozen=True, slots=True)
class Made:
    """What a run's process holds after a trial."""

    memory_bytes: int
    files: int


@dataclass(slots=True)
class Soak:
    """A soak under way: the mock, what is asked of it, and what was counted so far."""

    mock: ObservedDevice
    device: str
    path: Path
    asked: dict[str, Any]
    trials: int
    dice: random.Random
    told: set[int] = field(default_factory=set)
    faults: int = 0
    resumed: int = 0
    motors_left_on: int = 0
    made: list[Made] = field(default_factory=list)  # after each trial

    def run(self) -> None:
        """Make all trials, in as many processes as it takes."""
        context = get_context("spawn")
        while len(self.made) < self.trials:
            self.resumed += self.path.exists()
            ours, theirs = context.Pipe()
            process = context.Process(target=_make_trials, args=(self.path, self.asked, theirs))
            process.start()
            theirs.close()
            with ours:
                self._follow(ours)
            process.join()

    def _follow(self, run: Connection) -> None:
        """Look at the run after each trial, until it ends."""
        with suppress(EOFError):
            while len(self.made) < self.trials:
                match run.recv():
                    case Made() as made:
                        self.made.append(made)
                        self._look()
                        run.send("go on")
                    case number:
                        self.told.add(number)

    def _look(self) -> None:
        try:
            self.mock.rested_s(_REST_S)
        except TimeoutError:
            self.motors_left_on += 1
        if self.dice.random() < 1 / _EVERY:
            self.mock.inject(draw_fault(self.dice, self.device))
            self.faults += 1


def _make_trials(path: Path, asked: dict[str, Any], pipe: Connection) -> None:
    """Make trials until something ends the run, or the other end of the pipe is closed."""
    is_bare = asked["method"] == "bare"
    known = {**asked, "method": "random" if is_bare else asked["method"]}
    with suppress(UserError, DeviceError, TrackingLost, EOFError, BrokenPipeError), ExitStack() as stack:
        opened = RunDirectory.resume(path, {}) if path.exists() else RunDirectory.create(path, known)
        run = stack.enter_context(closing(opened))
        if is_bare:
            run.optimizer = complete(Bare(run.space, len(run.trials)))
        for _ in run.learn([Witness(pipe)]):
            pipe.send(Made(_resident_bytes(), len(os.listdir("/proc/self/fd"))))
            pipe.recv()
    time.sleep(1.0)


def soak(trials: int, device: str = "node", method: str = "random", seed: int = 1, warm: int = _WARM) -> dict[str, Any]:
    """Make so many trials, and return what was counted."""
    with tempfile.TemporaryDirectory() as name, ObservedDevice(device, Path(name, "port")) as mock:
        robot = mock.robot_file.with_name("own.toml")
        robot.write_text(mock.robot_file.read_text().partition("\n[trial]")[0] + _TRIAL)
        asked = {"robot": {"name": str(robot)}, "method": method, "trials": 10 * trials, "duration_s": _DURATION_S}
        it = Soak(mock, device, Path(name, "run"), asked, trials, random.Random(seed))
        it.run()
        logged = [logged.trial.number for logged in read_trials(it.path)]
    found = {"trials": len(it.made), "faults": it.faults, "resumed": it.resumed, "motors_left_on": it.motors_left_on}
    found["told_but_not_logged"] = len(it.told - set(logged))
    found["missing_or_doubled"] = int(logged != list(range(1, len(logged) + 1)))
    return found | _describe_growth(it, warm)


def _describe_growth(it: Soak, warm: int) -> dict[str, Any]:
    """Return how memory and open files grew once the run was warm; empty where it never was."""
    memory, files = [made.memory_bytes for made in it.made[warm:]], [made.files for made in it.made[warm:]]
    if len(memory) < 2 * _WINDOW:
        return {}
    medians = [median(memory[at : at + _WINDOW]) for at in range(0, len(memory) - _WINDOW + 1, _WINDOW)]
    kept = STATED_RESIDENT_BYTES * (len(memory) - _WINDOW)
    return {
        "memory_grown_percent": round(100.0 * (medians[-1] / medians[0] - 1.0), 1),
        "memory_grown_percent_at_most": round(100.0 * (max(medians) / medians[0] - 1.0), 1),
        "memory_grown_percent_apart_from_stated": round(100.0 * ((medians[-1] - kept) / medians[0] - 1.0), 1),
        "memory_mb": [round(of_window / 1e6, 1) for of_window in medians],
        "files_grown": files[-1] - files[0],
    }


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument(
        "--trials", type=int, default=2000, metavar="N", help="number of trials (default 2000, about 30 minutes)"
    )
    parser.add_argument("--warm", type=int, default=_WARM, metavar="N", help="trial from which on memory counts")
    parser.add_argument("--device", default="node", metavar="NAME", help="mock to learn on")
    parser.add_argument("--method", default="random", metavar="NAME", help="method of vvvaltr learn, or bare")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the faults")
    arguments = parser.parse_args()
    found = soak(arguments.trials, arguments.device, arguments.method, arguments.seed, arguments.warm)
    for figure, value in found.items():
        print(f"{figure:40} {value}")
    if arguments.json:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
