"""Random and mutated bytes and frames into every decoder, on both ends of every line: no crash, no hang.

python -m benchmarks.fuzz --json
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
import random
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass

from vvvaltr.controller.core.errors import DeviceError
from vvvaltr.controller.core.values import Gait, Pose
from vvvaltr.drivers.links.can import CanLink, Frame
from vvvaltr.drivers.links.link import Link
from vvvaltr.drivers.mocking.can_adapter import SlcanAdapter, from_text, to_text
from vvvaltr.drivers.node import protocol as node_protocol
from vvvaltr.drivers.node.line import NodeLine, open_node
from vvvaltr.drivers.node.mock import NodeDevice
from vvvaltr.drivers.node.table import NodeMotorTable
from vvvaltr.drivers.odrive import line as odrive
from vvvaltr.drivers.odrive.mock import OdriveDevice
from vvvaltr.drivers.odrive.protocol import Message, encode
from vvvaltr.drivers.odrive.table import OdriveLineTable, OdriveMotorTable
from vvvaltr.drivers.qik import line as qik
from vvvaltr.drivers.qik import protocol as qik_protocol
from vvvaltr.drivers.qik.mock import QikDevice
from vvvaltr.drivers.qik.table import QikLineTable, QikMotorTable
from vvvaltr.drivers.trackers.stream.tracker import decode_pose, encode_pose

_CHUNK = 64
_MAX_HZ = 16.5


@dataclass(frozen=True, slots=True)
class Decoder:
    """Something that takes in bytes from a line.

    Args:
        name: what it is.
        feed: takes in bytes; may raise only what it is documented to raise, which is for it to sort out.
        samples: what it is meant for, to be mutated.
        works: whether it still understands what it is meant for.
    """

    name: str
    feed: Callable[[bytes], None]
    samples: tuple[bytes, ...]
    works: Callable[[], bool]


def garbage(samples: tuple[bytes, ...], dice: random.Random) -> Iterator[bytes]:
    """Yield chunks without end: random ones, and samples with bits turned, bytes lost, doubled and mixed."""
    while True:
        if dice.random() < 0.3:
            yield dice.randbytes(dice.randint(1, _CHUNK))
            continue
        chunk = bytearray(b"".join(dice.choices(samples, k=dice.randint(1, 4))))
        for _ in range(dice.choice((0, 1, 1, 2, 5))):
            place = dice.randrange(len(chunk))
            match dice.randrange(4):
                case 0:
                    chunk[place] ^= 1 << dice.randrange(8)
                case 1:
                    del chunk[place]
                case 2:
                    chunk.insert(place, dice.randrange(256))
                case _:
                    chunk[place:place] = chunk[: dice.randint(1, len(chunk))]
            if not chunk:
                break
        yield bytes(chunk[: 16 * _CHUNK])


class Tape:
    """A link on which bytes come in as they are put, and what is written is forgotten."""

    name = "fuzz"

    def __init__(self) -> None:
        self._data = b""

    def put(self, data: bytes) -> None:
        """Let ``data`` come in."""
        self._data += data

    @property
    def is_empty(self) -> bool:
        """Whether all has been read."""
        return not self._data

    def write(self, data: bytes) -> None:
        """Forget it."""

    def read(self, size: int, timeout_s: float) -> bytes:
        """Return what has come in; waits for nothing."""
        part, self._data = self._data[:size], self._data[size:]
        return part

    def close(self) -> None:
        """Nothing is to be let go of."""


class FrameTape:
    """A bus on which frames come in as they are put, and what is sent is forgotten."""

    name = "fuzz"

    def __init__(self) -> None:
        self._frames: list[Frame] = []

    def put(self, frames: list[Frame]) -> None:
        """Let ``frames`` come in."""
        self._frames = frames

    def send(self, frame: Frame) -> None:
        """Forget it."""

    def frames(self, until_s: float) -> Iterator[Frame]:
        """Yield what has come in."""
        while self._frames:
            yield self._frames.pop(0)

    def close(self) -> None:
        """Nothing is to be let go of."""


def qik_host() -> Decoder:
    """Make the driver's ear for answers of one byte."""
    tape = Tape()
    straight = ((1.0, 1.0), (127.0, 127.0))
    motors = tuple(QikMotorTable(board=board, output=0, max_hz=127.0, curve=straight) for board in (0, 1))
    line = qik.QikLine(tape, QikLineTable(port="tape", motor=motors))

    def feed(data: bytes) -> None:
        tape.put(data)
        while not tape.is_empty:
            with suppress(DeviceError):
                line.listen(0.0)

    def works() -> bool:
        before_s = line.heard_s
        end_s = time.monotonic() + 1.0
        while line.heard_s == before_s and time.monotonic() < end_s:
            with suppress(DeviceError):
                line.listen(time.monotonic() + 0.001)
                feed(b"\0")
        return line.heard_s > before_s

    return Decoder("qik host", feed, (b"\0", b"\x80", b"2"), works)


