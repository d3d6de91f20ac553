"""Fixed texts to the firmware's core, printed report by report: every interpreter must print the same."""

import sys

sys.path.insert(0, sys.argv[1])

from firmware import core

SETTINGS = {"no_load_mhz": 20600, "ramp_mhz_s": 110000, "pulses_per_turn": 70, "report_ms": core.REPORT_MS}
TEXTS = {5: b" 300 ", 700: b"calibrate", 720: b"\xff\x00,1,2", 740: b"-1,2", 900: b"5000,60,7", 1000: b"400,900,6"}


class Board:
    """A motor that follows its output with a lag, in whole numbers."""

    def __init__(self):
        self.output = self.um_turns = self.count = self.edge_us = self.mhz = 0
        self.is_jammed = False

    def step(self, now_us):
        self.mhz += (0 if self.is_jammed else self.output * 18 - self.mhz) // 25
        self.um_turns += abs(self.mhz)
        if self.um_turns * 70 // 1000000 != self.count:
            self.count = self.um_turns * 70 // 1000000
            self.edge_us = now_us

    def pulses(self):
        return self.count, self.edge_us

    def set_output(self, output):
        self.output = output

    def motion(self):
        return 1, -2, 16384, 3, -4, 5

    def battery_mv(self):
        return core.UNKNOWN_MV if self.count % 2 else 3700


def main():
    board = Board()
    strut = core.Strut(board, SETTINGS, 77, 0)
    strut.on_connect()
    for now_ms in range(3000):
        text = TEXTS.get(now_ms)
        if text is None and now_ms % 50 == 0 and now_ms > 1100:
            text = b"%d,200,%d" % (-600 if now_ms > 1600 else 900, now_ms // 50)
        if text is not None:
            strut.on_text(text, now_ms)
        board.is_jammed = now_ms > 2000
        if now_ms == 2950:
            strut.on_disconnect()
        board.step(now_ms * 1000)
        said = strut.tick(now_ms, now_ms * 1000)
        if said:
            print(now_ms, said, board.output)  # noqa: T201


main()
