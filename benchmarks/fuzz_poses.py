"""Mutated packets into every decoder of poses: no crash, no hang, no pose that was not sent.

Nothing but a checksum, which UDP and TCP have, can tell a wrong bit in a coordinate. So the bytes that are the pose
itself are mutated apart from all others:

- bytes around a pose are changed, lost, inserted and cut off, in several places at once: what is understood even so
  must be a pose that was sent, and of the same body;
- bits within a pose are turned: what is understood even so must still be a place and a rotation.

python -m benchmarks.fuzz_poses --json
"""

from __future__ import annotations

import asyncio
import json
import math
import random
import struct
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from benchmarks.figures import make_parser
from benchmarks.fuzz import HANG_S, abort
from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose, Vector
from vvvaltr.drivers.trackers.attitude import Matrix, is_unit, matrix_of, matrix_of_quaternion, quaternion_of
from vvvaltr.drivers.trackers.natnet import mock as natnet_mock
from vvvaltr.drivers.trackers.natnet import protocol as natnet
from vvvaltr.drivers.trackers.newest import NewestPose
from vvvaltr.drivers.trackers.qtm.protocol import HEADER, Component, Kind, frame, packet, text
from vvvaltr.drivers.trackers.stream.message import decode_pose, encode_pose

Seen = tuple[float, ...]
"""A pose as a decoder understands it: its numbers."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A packet.

    Args:
        data: its bytes.
        payload: where in them the pose stands; empty for a packet without one.
        pose: what a decoder makes of it.
    """

    data: bytes
    payload: range
    pose: Seen | None


@dataclass(frozen=True, slots=True)
class PoseDecoder:
    """A decoder of poses.

    Args:
        name: what it is.
        samples: what it is meant for.
        poses: returns the robot's poses in a packet; raises nothing.
        sized: sets the length that a packet tells of itself to its true one.
        close: lets go of everything.
    """

    name: str
    samples: tuple[Sample, ...]
    poses: Callable[[bytes], Sequence[Seen]]
    sized: Callable[[bytearray], None] = lambda data: None
    close: Callable[[], None] = lambda: None


def mutated_around(sample: Sample, dice: random.Random) -> bytearray:
    """Return the packet with damage outside of its pose."""
    data, payload = bytearray(sample.data), sample.payload
    for _ in range(dice.choice((1, 1, 2, 3, 6))):
        place = dice.randrange(max(1, len(data)))
        if place in payload or not data:
            continue
        kind, length = dice.randrange(5), 0
        if kind == 0:
            data[place] ^= 1 << dice.randrange(8)
        elif kind == 1:
            data[place] = dice.choice((0, 1, 0x7F, 0x80, 0xFF))
        elif kind == 2:
            del data[place]
            length = -1
        elif kind == 3:
            added = dice.randbytes(dice.choice((1, 1, 2, 4, 8)))
            data[place:place] = added
            length = len(added)
        elif not payload or place >= payload.stop:
            del data[place:]
        if payload and place < payload.start:
            payload = range(payload.start + length, payload.stop + length)
    return data


def mutated_within(sample: Sample, dice: random.Random) -> bytearray:
    """Return the packet with bits turned in its pose."""
    data = bytearray(sample.data)
    for _ in range(dice.choice((1, 1, 2, 8))):
        data[dice.choice(sample.payload)] ^= 1 << dice.randrange(8)
    return data


def fuzzed(decoder: PoseDecoder, count: int, seed: int) -> dict[str, float]:
    """Feed ``count`` mutated packets.

    Returns:
        how many there were, in how many a pose was understood, and the longest time of the processor for one, in ms.

    Raises:
        AssertionError: a pose was understood that was not sent, or is none.
    """
    dice, longest_s, understood = random.Random(seed), 0.0, 0
    sent = {sample.pose for sample in decoder.samples}
    for _ in range(count):
        sample = dice.choice(decoder.samples)
        is_within = bool(sample.payload) and dice.random() < 0.2
        data = mutated_within(sample, dice) if is_within else mutated_around(sample, dice)
        if dice.random() < 0.9:
            decoder.sized(data)
        began_s = time.thread_time()
        poses = decoder.poses(bytes(data))
        longest_s = max(longest_s, time.thread_time() - began_s)
        for pose in poses:
            understood += 1
            if not (all(map(math.isfinite, pose)) if is_within else pose in sent):
                raise AssertionError(f"{decoder.name} made {pose} of {data.hex()}, which came from {sample.data.hex()}")
    for sample in decoder.samples:
        if list(decoder.poses(sample.data)) != ([] if sample.pose is None else [sample.pose]):
            raise AssertionError(f"{decoder.name} does not work any more")
    return {"packets": count, "understood": understood, "longest_ms": round(1000.0 * longest_s, 2)}


_UNSEEN = (math.nan,) * 12
_POSES = tuple(
    Pose(1.0 + number, (0.1 * number, -0.2, 0.03), 0.4 * number, 0.1, -0.2 * number, uncertainty_m=0.001)
    for number in range(4)
)


def _accepted(position_m: Vector, rotation: Matrix) -> list[Seen]:
    """Return what a tracker makes of a body: its numbers, or nothing."""
    newest = NewestPose(60.0, "")
    newest.take_body(0, 0.0, position_m, rotation, None, time.monotonic())
    with suppress(TrackingLost):
        return [_numbers(newest.pose())]
    return []