def qik_device(has_crc: bool) -> Decoder:
    """Make the boards' ear for packets."""
    device = QikDevice(has_crc=has_crc)
    times_s = itertools.count(0.0, 0.01)

    def feed(data: bytes) -> None:
        device.on_bytes(data, now_s := next(times_s))
        device.tick(now_s + 0.005)
        _check_bounds(device.applied_hz)

    def works() -> bool:
        device.reboot(0.0)
        for board in device.boards.values():
            board.parameters[:] = [1, 0, 1, 0]
        ask = qik_protocol.packet(1, qik_protocol.Command.FIRMWARE, has_crc=has_crc)
        return device.on_bytes(b"\xaa" + ask, 0.0)[-1:] == b"2"

    commands = (
        (qik_protocol.Command.FIRMWARE,),
        (qik_protocol.Command.ERRORS,),
        (qik_protocol.Command.GET, 3),
        (qik_protocol.Command.SET, 3, 1, *qik_protocol.SET_KEY),
        (qik_protocol.Command.SPEED, 100),
        (qik_protocol.Command.SPEED + 7, 127),
    )
    samples = tuple(qik_protocol.packet(board, *command, has_crc=has_crc) for command in commands for board in (0, 1))
    compact = tuple(bytes(command) for command in commands)
    return Decoder(f"qik device{' with CRC' if has_crc else ''}", feed, samples + compact, works)


def _frame(data: bytes) -> Frame:
    return Frame(int.from_bytes(data[:2], "little") & 0x7FF, data[2:10], bool(data[:1] == b"\xff"))


_AXIS_FRAMES = tuple(frame for axis in OdriveDevice().axes for frame in (axis.frame(m) for m in (
    Message.HEARTBEAT, Message.ENCODER_ESTIMATES, Message.CURRENT)))  # fmt: skip
_HOST_FRAMES = (
    encode(0, Message.SET_STATE, 8),
    encode(1, Message.SET_MODES, 2, 1),
    encode(2, Message.SET_VELOCITY, 10.0, 0.0),
    encode(0, Message.SET_LIMITS, _MAX_HZ, 1.0),
    Frame(Message.ESTOP),
    Frame(Message.CURRENT, is_remote=True),
)


def _packed(frames: tuple[Frame, ...]) -> tuple[bytes, ...]:
    return tuple(frame.identifier.to_bytes(2, "little") + frame.data for frame in frames)


def odrive_host() -> Decoder:
    """Make the driver's ear for frames."""
    tape = FrameTape()
    table = OdriveLineTable(channel="tape", motor=(OdriveMotorTable(node=0, max_hz=_MAX_HZ),))
    line = odrive.OdriveLine(tape, table)  # type: ignore[arg-type]

    def hear(frame: Frame) -> None:
        tape.put([frame])
        with suppress(DeviceError):
            line.listen(0.0)
        if not all(map(math.isfinite, line.state().frequency_hz)):
            raise AssertionError("a velocity that is no number got through")

    def works() -> bool:
        hear(encode(0, Message.ENCODER_ESTIMATES, 0.0, 3.0))
        return line.state().frequency_hz == (3.0,)

    return Decoder("odrive host", lambda data: hear(_frame(data)), _packed(_AXIS_FRAMES), works)


def odrive_device() -> Decoder:
    """Make the axes' ear for frames."""
    device = OdriveDevice()
    times_s = itertools.count(0.0, 0.001)

    def feed(data: bytes) -> None:
        device.on_frame(_frame(data), now_s := next(times_s))
        device.tick(now_s)
        if not all(map(math.isfinite, device.applied_hz)):
            raise AssertionError("a velocity that is no number is applied")

    def works() -> bool:
        device.reboot(0.0)
        for frame in _HOST_FRAMES[:2]:
            device.on_frame(Frame(frame.identifier & 0x1F, frame.data), 0.0)
        device.on_frame(encode(0, Message.SET_VELOCITY, 10.0, 0.0), 0.0)
        return device.applied_hz[0] == 10.0

    return Decoder("odrive device", feed, _packed(_HOST_FRAMES), works)


def slcan_host() -> Decoder:
    """Make python-can's ear for text, behind our link, at the end of a pty."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    link = CanLink("slcan", os.ttyname(theirs), 500_000)
    os.set_blocking(ours, False)
    texts = tuple(map(to_text, (*_AXIS_FRAMES, *_HOST_FRAMES)))

    def feed(data: bytes) -> None:
        with suppress(BlockingIOError):
            os.read(ours, 65536)
        os.write(ours, data)
        for _ in link.frames(time.monotonic()):
            pass

    def works() -> bool:
        os.write(ours, b"\r" + texts[0])
        frames = list(link.frames(time.monotonic() + 0.2))
        link.close()
        os.close(ours)
        os.close(theirs)
        return _AXIS_FRAMES[0] in frames

    return Decoder("slcan host", feed, texts, works)


def slcan_device() -> Decoder:
    """Make the adapter's ear for text."""
    adapter = SlcanAdapter(OdriveDevice(), is_open=True)

    def feed(data: bytes) -> None:
        adapter.on_bytes(data, 0.0)

    def works() -> bool:
        said = adapter.on_bytes(b"\rO\r" + to_text(Frame(Message.CURRENT, is_remote=True)), 0.0)
        return any(from_text(line) is not None for line in said.split(b"\r"))

    texts = (*map(to_text, _HOST_FRAMES), b"O\r", b"S6\r", b"V\r")
    return Decoder("slcan device", feed, texts, works)


