"""Radio links that are lost and programs that are killed while struts turn: how many motors are left on.

python -m benchmarks.struts --json
"""

from __future__ import annotations

import json
import math
import os
import random
import signal
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from benchmarks.figures import make_parser
from benchmarks.observed import ObservedDevice
from vvvaltr.controller.core.errors import DeviceError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.robot.hardware import open_motors
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.held_motors import HeldMotors
from vvvaltr.drivers.mocking.faults import Fault, Kind

WAYS = ("kill", "drop_out", "unplug")
"""Ways to lose a link: the program is killed, a strut leaves, the adapter is pulled."""

_GAIT = Gait((9.0, -12.0, 15.0))
_OPENING_S, _NOTICED_S, _REST_S = 60.0, 5.0, 1.5
_RISE_S, _AWAY_S = 0.2, 0.5


@dataclass(frozen=True, slots=True)
class Loss:
    """What a lost link did.

    Args:
        way: how it was lost.
        rest_s: time until all motors were off; None if one was left on.
        was_noticed: whether the program was told, unless it was killed.
    """

    way: str
    rest_s: float | None
    was_noticed: bool


def lose_links(repeats: int, seed: int, firmware: str = "vvvaltr") -> Iterator[Loss]:
    """Lose links at random moments of a drive, and yield what each loss did.

    Args:
        repeats: how often, over all ways in turn.
        seed: seed of moments and struts.
        firmware: what the struts run; one without a watchdog is allowed, and loses its links by kills alone.
    """
    dice = random.Random(seed)
    ways = WAYS if firmware == "vvvaltr" else WAYS[:1]
    with (
        tempfile.TemporaryDirectory() as folder,
        ObservedDevice("struts", Path(folder, "port"), firmware=firmware) as observed,
    ):
        text = observed.robot_file.read_text(encoding="utf-8")
        allowed = text.replace("allow_no_watchdog = false", "allow_no_watchdog = true")
        observed.robot_file.write_text(allowed, encoding="utf-8")
        for number in range(repeats):
            way, moment_s, motor = ways[number % len(ways)], dice.uniform(0.0, 0.4), dice.randint(1, 3)
            fault = None if way == "kill" else Fault(Kind(way), at_s=0.0, motor=motor, duration_s=_AWAY_S)
            yield _kill(observed, moment_s) if fault is None else _cut(observed, moment_s, fault)


def _kill(observed: ObservedDevice, moment_s: float) -> Loss:
    """Kill a program that drives."""
    program = get_context("spawn").Process(target=_drive_for_ever, args=(observed.robot_file,), daemon=True)
    program.start()
    _wait_until_on(observed)
    time.sleep(moment_s)
    assert program.pid is not None
    lost_s = time.monotonic()
    os.kill(program.pid, signal.SIGKILL)
    rest_s = _rest_s(observed, lost_s)
    program.join()
    if rest_s is None:
        _open(observed.robot_file).close()  # stops what was left on
    return Loss("kill", rest_s, was_noticed=True)


def _cut(observed: ObservedDevice, moment_s: float, fault: Fault) -> Loss:
    """Let a fault cut the links of a drive, which goes on until it notices."""
    motors = _open(observed.robot_file)
    lost_s, was_noticed, began_s = math.inf, False, time.monotonic()
    try:
        while time.monotonic() < began_s + _NOTICED_S:
            motors.drive(_GAIT, 0.25)
            if lost_s == math.inf and time.monotonic() > began_s + _RISE_S + moment_s:
                lost_s = time.monotonic()
                observed.inject(fault)
            time.sleep(0.04)
            motors.state()
    except DeviceError:
        was_noticed = lost_s < math.inf
    rest_s = _rest_s(observed, lost_s)
    motors.close()
    return Loss(fault.kind, rest_s, was_noticed)


def _open(robot_file: Path) -> HeldMotors:
    """Open the motors, once the links can be made again."""
    end_s = time.monotonic() + _OPENING_S
    while True:
        try:
            return open_motors(load_robot_file(robot_file).line[0])
        except DeviceError:
            if time.monotonic() > end_s:
                raise
        time.sleep(0.05)


def _drive_for_ever(robot_file: Path) -> None:
    while True:
        motors = _open(robot_file)
        with suppress(DeviceError):  # as where this computer was held up
            while True:
                motors.drive(_GAIT, 0.25)
                time.sleep(0.04)
        motors.close()


def _rest_s(observed: ObservedDevice, lost_s: float) -> float | None:
    """Return how long after ``lost_s`` all motors were off; None if they were not in time."""
    try:
        return max(0.0, observed.rested_s(_REST_S) - lost_s)
    except TimeoutError:
        return None


def _wait_until_on(observed: ObservedDevice) -> None:
    end_s = time.monotonic() + _OPENING_S
    while observed.note().are_all_off:
        if time.monotonic() > end_s:
            raise TimeoutError(f"the motors were not on after {_OPENING_S:g} s")
        time.sleep(0.01)


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument("--repeats", type=int, default=300, help="number of losses over all ways (default 300)")
    parser.add_argument("--seed", type=int, default=0, help="seed of moments and struts (default 0)")
    parser.add_argument("--firmware", default="vvvaltr", help="what the struts run (default vvvaltr)")
    arguments = parser.parse_args()
    losses = []
    for loss in lose_links(arguments.repeats, arguments.seed, arguments.firmware):
        losses.append(loss)
        if len(losses) % 50 == 0:
            print(f"{len(losses)} of {arguments.repeats}", flush=True)
    figures: dict[str, float] = {
        "losses": len(losses),
        "motors_left_on": sum(loss.rest_s is None for loss in losses),
        "not_noticed": sum(not loss.was_noticed for loss in losses),
    }
    for way in dict.fromkeys(loss.way for loss in losses):
        rests_s = [loss.rest_s for loss in losses if loss.way == way and loss.rest_s is not None]
        figures[f"{way}_longest_ms"] = round(1000.0 * max(rests_s, default=0.0))
    print(figures)
    if arguments.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
