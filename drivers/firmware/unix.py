"""The motor node on a computer: MicroPython's Unix port, with a simulated board, on a pseudo-terminal or serial port.

For tests, and for trying a host without a board::

    MICROPYPATH=drivers micropython -m firmware.unix /dev/pts/3 3 16700

with the port, the number of motors and the greatest frequency in mHz.
"""

import os
import select
import sys
import termios
import time

from .core import BOARD_TEMPERATURE, CURRENT, MOTOR_TEMPERATURE, Node
from .simulated_board import COUNTS_PER_TURN, SimulatedBoard

_WAIT_MS = 1


def run(port, motors, max_mhz):
    """Be a node on ``port``, until the line is gone."""
    settings = {
        "motors": motors,
        "max_mhz": max_mhz,
        "no_load_mhz": max_mhz * 5 // 4,
        "ramp_mhz_s": max_mhz * 6,
        "counts_per_turn": COUNTS_PER_TURN,
        "sensors": CURRENT | MOTOR_TEMPERATURE | BOARD_TEMPERATURE,
    }
    board = SimulatedBoard(motors, max_mhz / 800.0)
    node = Node(board, settings, int.from_bytes(os.urandom(4), "little"), time.ticks_ms())
    with open(port, "r+b", buffering=0) as line:
        termios.setraw(line.fileno())
        poll = select.poll()
        poll.register(line, select.POLLIN)
        while True:
            while poll.poll(_WAIT_MS):
                line.write(node.on_bytes(line.read(1), time.ticks_ms()))
            now_us = time.ticks_us()
            board.step(now_us)
            line.write(node.tick(time.ticks_ms(), now_us))


if __name__ == "__main__":
    run(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
