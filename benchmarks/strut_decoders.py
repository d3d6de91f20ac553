"""The decoders of radio struts, on both ends of their links, ready to be fed."""

from __future__ import annotations

import itertools
import math
import time
from collections import deque
from contextlib import suppress

from benchmarks.decoder import Decoder
from vvvaltr.controller.core.errors import DeviceError
from vvvaltr.drivers.links.gatt import Word
from vvvaltr.drivers.struts import protocol as strut_protocol
from vvvaltr.drivers.struts.boards import OwnBoard
from vvvaltr.drivers.struts.line import StrutsLine
from vvvaltr.drivers.struts.table import StrutsLineTable, StrutTable


class _StrutTape:
    """A link to one strut whose reports are what was put in: satisfies ``GattLink``."""

    name = "tape"

    def __init__(self) -> None:
        self.words: deque[Word] = deque()

    def put(self, text: bytes) -> None:
        self.words.append(Word(0, time.monotonic(), text))

    def write(self, strut: int, text: bytes, is_acknowledged: bool) -> None:
        pass

    def read(self, timeout_s: float) -> Word | None:
        return self.words.popleft() if self.words else None

    def close(self) -> None:
        pass


_STRUT_TABLE = StrutsLineTable(allow_no_watchdog=True, motor=(StrutTable(strut="S", max_hz=16.0),))
_LABORATORY_REPORT = b"0.00,0.00,120,-4,16384,-262,0,131"


def _own_report(number: int) -> bytes:
    text = _LABORATORY_REPORT + b",v1,%d,%d,77,0,0,0,3700" % (number, 40 * number)
    return text + b",%02x" % strut_protocol.check_sum(text)


def struts_host() -> Decoder:
    """Make the driver's decoder of the reports of a strut with our firmware."""
    tape = _StrutTape()
    line = StrutsLine(tape, _STRUT_TABLE)
    tape.put(_own_report(1))
    line.arm()

    def feed(data: bytes) -> None:
        tape.put(data)
        with suppress(DeviceError):
            line.listen(time.monotonic() + 1e-5)
        tape.words.clear()
        if not all(map(math.isfinite, line.state().frequency_hz)):
            raise AssertionError("a speed that is not finite got through")

    def works() -> bool:
        tape.put(_own_report(1))
        line.arm()
        return line.state().frequency_hz == (0.0,)

    return Decoder("struts host", feed, (*map(_own_report, (2, 3, 70)), _LABORATORY_REPORT), works)


def struts_device() -> Decoder:
    """Make our firmware's decoder of texts."""
    board = OwnBoard(0.0)
    board.connect()
    times_s = itertools.count(0.0, 0.005)

    def feed(data: bytes) -> None:
        board.write(data, now_s := next(times_s))
        board.tick(now_s)
        if abs(board.strut.target_rpm) > strut_protocol.GREATEST_RPM:
            raise AssertionError(f"{board.strut.target_rpm} turns a minute are beyond the limit")

    def works() -> bool:
        for text in (b"0", strut_protocol.encode_held(600, 0.4, 1)):
            board.write(text, next(times_s))
        return bool(board.strut.target_rpm == 600)

    samples = (b"900", b"-301", b"0", b"calibrate", strut_protocol.encode_held(-900, 0.4, 65535))
    return Decoder("struts device", feed, samples, works)
