"""Radio links that are lost and programs that are killed while struts turn: how many motors are left on.

python -m benchmarks.struts --json
"""

from __future__ import annotations

import argparse
import json
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

from benchmarks.observed import ObservedDevice
from vvvaltr.controller.core.errors import DeviceError
from vvvaltr.controller.core.values import Gait
from vvvaltr.controller.robot.hardware import open_motors
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.mocking.faults import Fault, Kind

WAYS = ("kill", "drop_out", "unplug")
"""Ways to lose a link: the program is killed, a strut leaves, the adapter is pulled."""

_GAIT = Gait((9.0, -12.0, 15.0))
_OPENING_S, _REST_S = 20.0, 1.5


@dataclass(frozen=True, slots=True)
class Loss:
    """What a lost link did.

    Args:
        way: how it was lost.
        rest_s: time until all motors were off; None if one was left on.
        was_noticed: whether the program, unless it was killed, ended by itself.
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
            yield _lose(observed, ways[number % len(ways)], dice)


def _lose(observed: ObservedDevice, way: str, dice: random.Random) -> Loss:
    context = get_context("forkserver")
    context.set_forkserver_preload(["benchmarks.observed", "vvvaltr.controller.robot.hardware"])
    program = context.Process(target=_drive, args=(observed.robot_file,), daemon=True)
    program.start()
    assert program.pid is not None
    _wait_until_on(observed)
    time.sleep(dice.uniform(0.0, 0.4))
    lost_s = time.monotonic()
    if way == "kill":
        os.kill(program.pid, signal.SIGKILL)
    else:
        observed.inject(Fault(Kind(way), at_s=0.0, motor=dice.randint(1, 3), duration_s=dice.uniform(0.35, 1.0)))
    rest_s = None
    with suppress(TimeoutError):
        rest_s = max(0.0, observed.rested_s(_REST_S) - lost_s)
    program.join(_REST_S)
    was_noticed = not program.is_alive()
    program.kill()
    program.join()
    return Loss(way, rest_s, was_noticed)


def _drive(robot_file: Path) -> None:
    """Drive until the links are lost."""
    end_s = time.monotonic() + _OPENING_S
    while time.monotonic() < end_s:
        with suppress(DeviceError):  # a strut that has lost its link takes a moment to be found again
            motors = open_motors(load_robot_file(robot_file).line[0])
            break
    try:
        while True:
            motors.drive(_GAIT, 0.25)
            time.sleep(0.04)
            motors.state()
    except DeviceError:
        motors.close()


def _wait_until_on(observed: ObservedDevice) -> None:
    observed.note()
    end_s = time.monotonic() + _OPENING_S
    while observed.note().are_all_off:
        if time.monotonic() > end_s:
            raise TimeoutError(f"the motors were not on after {_OPENING_S:g} s")
        time.sleep(0.01)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    parser.add_argument("--repeats", type=int, default=300, help="number of losses over all ways (default 300)")
    parser.add_argument("--seed", type=int, default=0, help="seed of moments and struts (default 0)")
    parser.add_argument("--firmware", default="vvvaltr", help="what the struts run (default vvvaltr)")
    arguments = parser.parse_args()
    losses = list(lose_links(arguments.repeats, arguments.seed, arguments.firmware))
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
