"""Frames on the wire: payload and CRC-16, COBS-stuffed so that 0 occurs only as the end mark.

Runs under MicroPython and CPython. The layout is told in docs/node-protocol.md.
"""

from array import array

MAX_PAYLOAD = 120
_MAX_FRAME = MAX_PAYLOAD + 3  # and two bytes of CRC, one of COBS; a payload this short never needs a second


def _nibble_table() -> "array[int]":
    table = array("H", [0] * 16)
    for nibble in range(16):
        crc = nibble << 12
        for _ in range(4):
            crc = ((crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
        table[nibble] = crc
    return table


_TABLE = _nibble_table()


def crc16(data: bytes, crc: int = 0xFFFF) -> int:
    """Return the CRC-16/CCITT-FALSE of ``data``: polynomial 0x1021, start 0xFFFF, nothing reflected."""
    for byte in data:
        crc = ((crc << 4) & 0xFFFF) ^ _TABLE[(crc >> 12) ^ (byte >> 4)]
        crc = ((crc << 4) & 0xFFFF) ^ _TABLE[(crc >> 12) ^ (byte & 15)]
    return crc


def encode(payload: bytes) -> bytes:
    """Return the frame that carries ``payload`` (at most ``MAX_PAYLOAD`` bytes), end mark included."""
    crc = crc16(payload)
    frame = bytearray(len(payload) + 4)
    code = 0  # where the distance to the next zero is to be written
    end = 1
    for byte in payload + bytes((crc & 0xFF, crc >> 8)):
        if byte:
            frame[end] = byte
        else:
            frame[code] = end - code
            code = end
        end += 1
    frame[code] = end - code
    return bytes(frame)


def _unstuff(frame: bytearray, length: int) -> int:
    """Undo COBS in place; return the length of the result, or -1 if ``frame`` (under 255 bytes) is not COBS."""
    read = write = 0
    while read < length:
        code = frame[read]
        if code == 0 or read + code > length:
            return -1
        for at in range(read + 1, read + code):
            frame[write] = frame[at]
            write += 1
        read += code
        if read < length:
            frame[write] = 0
            write += 1
    return write


class FrameReader:
    """Finds the payloads in a stream of bytes. ``bad_frames`` counts what was thrown away (modulo 65536)."""

    def __init__(self) -> None:
        self.bad_frames = 0
        self._frame = bytearray(_MAX_FRAME)
        self._length = 0  # beyond the buffer: an endless frame, to be thrown away at its end mark

    def feed(self, data: bytes) -> list[bytes]:
        """Return the list of valid payloads that ``data`` completes."""
        payloads: list[bytes] = []
        for byte in data:
            if byte:
                if self._length < _MAX_FRAME:
                    self._frame[self._length] = byte
                    self._length += 1
                else:
                    self._length = _MAX_FRAME + 1
            elif self._length:
                self._finish(payloads)
                self._length = 0
        return payloads

    def _finish(self, payloads: list[bytes]) -> None:
        end = _unstuff(self._frame, self._length) - 2 if self._length <= _MAX_FRAME else -1
        if end > 0:
            payload = bytes(memoryview(self._frame)[:end])
            if crc16(payload) == self._frame[end] | self._frame[end + 1] << 8:
                payloads.append(payload)
                return
        self.bad_frames = (self.bad_frames + 1) & 0xFFFF
