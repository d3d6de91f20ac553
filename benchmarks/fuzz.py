"""Random and mutated bytes and frames into every decoder, on both ends of every line: no crash, no hang.

python -m benchmarks.fuzz --json
"""

from __future__ import annotations

import json
import os
import random
import threading
import time
from collections.abc import Iterator

from benchmarks.decoder import Decoder
from benchmarks.decoders import make_decoders
from benchmarks.figures import make_parser

CHUNK_BYTES = 64
"""Greatest size of a random chunk."""

HANG_S = 1800.0
"""Time after which a decoder counts as hanging."""


def garbage(samples: tuple[bytes, ...], dice: random.Random) -> Iterator[bytes]:
    """Yield chunks without end: random bytes, and samples with bits flipped and bytes lost, added and repeated."""
    while True:
        if dice.random() < 0.3:
            yield dice.randbytes(dice.randint(1, CHUNK_BYTES))
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
        yield bytes(chunk[: 16 * CHUNK_BYTES])


def fuzz(decoder: Decoder, count: int, is_frames: bool, seed: int) -> tuple[int, float]:
    """Feed a decoder, and return how much it was fed and the longest time for one chunk, in seconds.

    Args:
        decoder: decoder to feed.
        count: number of bytes or frames.
        is_frames: whether each chunk is a frame, and ``count`` a number of frames.
        seed: seed of the chunks.

    Raises:
        AssertionError: the decoder no longer understands what it is meant for.
    """
    fed, longest_s = 0, 0.0
    for chunk in garbage(decoder.samples, random.Random(seed)):
        began_s = time.perf_counter()
        decoder.feed(chunk)
        longest_s = max(longest_s, time.perf_counter() - began_s)
        fed += 1 if is_frames else len(chunk)
        if fed >= count:
            break
    if not decoder.works():
        raise AssertionError(f"{decoder.name} no longer understands what it is meant for")
    return fed, longest_s


def abort() -> None:
    """End at once: the decoder hangs."""
    print("the decoder hangs", flush=True)
    os._exit(1)


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__)
    parser.add_argument(
        "--count", type=int, default=1_000_000, help="bytes or frames for each decoder (default a million)"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the bytes and frames (default 0)")
    arguments = parser.parse_args()
    figures: dict[str, float] = {}
    for decoder in make_decoders():
        guard = threading.Timer(HANG_S, abort)
        guard.daemon = True
        guard.start()
        is_frames = decoder.name in ("odrive host", "odrive device")
        fed, longest_s = fuzz(decoder, arguments.count, is_frames, arguments.seed)
        guard.cancel()
        key = decoder.name.replace(" ", "_")
        figures |= {f"{key}_{'frames' if is_frames else 'bytes'}": fed, f"{key}_longest_ms": round(1000 * longest_s, 2)}
        print(f"{decoder.name:24} {fed:9} {'frames' if is_frames else 'bytes':6}  longest {1000 * longest_s:8.2f} ms")
    if arguments.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
