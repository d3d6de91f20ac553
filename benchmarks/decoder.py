"""A decoder to be fed by a fuzzer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Decoder:
    """A decoder of bytes from a line, behind one interface.

    Args:
        name: line, and end of the line.
        feed: feeds bytes; it catches the errors that the decoder is documented to raise, and no others.
        samples: valid input, to be mutated.
        works: returns whether the decoder still understands valid input; called once, at the end.
    """

    name: str
    feed: Callable[[bytes], None]
    samples: tuple[bytes, ...]
    works: Callable[[], bool]
