"""Every decoder of bytes and frames, on both ends of every line, ready to be fed."""

from __future__ import annotations

import itertools
import math
import os
import time
import tty
from collections.abc import Iterator
from contextlib import suppress

from benchmarks.decoder import Decoder
from benchmarks.strut_decoders import struts_device, struts_host
from benchmarks.tapes import FrameTape, NodeTape, Tape
from vvvaltr.controller.core.errors import DeviceError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Pose
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
from vvvaltr.drivers.trackers.stream.message import decode_pose, encode_pose

_MAX_HZ = 16.5


def qik_host() -> Decoder:
    """Make the qik driver's decoder of one-byte answers."""
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
    """Make the qik boards' decoder of packets."""
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
        ask = qik_protocol.encode_packet(1, qik_protocol.Opcode.FIRMWARE, has_crc=has_crc)
        return device.on_bytes(b"\xaa" + ask, 0.0)[-1:] == b"2"

    commands = (
        (qik_protocol.Opcode.FIRMWARE,),
        (qik_protocol.Opcode.ERRORS,),
        (qik_protocol.Opcode.GET, 3),
        (qik_protocol.Opcode.SET, 3, 1, *qik_protocol.SET_KEY),
        (qik_protocol.Opcode.SPEED, 100),
        (qik_protocol.Opcode.SPEED + 7, 127),
    )
    samples = tuple(
        qik_protocol.encode_packet(board, *command, has_crc=has_crc) for command in commands for board in (0, 1)
    )
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
    """Make the ODrive driver's decoder of frames."""
    tape = FrameTape()
    table = OdriveLineTable(channel="tape", motor=(OdriveMotorTable(node=0, max_hz=_MAX_HZ),))
    line = odrive.OdriveLine(tape, table)  # type: ignore[arg-type]

    def hear(frame: Frame) -> None:
        tape.put([frame])
        with suppress(DeviceError):
            line.listen(0.0)
        if not all(map(math.isfinite, line.state().frequency_hz)):
            raise AssertionError("a velocity that is not finite got through")

    def works() -> bool:
        hear(encode(0, Message.ENCODER_ESTIMATES, 0.0, 3.0))
        return line.state().frequency_hz == (3.0,)

    return Decoder("odrive host", lambda data: hear(_frame(data)), _packed(_AXIS_FRAMES), works)


def odrive_device() -> Decoder:
    """Make the ODrive axes' decoder of frames."""
    device = OdriveDevice()
    times_s = itertools.count(0.0, 0.001)

    def feed(data: bytes) -> None:
        device.on_frame(_frame(data), now_s := next(times_s))
        device.tick(now_s)
        if not all(map(math.isfinite, device.applied_hz)):
            raise AssertionError("a velocity that is not finite is applied")

    def works() -> bool:
        device.reboot(0.0)
        for frame in _HOST_FRAMES[:2]:
            device.on_frame(Frame(frame.identifier & 0x1F, frame.data), 0.0)
        device.on_frame(encode(0, Message.SET_VELOCITY, 10.0, 0.0), 0.0)
        return device.applied_hz[0] == 10.0

    return Decoder("odrive device", feed, _packed(_HOST_FRAMES), works)


def slcan_host() -> Decoder:
    """Make python-can's decoder of slcan text, behind our link, at the end of a pty."""
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
        works = any(frame == _AXIS_FRAMES[0] for frame in link.frames(time.monotonic() + 5.0))  # on a busy machine
        link.close()
        os.close(ours)
        os.close(theirs)
        return works

    return Decoder("slcan host", feed, texts, works)


def slcan_device() -> Decoder:
    """Make the mock adapter's decoder of slcan text."""
    adapter = SlcanAdapter(OdriveDevice(), is_open=True)

    def feed(data: bytes) -> None:
        adapter.on_bytes(data, 0.0)

    def works() -> bool:
        said = adapter.on_bytes(b"\rO\r" + to_text(Frame(Message.CURRENT, is_remote=True)), 0.0)
        return any(from_text(line) is not None for line in said.split(b"\r"))

    texts = (*map(to_text, _HOST_FRAMES), b"O\r", b"S6\r", b"V\r")
    return Decoder("slcan device", feed, texts, works)


_NODE_MOTORS = (NodeMotorTable(max_hz=_MAX_HZ),) * 3


def node_host() -> Decoder:
    """Make the driver's decoder of the motor node's frames."""
    loop = NodeTape(NodeDevice(3, _MAX_HZ, lambda: 1, time.monotonic()))
    line: NodeLine = open_node(_link(loop), _NODE_MOTORS)
    gait = Gait((5.0, 5.0, 5.0))
    samples = (loop.device.on_bytes(node_protocol.encode_hello(0), 0.0), _telemetry(loop.device))

    def feed(data: bytes) -> None:
        loop.put(data)
        with suppress(DeviceError):
            line.listen(time.monotonic() + 1e-5)

    def works() -> bool:
        return open_node(_link(loop), _NODE_MOTORS).motor_count == gait.motor_count

    return Decoder("node host", feed, samples, works)


def _link(loop: NodeTape) -> Link:
    return loop


def _telemetry(device: NodeDevice) -> bytes:
    now_s = time.monotonic()
    while not (telemetry := device.tick(now_s)):
        now_s += 0.005
    return telemetry


def node_device() -> Decoder:
    """Make the firmware's decoder of frames."""
    device = NodeDevice(3, _MAX_HZ, lambda: 1, 0.0)
    times_s = itertools.count(0.0, 0.005)

    def feed(data: bytes) -> None:
        device.on_bytes(data, now_s := next(times_s))
        device.tick(now_s)

    def works() -> bool:
        return len(device.on_bytes(b"\0" + node_protocol.encode_hello(0), 0.0)) > 0

    samples = (
        node_protocol.encode_hello(0),
        node_protocol.encode_drive(1, (5.0, 6.0, 7.0), 0.2),
        node_protocol.encode_stop(2),
        node_protocol.encode_clear(3),
    )
    return Decoder("node device", feed, samples, works)


def tracker() -> Decoder:
    """Make the tracker's decoder of poses."""
    pose = encode_pose(1, Pose(1.0, (0.1, 0.2, 0.3), 0.1, 0.2, 0.3, ((1.0, 2.0, 3.0),)))

    def feed(data: bytes) -> None:
        with suppress(ValueError):
            decode_pose(data)

    return Decoder("tracker", feed, (pose,), lambda: decode_pose(pose).sequence == 1)


def _check_bounds(applied_hz: tuple[float, ...]) -> None:
    if not all(abs(hz) <= _MAX_HZ for hz in applied_hz):
        raise AssertionError(f"{applied_hz} is beyond full speed")


def make_decoders() -> Iterator[Decoder]:
    """Make all decoders, one after the other: the line of one is closed before the next is opened."""
    yield qik_host()
    yield qik_device(has_crc=False)
    yield qik_device(has_crc=True)
    yield slcan_host()
    yield slcan_device()
    yield odrive_host()
    yield odrive_device()
    yield node_host()
    yield node_device()
    yield struts_host()
    yield struts_device()
    yield tracker()
