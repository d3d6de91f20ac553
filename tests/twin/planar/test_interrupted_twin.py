"""An interrupt never leaves the physics library half way: its next finalizer would read freed memory."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import random, signal, sys
from vvvaltr.controller.core import signals
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.twin.bodies import make_body
from vvvaltr.twin.planar.engine import PlanarEngine
from vvvaltr.twin.presets import PLANAR_PARTS
from vvvaltr.twin.world import World

signals._STOPPING_S = 0.0  # each of them counts
signals.interrupt_on_signals()
handle = signal.getsignal(signal.SIGINT)
signal.signal(signal.SIGALRM, lambda number, frame: handle(signal.SIGINT, frame))
dice = random.Random(int(sys.argv[1]))
engine = PlanarEngine(make_body("prism3", PLANAR_PARTS), World())
gait = Gait((9.0, 9.0, 9.0))


def work():
    while True:
        signal.setitimer(signal.ITIMER_REAL, dice.uniform(2e-5, 4e-3))
        engine.reset()
        engine.reset()
        engine.step(gait, 0.05)
        engine.reset()


interrupts = 0
while interrupts < int(sys.argv[2]):
    try:
        work()
    except KeyboardInterrupt:
        interrupts += 1
"""


@pytest.mark.parametrize("seed", [1, 2])
def test_a_planar_twin_survives_interrupts_at_any_instant(seed: int) -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM, str(seed), "1000"], capture_output=True, text=True)

    assert done.returncode == 0, done.stderr
