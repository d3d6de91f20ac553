"""Fixed commands to the firmware's core, printed answer by answer: every interpreter must print the same."""

import struct
import sys

sys.path.insert(0, sys.argv[1])

from firmware import core, framing, simulated_board

SETTINGS = {
    "motors": 3,
    "max_mhz": 16700,
    "no_load_mhz": 20000,
    "ramp_mhz_s": 100000,
    "counts_per_turn": simulated_board.COUNTS_PER_TURN,
    "sensors": core.CURRENT,
}
COMMANDS = {
    5: b"\x01\x00\x00\x01",
    300: b"\x03\x63\x00",
    400: b"\x04\x64\x00",
    410: b"\xff\x65\x00",
}


def main():
    board = simulated_board.SimulatedBoard(3, 20.0)
    node = core.Node(board, SETTINGS, 77, 0)
    for now_ms in range(2500):
        command = COMMANDS.get(now_ms)
        if command is None and now_ms % 20 == 0 and now_ms < 2200:
            sequence = 1 + now_ms // 20 + (100 if now_ms > 400 else 0)
            command = struct.pack("<BHHiii", core.DRIVE, sequence, 200, 12000, -16700, now_ms * 5)
        answer = node.on_bytes(framing.encode(command), now_ms) if command else b""
        board.motors[1].is_jammed = now_ms > 700
        board.step(now_ms * 1000)
        said = answer + node.tick(now_ms, now_ms * 1000)
        if said:
            print(now_ms, said)  # noqa: T201


main()