class Loop:
    """A link straight into a motor node, with a tape for what else comes in."""

    name = "fuzz"

    def __init__(self) -> None:
        self.device = NodeDevice(3, _MAX_HZ, lambda: 1, time.monotonic())
        self._data = b""

    def put(self, data: bytes) -> None:
        """Let ``data`` come in."""
        self._data += data

    def write(self, data: bytes) -> None:
        """Send to the node."""
        self._data += self.device.on_bytes(data, time.monotonic())

    def read(self, size: int, timeout_s: float) -> bytes:
        """Return what has come in; waits for nothing."""
        self._data += self.device.tick(time.monotonic())
        part, self._data = self._data[:size], self._data[size:]
        return part

    def close(self) -> None:
        """Nothing is to be let go of."""


_NODE_MOTORS = (NodeMotorTable(max_hz=_MAX_HZ),) * 3


def node_host() -> Decoder:
    """Make the driver's ear for frames of the motor node."""
    loop = Loop()
    line: NodeLine = open_node(_link(loop), _NODE_MOTORS)
    gait = Gait((5.0, 5.0, 5.0))
    samples = (loop.device.on_bytes(node_protocol.hello(0), 0.0), _telemetry(loop.device))

    def feed(data: bytes) -> None:
        loop.put(data)
        with suppress(DeviceError):
            line.listen(time.monotonic() + 1e-5)

    def works() -> bool:
        return open_node(_link(loop), _NODE_MOTORS).motor_count == gait.motor_count

    return Decoder("node host", feed, samples, works)


def _link(loop: Loop) -> Link:
    return loop


def _telemetry(device: NodeDevice) -> bytes:
    now_s = time.monotonic()
    while not (telemetry := device.tick(now_s)):
        now_s += 0.005
    return telemetry


def node_device() -> Decoder:
    """Make the firmware's ear for frames."""
    device = NodeDevice(3, _MAX_HZ, lambda: 1, 0.0)
    times_s = itertools.count(0.0, 0.005)

    def feed(data: bytes) -> None:
        device.on_bytes(data, now_s := next(times_s))
        device.tick(now_s)

    def works() -> bool:
        return len(device.on_bytes(b"\0" + node_protocol.hello(0), 0.0)) > 0

    samples = (
        node_protocol.hello(0),
        node_protocol.drive(1, (5.0, 6.0, 7.0), 0.2),
        node_protocol.stop(2),
        node_protocol.clear(3),
    )
    return Decoder("node device", feed, samples, works)


def tracker() -> Decoder:
    """Make the tracker's ear for poses."""
    pose = encode_pose(1, Pose(1.0, (0.1, 0.2, 0.3), 0.1, 0.2, 0.3, ((1.0, 2.0, 3.0),)))

    def feed(data: bytes) -> None:
        with suppress(ValueError):
            decode_pose(data)

    return Decoder("tracker", feed, (pose,), lambda: decode_pose(pose)[0] == 1)


def _check_bounds(applied_hz: tuple[float, ...]) -> None:
    if not all(abs(hz) <= _MAX_HZ for hz in applied_hz):
        raise AssertionError(f"{applied_hz} is beyond full speed")


def fuzzed(decoder: Decoder, count: int, is_frames: bool, seed: int) -> tuple[int, float]:
    """Feed ``count`` bytes, or as many frames, and return how many there were and the longest time for one chunk."""
    fed, longest_s = 0, 0.0
    for chunk in garbage(decoder.samples, random.Random(seed)):
        began_s = time.perf_counter()
        decoder.feed(chunk)
        longest_s = max(longest_s, time.perf_counter() - began_s)
        fed += 1 if is_frames else len(chunk)
        if fed >= count:
            break
    if not decoder.works():
        raise AssertionError(f"{decoder.name} does not work any more")
    return fed, longest_s


def _abort() -> None:
    print("hangs", flush=True)
    os._exit(1)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    parser.add_argument("--count", type=int, default=1_000_000, help="bytes or frames for each (default a million)")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    figures: dict[str, float] = {}
    for decoder in (
        qik_host(), qik_device(False), qik_device(True), slcan_host(), slcan_device(), odrive_host(), odrive_device(),
        node_host(), node_device(), tracker(),
    ):  # fmt: skip
        guard = threading.Timer(1800.0, _abort)
        guard.daemon = True
        guard.start()
        is_frames = decoder.name in ("odrive host", "odrive device")
        fed, longest_s = fuzzed(decoder, arguments.count, is_frames, arguments.seed)
        guard.cancel()
        key = decoder.name.replace(" ", "_")
        figures |= {f"{key}_{'frames' if is_frames else 'bytes'}": fed, f"{key}_longest_ms": round(1000 * longest_s, 2)}
        print(f"{decoder.name:24} {fed:9} {'frames' if is_frames else 'bytes':6}  longest {1000 * longest_s:8.2f} ms")
    if arguments.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
