"""What no run writes: numbers and counts that are right by checksum and absurd all the same.

A log may come from anybody. What is refused here would otherwise cost hours or all memory in some room above.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence, Sized
from functools import lru_cache

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

from vvvaltr.controller.core.conditions import check_speed
from vvvaltr.controller.runs.schema import vvvaltr_pb2 as pb

MOST_BYTES = 64 << 20
"""Of one message: a picture, the ground, or a source of a million trials."""

MOST_LOG_BYTES = 8 << 30
"""Of a log: a thousand hours at 25 poses a second."""

_GREATEST = {"_m_s": 1e3, "_m": 1e5, "_hz": 1e5, "_rad": 1e6, "_s": 1e12}  # by the unit in a field's name
_GREATEST_NUMBER = 1e15
_LONGEST_S, _FARTHEST_M = 1e5, 1e5
_MOST = {"gaits": 1_000_000, "scores_m_s": 1_000_000, "height_m": 1_000_000}
_MOST_ENTRIES, _MOST_LETTERS = 10_000, 100_000

MOST_MOTORS, MOST_MARKERS = 64, _MOST_ENTRIES
"""Of a robot, and numbers of a pose's markers."""


def check_message(message: Message) -> None:
    """Raise ValueError, naming the field, if a message holds what no run writes."""
    for field, value in message.ListFields():
        if field.message_type and field.message_type.GetOptions().map_entry:
            _check_map(field.name, value)
        elif field.is_repeated:
            check_count(field.name, value, _MOST.get(field.name, _MOST_ENTRIES))
            _check_values(field, value)
        else:
            _check_values(field, (value,))
    match message:
        case pb.Gait():
            check_count("gait.frequency_hz", message.frequency_hz, MOST_MOTORS)
        case pb.Structure():
            _check_structure(message)
        case pb.Source():
            for number, score_m_s in enumerate(message.scores_m_s, start=1):
                check_speed(score_m_s, f"source {message.name}, trial {number}")
        case pb.Trial() if message.HasField("score_m_s"):
            check_speed(message.score_m_s, f"trial {message.number}")


def check_size(topic: str, payload: bytes) -> None:
    """Raise ValueError for a message that is too large to be read."""
    if len(payload) > MOST_BYTES:
        raise ValueError(f"a message on {topic} has {len(payload)} bytes; allowed: up to {MOST_BYTES}")


def check_times(times_s: Sequence[float]) -> None:
    """Raise ValueError for a time within a trial that none has; NaN is none."""
    check_numbers("t_s", times_s, _LONGEST_S)


def check_place(x_m: float, y_m: float, z_m: float) -> None:
    """Raise ValueError for a place that is too far away. A pose may be no number: that is what the tracker said."""
    if _FARTHEST_M < max(abs(x_m), abs(y_m), abs(z_m)) < math.inf:
        raise ValueError(f"a pose is farther away than {_FARTHEST_M:g} m")


def bounded(name: str, numbers: Sequence[float]) -> tuple[float, ...]:
    """Return the numbers of a field. Raises ValueError, naming the field, as ``check_message`` does."""
    check_count(name, numbers, _MOST.get(name, _MOST_ENTRIES))
    values = tuple(numbers)
    check_numbers(name, values)
    return values


def counted(name: str, numbers: Sequence[float], most: int) -> tuple[float, ...]:
    """Return the numbers of a field, whatever they are. Raises ValueError, naming the field, for too many."""
    if not numbers:
        return ()
    check_count(name, numbers, most)
    return tuple(numbers[:])  # a list first: a field's own iterator takes twice the time


def check_count(name: str, values: Sized, most: int = _MOST_ENTRIES) -> None:
    """Raise ValueError for too many values."""
    if len(values) > most:
        raise ValueError(f"{name} has {len(values)} values; allowed: up to {most}")


def check_numbers(name: str, numbers: Sequence[float], greatest: float | None = None) -> None:
    """Raise ValueError, naming the field, if one of the numbers is not finite or too great for its unit."""
    if not numbers:
        return
    most = _find_greatest(name) if greatest is None else greatest
    # Most of a log are such numbers: whole series are looked at, and NaN, which no comparison finds, by the sum.
    if min(numbers) < -most or max(numbers) > most or math.isnan(sum(numbers)):
        number = next(it for it in numbers if not abs(it) <= most)
        raise ValueError(f"{name} is {number:g}; allowed: finite numbers up to {most:g}")


def _check_values(field: FieldDescriptor, values: Iterable[object]) -> None:
    match field.cpp_type:
        case FieldDescriptor.CPPTYPE_MESSAGE:
            for value in values:
                check_message(value)  # type: ignore[arg-type]
        case FieldDescriptor.CPPTYPE_STRING:
            for value in values:
                _check_text(field.name, value)
        case FieldDescriptor.CPPTYPE_DOUBLE:
            check_numbers(field.name, tuple(values))  # type: ignore[arg-type]


def _check_map(name: str, content: Mapping[str, object]) -> None:
    check_count(name, content)
    for key, value in content.items():
        _check_text(name, key)
        if isinstance(value, float):
            check_numbers(key, (value,))
        else:
            _check_text(key, value)


def _check_text(name: str, text: object) -> None:
    if isinstance(text, str) and len(text) > _MOST_LETTERS:
        raise ValueError(f"{name} has {len(text)} letters; allowed: up to {_MOST_LETTERS}")


@lru_cache(128)  # not of all names: those of a map are the log's
def _find_greatest(name: str) -> float:
    return next((most for unit, most in _GREATEST.items() if name.endswith(unit)), _GREATEST_NUMBER)


def _check_structure(message: pb.Structure) -> None:
    ends = 2 * len(message.struts)
    edges = (*message.struts, *message.springs)
    if any(end >= ends for edge in edges for end in (edge.first, edge.second)):
        raise ValueError("structure: an edge ends at a strut end that does not exist")
    if any(strut >= len(message.struts) for strut in message.motor_struts):
        raise ValueError("structure: a motor is on a strut that does not exist")
    check_count("motor_struts", message.motor_struts, MOST_MOTORS)
