"""The motor node on a computer: MicroPython's Unix port, with a simulated board, on standard input and output.

For tests, and for trying a host without a board::

    socat PTY,link=node0,raw,echo=0 EXEC:"env MICROPYPATH=drivers/node micropython -m firmware.unix 3 16700"

with the number of motors and the greatest frequency in mHz.
"""

import os
import select
import sys
import time

from .core import BOARD_TEMPERATURE, CURRENT, MOTOR_TEMPERATURE, Node
from .simulated_board import COUNTS_PER_TURN, SimulatedBoard

_WAIT_MS = 1


def run(motors, max_mhz):
    """Be a node until the line is gone."""
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
    line_in, line_out = sys.stdin.buffer, sys.stdout.buffer
    poll = select.poll()
    poll.register(line_in, select.POLLIN)
    while True:
        while poll.poll(_WAIT_MS):
            byte = line_in.read(1)
            if not byte:
                return
            line_out.write(node.on_bytes(byte, time.ticks_ms()))
        now_us = time.ticks_us()
        board.step(now_us)
        line_out.write(node.tick(time.ticks_ms(), now_us))


if __name__ == "__main__":
    run(int(sys.argv[1]), int(sys.argv[2]))