def natnet_decoder(version: natnet.Version) -> PoseDecoder:
    """Make the ear for NatNet: every datagram, whatever it says it is."""
    robot, other = 102, (9.0, 9.0, 9.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1)

    def poses(datagram: bytes) -> list[Seen]:
        with suppress(ValueError):
            kind, content = natnet.message_in(datagram)
            if kind == natnet.Message.SERVER_INFO:
                natnet.server_info_in(content)
            elif kind == natnet.Message.MODEL:
                natnet.bodies_in(content, version)
            elif kind == natnet.Message.FRAME:
                body = natnet.frame_in(content, version).bodies.get(robot)
                if body and body.is_tracked and is_unit(body.quaternion):
                    return _accepted(body.position_m, matrix_of_quaternion(body.quaternion))
        return []

    def sized(data: bytearray) -> None:
        if len(data) >= natnet.HEAD.size:
            struct.pack_into("<H", data, 2, len(data) - natnet.HEAD.size)

    model = natnet.message(natnet.Message.MODEL, natnet_mock.model(("wand", "robot"), version))
    samples = [Sample(model, range(0), None)]
    for number, pose in enumerate(_POSES):
        record = (*pose.position_m, *quaternion_of((pose.yaw_rad, pose.pitch_rad, pose.roll_rad)), 0.001, 1)
        content = natnet_mock.frame(number, {101: other, robot: record}, 1.0, 1.0, version)
        data = natnet.message(natnet.Message.FRAME, content)
        stands = natnet.BODY.pack(robot, *record)[natnet.COUNT.size :]
        (seen,) = poses(data)
        samples.append(Sample(data, range(start := data.index(stands), start + len(stands)), seen))
    return PoseDecoder(f"natnet {version[0]}.{version[1]}", tuple(samples), poses, sized)


def qtm_decoder() -> PoseDecoder:
    """Make the ear for Qualisys: the library behind its guard, fed in two pieces."""
    from vvvaltr.drivers.trackers.qtm.connection import Ears, bodies_of

    dice, loop = random.Random(0), asyncio.new_event_loop()
    asyncio.set_event_loop(loop)  # the library wants to see one
    heard: list[Seen] = []

    def on_packet(packet: object) -> None:
        bodies = bodies_of(packet)
        if len(bodies) == 2:  # as a session sees to
            heard.extend(_accepted(*bodies[1][:2]))

    def poses(data: bytes) -> list[Seen]:
        heard.clear()
        ears = Ears(lambda event: None, lambda: None)
        ears.set_on_packet(on_packet)
        cut = dice.randrange(len(data) + 1)
        ears.data_received(data[:cut])
        ears.data_received(data[cut:])
        return list(heard)

    def sized(data: bytearray) -> None:
        if len(data) >= HEADER.size:
            struct.pack_into("<I", data, 0, len(data))

    words = text(Kind.XML, "<QTM><The_6D><Body><Name>robot</Name></Body></The_6D></QTM>"), text(Kind.ERROR, "no")
    others = (*words, packet(Kind.EVENT, b"\x04"), packet(Kind.NO_MORE_DATA, b""))
    samples = [Sample(data, range(0), None) for data in others]
    for number, pose in enumerate(_POSES):
        rows = matrix_of((pose.yaw_rad, pose.pitch_rad, pose.roll_rad))
        record = (*(1000.0 * x for x in pose.position_m), *(rows[i][j] for j in range(3) for i in range(3)))
        for component, residual in ((Component.BODIES, ()), (Component.BODIES_WITH_RESIDUAL, (0.5,))):
            bodies = ((*_UNSEEN, *residual), (*record, *residual))
            data = frame(10**6 * number, number, bodies, component)
            (seen,) = poses(data)
            samples.append(Sample(data, range(len(data) - 4 * len(bodies[1]), len(data)), seen))
    return PoseDecoder("qtm", tuple(samples), poses, sized, loop.close)


def stream_decoder() -> PoseDecoder:
    """Make the ear for poses as JSON."""
    samples = []
    for number, pose in enumerate(_POSES):
        data = encode_pose(number, pose)
        # All that follows the position are numbers of the pose, and names of which some may be left out.
        samples.append(Sample(data, range(data.index(b'"position_m"'), len(data) - 1), _numbers(pose)))

    def poses(datagram: bytes) -> list[Seen]:
        with suppress(ValueError):
            pose = decode_pose(datagram).pose
            return [] if pose is None else [_numbers(pose)]
        return []

    return PoseDecoder("stream", tuple(samples), poses)


def _numbers(pose: Pose) -> Seen:
    return (*pose.position_m, pose.yaw_rad, pose.pitch_rad, pose.roll_rad)


def decoders() -> tuple[PoseDecoder, ...]:
    """Return all of them."""
    versions = ((3, 0), (4, 0), (4, 1), (4, 2))
    return (stream_decoder(), qtm_decoder(), *(natnet_decoder(version) for version in versions))


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument(
        "--count", type=int, default=1_000_000, help="number of packets for each decoder (default a million)"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the packets")
    arguments = parser.parse_args()
    figures: dict[str, dict[str, float]] = {}
    for decoder in decoders():
        guard = threading.Timer(HANG_S, abort)
        guard.daemon = True
        guard.start()
        figures[decoder.name] = fuzzed(decoder, arguments.count, arguments.seed)
        guard.cancel()
        print(f"{decoder.name:12} " + "  ".join(f"{key} {value:g}" for key, value in figures[decoder.name].items()))
    if arguments.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
